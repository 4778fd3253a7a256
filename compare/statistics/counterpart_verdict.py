"""Two captures of one thing, real and synthetic say: whether the methods fail alike on both, and how sure that is.

Three questions, each answered alike, differ or not shown: are the errors as large, are they at the same places, do
they rank the methods alike.
"""

from typing import Any

import numpy as np

from compare.statistics.block_bootstrap import KEYS, memory_of
from compare.statistics.counterpart_draws import Capture, Drawn, drawn_maps, sides_of, thinned
from compare.statistics.error_patterns import error_pattern
from compare.statistics.solver_order import LEVEL, Medians, solver_order
from scene.errors import SceneError

DRAWS = 1000
MARGIN_DEG, MARGIN_SHARE = 0.5, 0.25
"""As large as each other: errors that differ by less than the larger of the two, degrees and share of their mean."""


def compare_counterparts(real: Capture, twin: Capture, *, seed: int = 0, draws: int = DRAWS) -> dict[str, Any]:
    """Compare the methods' errors on two captures.

    Parameters
    ----------
    real, twin : Capture
        Of the same methods. Where both are of one size and show the object at the same pixels, differences are taken
        pixel by pixel, and patterns laid over each other.
    seed : int
    draws : int
        Of blocks of pixels, lights and registration.

    Returns
    -------
    dict
        captures: name, kind, carried of each; laid_over; left_out: methods without any known error on one of the
        two; methods, by name: real and twin (`angular_statistics`, and sigma of each of `KEYS`), difference (by key:
        deg, sigma_deg, significant), level and pattern (pixels that both know, pearson, spearman, their low and high
        of 95 %, structured shares, verdict); order (`solver_order`); level: p, the chance of so large a largest
        difference if the errors were as large on both, and verdict; pattern: verdict; verdict and reasons.

    Raises
    ------
    SceneError
        No method has a known error on both.

    Notes
    -----
    Blocks are drawn for both captures together where they are laid over each other, so that what both share cancels.
    Significance is over all methods and statistics together: the largest |difference| / sigma is held against the
    largest of each draw [Westfall1993], degrees of freedom by the number of independent patches.
    """
    common = tuple(name for name in real.errors if name in twin.errors)
    rng = np.random.default_rng(seed)
    maps, laid_over = thinned(real, twin, common)
    left_out = [name for name in common if not all(np.isfinite(of[name]).any() for of in maps.values())]
    methods = tuple(name for name in common if name not in left_out)
    if not methods:
        raise SceneError(
            f"{real.name} against {twin.name}: no method has a known error on both (looked at: {', '.join(common)}). "
            "Process both again, or by other methods."
        )
    drawn = drawn_maps(real, twin, maps, methods, laid_over, draws, rng)
    rows: dict[str, dict[str, Any]] = {}
    for name in methods:
        pair = {"real": drawn["real"][name], "twin": drawn["twin"][name]}
        rows[name] = {
            kind: {**one.statistics, "sigma": dict(zip(KEYS, one.spread.std(0).tolist(), strict=True))}
            for kind, one in pair.items()
        }
    level = _levels(rows, drawn, methods, laid_over)
    pattern = _patterns(rows, drawn, methods, laid_over, draws, rng)
    if laid_over:
        for name in methods:
            both = np.isfinite(real.errors[name]) & np.isfinite(twin.errors[name])
            rows[name]["pattern"]["pixels"] = int(np.count_nonzero(both))
    order = solver_order(methods, *(_medians(side, drawn[kind], methods) for kind, side in sides_of(real, twin)))
    verdict, reasons = _verdict(level, pattern, order, methods)
    return {
        "captures": {
            kind: {"name": side.name, "kind": side.kind, "carried": side.carried} for kind, side in sides_of(real, twin)
        },
        "laid_over": laid_over,
        "left_out": left_out,
        "methods": rows,
        "level": level,
        "pattern": pattern,
        "order": order,
        "verdict": verdict,
        "reasons": reasons,
    }


def _levels(
    rows: dict[str, dict[str, Any]], drawn: dict[str, dict[str, Drawn]], methods: tuple[str, ...], laid_over: bool
) -> dict[str, Any]:
    """Fill in how much larger the errors of the one capture are, and return what holds for all together."""
    from scipy.stats import norm, t

    z, chance, sigmas = [], [], {}
    for name in methods:
        real, twin = drawn["real"][name], drawn["twin"][name]
        if laid_over:
            # What both share cancels, and its memory with it.
            memory = memory_of(real.error - twin.error)
            pixels = (real.draws - twin.draws) * memory.inflation(real.blocks)
            patches = memory.patches
            spread = pixels - pixels.mean(0) + (real.shifts - real.shifts.mean(0)) - (twin.shifts - twin.shifts.mean(0))
        else:
            spread, patches = real.spread - twin.spread, min(real.memory.patches, twin.memory.patches)
        sigma = np.maximum(spread.std(0), 1e-9)
        sigmas[name] = sigma
        found = (real.point - twin.point) / sigma
        z.append(norm.isf(t.sf(np.abs(found), max(3.0, patches - 1))))
        chance.append(np.abs(spread) / sigma)
    largest = np.concatenate(chance, 1).max(1)
    bar, verdicts = float(np.quantile(largest, 1 - LEVEL)), []
    for name, one in zip(methods, z, strict=True):
        real, twin, row = drawn["real"][name], drawn["twin"][name], rows[name]
        difference, mean = real.point - twin.point, (real.point + twin.point) / 2
        margin = np.maximum(MARGIN_DEG, MARGIN_SHARE * mean)
        row["difference"] = {
            key: {"deg": float(difference[i]), "sigma_deg": float(sigmas[name][i]), "significant": bool(one[i] > bar)}
            for i, key in enumerate(KEYS)
        }
        beyond = (one > bar) & (np.abs(difference) > margin)
        within = np.abs(difference[1]) + norm.isf(LEVEL) * sigmas[name][1] < margin[1]
        row["level"] = "differ" if beyond.any() else "alike" if within else "not shown"
        verdicts.append(row["level"])
    p = (1 + np.count_nonzero(largest >= np.max(z))) / (1 + len(largest))
    verdict = "differ" if "differ" in verdicts else "alike" if set(verdicts) == {"alike"} else "not shown"
    return {"p": float(p), "verdict": verdict}


def _patterns(
    rows: dict[str, dict[str, Any]],
    drawn: dict[str, dict[str, Drawn]],
    methods: tuple[str, ...],
    laid_over: bool,
    count: int,
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Fill in how far the errors lie at the same places, and return what holds for the methods together."""
    for name in methods:
        rows[name]["pattern"] = None
    if not laid_over:
        return {"verdict": "not shown"}
    for name in methods:
        real, twin = drawn["real"][name].error, drawn["twin"][name].error
        rows[name]["pattern"] = error_pattern(real, twin, count, rng)
    verdicts = [rows[name]["pattern"]["verdict"] for name in methods]
    half = len(methods) / 2
    if verdicts.count("differ") >= half:
        return {"verdict": "differ"}
    return {"verdict": "alike" if verdicts.count("alike") >= half and "differ" not in verdicts else "not shown"}


def _medians(side: Capture, drawn: dict[str, Drawn], methods: tuple[str, ...]) -> Medians:
    at = KEYS.index("median_deg")
    of = [drawn[name] for name in methods]
    return Medians(
        side.name,
        np.array([one.point[at] for one in of]),
        np.stack([one.draws[:, at] for one in of], 1),
        np.array([one.inflation for one in of]),
        np.stack([one.shifts[:, at] for one in of], 1),
        np.array([one.memory.patches for one in of]),
    )


def _verdict(
    level: dict[str, Any], pattern: dict[str, Any], order: dict[str, Any], methods: tuple[str, ...]
) -> tuple[str, dict[str, str]]:
    """Return alike, differ or not shown, and the answers it is made of."""
    reasons = {"level": level["verdict"], "pattern": pattern["verdict"]}
    if len(methods) > 1:
        reasons["order"] = {"same": "alike"}.get(order["verdict"], order["verdict"])
    if "differ" in reasons.values():
        return "differ", reasons
    asked = [answer for question, answer in reasons.items() if question != "level"]
    return "alike" if set(asked) == {"alike"} else "not shown", reasons

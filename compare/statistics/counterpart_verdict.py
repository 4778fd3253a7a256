"""Two captures of one thing, real and synthetic say: whether the methods fail alike on both, and how sure that is.

Three questions, each answered alike, differ or not shown: are the errors as large, are they at the same places, do
they rank the methods alike.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.block_bootstrap import KEYS, Draws, draw_blocks, drawn_correlation, memory_of, structured_share
from compare.statistics.counterpart_draws import Capture, Drawn, Map, Maps, drawn_maps, thinned
from compare.statistics.solver_order import LEVEL, solver_order
from compare.statistics.statistics import angular_statistics, error_correlation
from scene.errors import SceneError

DRAWS = 1000
MARGIN_DEG, MARGIN_SHARE = 0.5, 0.25
"""As large as each other: errors that differ by less than the larger of the two, degrees and share of their mean."""
ALIKE_FROM = 0.3
"""Correlation of two error patterns from which they are alike: the report's bar."""
STRUCTURED = 0.5
"""Share of a map's variance that must be no pixel's own noise before its pattern can be called another one."""
MOST_CORRELATED = 0.999999
"""Beyond, Fisher's transform is not finite."""


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
    sides = {"real": real, "twin": twin}
    common = tuple(name for name in real.errors if name in twin.errors)
    rng = np.random.default_rng(seed)
    maps, laid_over = thinned(sides, common)
    left_out = [name for name in common if not all(np.isfinite(of[name]).any() for of in maps.values())]
    methods = tuple(name for name in common if name not in left_out)
    if not methods:
        raise SceneError(
            f"{real.name} against {twin.name}: no method has a known error on both (looked at: {', '.join(common)}). "
            "Process both again, or by other methods."
        )
    maps = {kind: {name: of[name] for name in methods} for kind, of in maps.items()}
    rows: dict[str, dict[str, Any]] = {
        name: {kind: angular_statistics(side.errors[name]) for kind, side in sides.items()} for name in methods
    }
    found = {kind: np.array([[rows[name][kind][key] for key in KEYS] for name in methods]) for kind in sides}
    drawn, blocks = drawn_maps(sides, maps, found, laid_over, draws, rng)
    for kind, one in drawn.items():
        for name, sigma in zip(methods, one.spread.std(0).tolist(), strict=True):
            rows[name][kind]["sigma"] = dict(zip(KEYS, sigma, strict=True))
    level = _levels(rows, drawn, _difference(drawn, maps, blocks["real"]) if laid_over else None)
    for name, row in rows.items():
        row["pattern"] = None
        if laid_over:
            row["pattern"] = _pattern(maps["real"][name], maps["twin"][name], draws, rng)
            both = np.isfinite(real.errors[name]) & np.isfinite(twin.errors[name])
            row["pattern"]["pixels"] = int(np.count_nonzero(both))
    order = solver_order(methods, drawn["real"].medians(), drawn["twin"].medians())
    reasons = {"level": level["verdict"], "pattern": _patterns(rows) if laid_over else "not shown"}
    asked = {reasons["pattern"]}
    if len(methods) > 1:
        reasons["order"] = {"same": "alike"}.get(order["verdict"], order["verdict"])
        asked.add(reasons["order"])
    verdict = "differ" if "differ" in reasons.values() else "alike" if asked == {"alike"} else "not shown"
    return {
        "captures": {
            kind: {"name": side.name, "kind": side.kind, "carried": side.carried} for kind, side in sides.items()
        },
        "laid_over": laid_over,
        "left_out": left_out,
        "methods": rows,
        "level": level,
        "pattern": {"verdict": reasons["pattern"]},
        "order": order,
        "verdict": verdict,
        "reasons": reasons,
    }


def _difference(drawn: dict[str, Drawn], maps: Maps, blocks: Draws) -> Drawn:
    """Return the draws of real - twin, pixel by pixel: what both share cancels, and its memory with it."""
    real, twin = drawn["real"], drawn["twin"]
    memories = [memory_of(a - b) for a, b in zip(maps["real"].values(), maps["twin"].values(), strict=True)]
    inflation = np.array([[memory.inflation(blocks)] for memory in memories])
    patches = np.array([memory.patches for memory in memories])
    return Drawn(real.found - twin.found, real.draws - twin.draws, inflation, real.shifts - twin.shifts, patches)


def _levels(rows: dict[str, dict[str, Any]], drawn: dict[str, Drawn], between: Drawn | None) -> dict[str, Any]:
    """Fill in how much larger the errors of the one capture are, and return what holds for all together."""
    from scipy.stats import norm, t

    real, twin = drawn["real"], drawn["twin"]
    spread = real.spread - twin.spread if between is None else between.spread
    patches = np.minimum(real.patches, twin.patches) if between is None else between.patches
    difference, sigma = real.found - twin.found, np.maximum(spread.std(0), 1e-9)
    z = norm.isf(t.sf(np.abs(difference / sigma), np.maximum(3.0, patches - 1)[:, None]))
    largest = (np.abs(spread) / sigma).max((1, 2))
    significant = z > float(np.quantile(largest, 1 - LEVEL))
    margin = np.maximum(MARGIN_DEG, MARGIN_SHARE * (real.found + twin.found) / 2)
    beyond = np.any(significant & (np.abs(difference) > margin), axis=1)
    at = KEYS.index("median_deg")
    within = np.abs(difference[:, at]) + norm.isf(LEVEL) * sigma[:, at] < margin[:, at]
    for i, row in enumerate(rows.values()):
        row["difference"] = {
            key: {"deg": float(deg), "sigma_deg": float(one), "significant": bool(shown)}
            for key, deg, one, shown in zip(KEYS, difference[i], sigma[i], significant[i], strict=True)
        }
        row["level"] = "differ" if beyond[i] else "alike" if within[i] else "not shown"
    verdicts = {row["level"] for row in rows.values()}
    verdict = "differ" if "differ" in verdicts else "alike" if verdicts == {"alike"} else "not shown"
    return {"p": float((1 + np.count_nonzero(largest >= z.max())) / (1 + len(largest))), "verdict": verdict}


def _pattern(real: Map, twin: Map, count: int, rng: np.random.Generator) -> dict[str, Any]:
    """Return how alike two error maps (H, W) are, with 95 % intervals by `count` draws of blocks, and what that shows.

    pearson and spearman (None where a map is constant), each with _low and _high; structured: the share of each map
    that is no pixel's own noise; verdict: alike, differ, not shown.
    """
    from scipy.stats import norm, rankdata

    found = error_correlation(real, twin)
    both = np.isfinite(real) & np.isfinite(twin)
    if not (np.isfinite(found["pearson"]) and np.isfinite(found["spearman"])):
        return {"pearson": None, "spearman": None, "verdict": "not shown"}
    row: dict[str, Any] = {}
    for key in ("pearson", "spearman"):
        a, b = (np.full(real.shape, np.nan) for _ in range(2))
        for to, error in ((a, real), (b, twin)):
            values: NDArray = error[both].astype(np.float64)
            to[both] = values if key == "pearson" else rankdata(values)
        memory = memory_of((a - a[both].mean()) * (b - b[both].mean()))
        blocks = draw_blocks(both, memory.length_px, count, rng)
        # Fisher's transform: there the spread does not depend on the correlation.
        drawn, middle = (
            np.arctanh(np.clip(r, -MOST_CORRELATED, MOST_CORRELATED))
            for r in (drawn_correlation(a, b, blocks), found[key])
        )
        reach = norm.isf(LEVEL / 2) * np.std(drawn) * memory.inflation(blocks)
        low, high = float(np.tanh(middle - reach)), float(np.tanh(middle + reach))
        row |= {key: float(found[key]), f"{key}_low": low, f"{key}_high": high}
    row["structured"] = {"real": structured_share(real), "twin": structured_share(twin)}
    another = row["pearson_high"] < ALIKE_FROM and min(row["structured"].values()) > STRUCTURED
    row["verdict"] = "alike" if row["pearson_low"] > ALIKE_FROM else "differ" if another else "not shown"
    return row


def _patterns(rows: dict[str, dict[str, Any]]) -> str:
    """Return whether half of the methods or more err at the same places, and none at others; or at others."""
    verdicts = [row["pattern"]["verdict"] for row in rows.values()]
    half = len(verdicts) / 2
    if verdicts.count("differ") >= half:
        return "differ"
    return "alike" if verdicts.count("alike") >= half and "differ" not in verdicts else "not shown"

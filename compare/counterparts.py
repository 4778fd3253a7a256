"""Two captures of one thing, real and synthetic say: whether the methods fail alike on both, and how sure that is.

Three questions, each answered alike, differ or not shown: are the errors as large, are they at the same places, do
they rank the methods alike.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.block_bootstrap import (
    KEYS,
    Draws,
    Memory,
    draw_blocks,
    drawn_statistics,
    memory_of,
)
from compare.error_patterns import error_pattern
from compare.solver_order import LEVEL, Medians, solver_order
from compare.statistics import angular_statistics

Array = NDArray[np.float64]
Map = NDArray[np.float32]

DRAWS = 1000
PIXELS = 200_000
"""Of a map at most so many are looked at, every n-th: more tell nothing that their neighbours do not."""
MARGIN_DEG, MARGIN_SHARE = 0.5, 0.25
"""Errors that differ by less than both, degrees and share of their mean, are as large as each other."""
OVERLAP = 0.5
"""Of the smaller capture's pixels, that both must have before maps are laid over each other."""


@dataclass(frozen=True)
class Capture:
    """The methods' errors on one capture.

    Parameters
    ----------
    name : str
    kind : str
        What it is: photographs, virtual capture, rendering.
    errors : mapping of str to (H, W) float32
        By method; degrees, NaN where unknown.
    shifts : mapping of str to (K, 4) float64
        By method, as far as they could be had: what `KEYS` of the errors change by when lights and registration move by
        their sigmas; row k is the same movement for every method.
    carried : dict
        What those movements were, for the page.
    """

    name: str
    kind: str
    errors: Mapping[str, Map]
    shifts: Mapping[str, Array] = field(default_factory=dict)
    carried: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class _Drawn:
    """A method's errors on one capture, drawn: point (4,), draws (B, 4), shifts (B, 4)."""

    error: Map
    point: Array
    draws: Array
    shifts: Array
    memory: Memory
    blocks: Draws

    @property
    def inflation(self) -> float:
        return self.memory.inflation(self.blocks)

    @property
    def spread(self) -> Array:
        return (self.draws - self.draws.mean(0)) * self.inflation + self.shifts - self.shifts.mean(0)


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
        captures: name, kind, carried of each; laid_over; methods, by name: real and twin (`angular_statistics`, and
        sigma of each of `KEYS`), difference (by key: deg, sigma_deg, significant), level and pattern (pearson,
        spearman, their low and high of 95 %, structured shares, verdict); order (`solver_order`); level: p, the
        chance of so large a largest difference if the errors were as large on both, and
        verdict; pattern: verdict; verdict and reasons.

    Notes
    -----
    Blocks are drawn for both captures together where they are laid over each other, so that what both share cancels.
    Significance is over all methods and statistics together: the largest |difference| / sigma is held against the
    largest of each draw [Westfall1993], degrees of freedom by the number of independent patches.
    """
    methods = tuple(name for name in real.errors if name in twin.errors)
    rng = np.random.default_rng(seed)
    laid_over = _laid_over(real, twin, methods)
    drawn = _drawn(real, twin, methods, laid_over, draws, rng)
    rows: dict[str, dict[str, Any]] = {}
    for name in methods:
        pair = {"real": drawn["real"][name], "twin": drawn["twin"][name]}
        rows[name] = {
            kind: {**angular_statistics(one.error), "sigma": dict(zip(KEYS, one.spread.std(0).tolist(), strict=True))}
            for kind, one in pair.items()
        }
    level = _levels(rows, drawn, methods, laid_over)
    pattern = _patterns(rows, drawn, methods, laid_over, draws, rng)
    order = solver_order(methods, *(_medians(side, drawn[kind], methods) for kind, side in _sides(real, twin)))
    verdict, reasons = _verdict(level, pattern, order, methods)
    return {
        "captures": {
            kind: {"name": side.name, "kind": side.kind, "carried": side.carried} for kind, side in _sides(real, twin)
        },
        "laid_over": laid_over,
        "methods": rows,
        "level": level,
        "pattern": pattern,
        "order": order,
        "verdict": verdict,
        "reasons": reasons,
    }


def _sides(real: Capture, twin: Capture) -> tuple[tuple[str, Capture], ...]:
    return ("real", real), ("twin", twin)


def _laid_over(real: Capture, twin: Capture, methods: tuple[str, ...]) -> bool:
    a, b = (np.isfinite(side.errors[methods[0]]) for side in (real, twin))
    if a.shape != b.shape:
        return False
    return bool(np.count_nonzero(a & b) >= OVERLAP * min(np.count_nonzero(a), np.count_nonzero(b)))


def _drawn(
    real: Capture, twin: Capture, methods: tuple[str, ...], laid_over: bool, count: int, rng: np.random.Generator
) -> dict[str, dict[str, _Drawn]]:
    """Return every method's draws on both captures."""
    maps = {kind: {name: _thinned(side.errors[name]) for name in methods} for kind, side in _sides(real, twin)}
    # The methods' common length decides how wide blocks are; what is still cut is put back by each map's own.
    memories = {kind: {name: memory_of(error) for name, error in of.items()} for kind, of in maps.items()}
    seen = {kind: np.logical_or.reduce([np.isfinite(error) for error in of.values()]) for kind, of in maps.items()}
    length = {kind: float(np.median([memory.length_px for memory in of.values()])) for kind, of in memories.items()}
    if laid_over:
        shared = draw_blocks(seen["real"] | seen["twin"], max(length.values()), count, rng)
        blocks = {"real": shared, "twin": shared}
    else:
        blocks = {kind: draw_blocks(seen[kind], length[kind], count, rng) for kind in maps}
    found: dict[str, dict[str, _Drawn]] = {}
    for kind, side in _sides(real, twin):
        total = blocks[kind].count
        moves = rng.integers(1 << 30, size=total)
        found[kind] = {}
        for name, error in maps[kind].items():
            shifts = side.shifts.get(name)
            moved = np.zeros((total, len(KEYS))) if shifts is None else np.asarray(shifts)[moves % len(shifts)]
            statistics = angular_statistics(error)
            point = np.array([statistics[key] for key in KEYS])
            memory = memories[kind][name]
            draws = drawn_statistics(error, blocks[kind])
            found[kind][name] = _Drawn(error, point, draws, moved, memory, blocks[kind])
    return found


def _thinned(error: Map) -> Map:
    step = int(np.ceil(np.sqrt(max(1.0, np.count_nonzero(np.isfinite(error)) / PIXELS))))
    return np.asarray(error[::step, ::step], np.float32)


def _levels(
    rows: dict[str, dict[str, Any]], drawn: dict[str, dict[str, _Drawn]], methods: tuple[str, ...], laid_over: bool
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
    drawn: dict[str, dict[str, _Drawn]],
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


def _medians(side: Capture, drawn: dict[str, _Drawn], methods: tuple[str, ...]) -> Medians:
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

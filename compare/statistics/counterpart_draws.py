"""Two captures' error maps made ready to be compared: thinned alike, and drawn in blocks, the same for all methods."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.block_bootstrap import KEYS, Draws, Memory, draw_blocks, drawn_statistics, memory_of
from compare.statistics.statistics import angular_statistics

Array = NDArray[np.float64]
Map = NDArray[np.float32]
Maps = dict[str, dict[str, Map]]

PIXELS = 200_000
"""Of a capture at most so many are drawn from, every n-th: more tell nothing that their neighbours do not."""
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
class Drawn:
    """A method's errors on one capture: of the whole map `statistics` and, of them, point (4,); the thinned map and
    what was drawn of it, draws (B, 4), shifts (B, 4).
    """

    statistics: dict[str, float | int]
    error: Map
    draws: Array
    shifts: Array
    memory: Memory
    blocks: Draws

    @property
    def point(self) -> Array:
        return np.array([self.statistics[key] for key in KEYS])

    @property
    def inflation(self) -> float:
        return self.memory.inflation(self.blocks)

    @property
    def spread(self) -> Array:
        return (self.draws - self.draws.mean(0)) * self.inflation + self.shifts - self.shifts.mean(0)


def sides_of(real: Capture, twin: Capture) -> tuple[tuple[str, Capture], ...]:
    """Return the two captures with their names in the numbers."""
    return ("real", real), ("twin", twin)


def thinned(real: Capture, twin: Capture, methods: tuple[str, ...]) -> tuple[Maps, bool]:
    """Return every n-th pixel of all maps, one n for a capture, and whether the two are laid over each other."""
    sides = sides_of(real, twin)
    seen = {kind: np.logical_or.reduce([np.isfinite(side.errors[name]) for name in methods]) for kind, side in sides}
    laid_over = _laid_over(seen["real"], seen["twin"])
    steps = {kind: int(np.ceil(np.sqrt(max(1.0, np.count_nonzero(known) / PIXELS)))) for kind, known in seen.items()}
    if laid_over:
        steps = dict.fromkeys(steps, max(steps.values()))
    return {
        kind: {name: np.asarray(side.errors[name][:: steps[kind], :: steps[kind]], np.float32) for name in methods}
        for kind, side in sides
    }, laid_over


def _laid_over(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> bool:
    if a.shape != b.shape:
        return False
    return bool(np.count_nonzero(a & b) >= OVERLAP * min(np.count_nonzero(a), np.count_nonzero(b)))


def drawn_maps(
    real: Capture,
    twin: Capture,
    thin: Maps,
    methods: tuple[str, ...],
    laid_over: bool,
    count: int,
    rng: np.random.Generator,
) -> dict[str, dict[str, Drawn]]:
    """Return every method's draws on both captures."""
    maps = {kind: {name: of[name] for name in methods} for kind, of in thin.items()}
    # The methods' common length decides how wide blocks are; what is still cut is put back by each map's own.
    memories = {kind: {name: memory_of(error) for name, error in of.items()} for kind, of in maps.items()}
    seen = {kind: np.logical_or.reduce([np.isfinite(error) for error in of.values()]) for kind, of in maps.items()}
    length = {kind: float(np.median([memory.length_px for memory in of.values()])) for kind, of in memories.items()}
    if laid_over:
        shared = draw_blocks(seen["real"] | seen["twin"], max(length.values()), count, rng)
        blocks = {"real": shared, "twin": shared}
    else:
        blocks = {kind: draw_blocks(seen[kind], length[kind], count, rng) for kind in maps}
    found: dict[str, dict[str, Drawn]] = {}
    for kind, side in sides_of(real, twin):
        total = blocks[kind].count
        moves = rng.integers(1 << 30, size=total)
        found[kind] = {}
        for name, error in maps[kind].items():
            shifts = side.shifts.get(name)
            moved = np.zeros((total, len(KEYS))) if shifts is None else np.asarray(shifts)[moves % len(shifts)]
            statistics = angular_statistics(side.errors[name])
            drawn = drawn_statistics(error, blocks[kind])
            found[kind][name] = Drawn(statistics, error, drawn, moved, memories[kind][name], blocks[kind])
    return found

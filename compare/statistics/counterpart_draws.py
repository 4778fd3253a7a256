"""Two captures' error maps made ready to be compared: thinned alike, and drawn in blocks, the same for all methods."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.statistics.block_bootstrap import KEYS, Draws, draw_blocks, drawn_statistics, memory_of

Array = NDArray[np.float64]
Map = NDArray[np.float32]
Maps = dict[str, dict[str, Map]]
"""By capture (real, twin), then by method."""

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
    """Statistics of M methods' errors on one capture, and what they might have been; (M, 4) are `KEYS`, (M,) medians.

    `found` (M, 4) or (M,). `draws` (B, M, 4): over blocks of pixels. `inflation` (M, 1): what their standard deviation
    is to be multiplied by, see `Memory`. `shifts` (B, M, 4): the part of each draw that comes from lights and
    registration, which nothing inflates. `patches` (M,): independent patches of each method's map.
    """

    found: Array
    draws: Array
    inflation: Array
    shifts: Array
    patches: Array

    @property
    def spread(self) -> Array:
        """(B, M, 4) draws less their means, each method's with its own inflation."""
        return (self.draws - self.draws.mean(0)) * self.inflation + self.shifts - self.shifts.mean(0)

    def medians(self) -> "Drawn":
        """Return what holds for the median errors: without the last axis."""
        at = KEYS.index("median_deg")
        found, draws, shifts = (part[..., at] for part in (self.found, self.draws, self.shifts))
        return Drawn(found, draws, self.inflation[:, 0], shifts, self.patches)


def thinned(sides: Mapping[str, Capture], methods: tuple[str, ...]) -> tuple[Maps, bool]:
    """Return every n-th pixel of all maps, one n for a capture, and whether the two are laid over each other."""
    seen = {kind: _seen([side.errors[name] for name in methods]) for kind, side in sides.items()}
    counts = {kind: np.count_nonzero(known) for kind, known in seen.items()}
    steps = {kind: int(np.ceil(np.sqrt(max(1.0, count / PIXELS)))) for kind, count in counts.items()}
    a, b = seen.values()
    laid_over = a.shape == b.shape and bool(np.count_nonzero(a & b) >= OVERLAP * min(counts.values()))
    if laid_over:
        steps = dict.fromkeys(steps, max(steps.values()))
    return {
        kind: {name: np.asarray(side.errors[name][:: steps[kind], :: steps[kind]], np.float32) for name in methods}
        for kind, side in sides.items()
    }, laid_over


def drawn_maps(
    sides: Mapping[str, Capture],
    maps: Maps,
    found: Mapping[str, Array],
    laid_over: bool,
    count: int,
    rng: np.random.Generator,
) -> tuple[dict[str, Drawn], dict[str, Draws]]:
    """Return draws of all methods on both captures, and the blocks; `found` (M, 4): statistics of the whole maps."""
    # The methods' common length decides how wide blocks are; what is still cut is put back by each map's own.
    memories = {kind: [memory_of(error) for error in of.values()] for kind, of in maps.items()}
    seen = {kind: _seen(list(of.values())) for kind, of in maps.items()}
    length = {kind: float(np.median([memory.length_px for memory in of])) for kind, of in memories.items()}
    if laid_over:
        blocks = dict.fromkeys(maps, draw_blocks(seen["real"] | seen["twin"], max(length.values()), count, rng))
    else:
        blocks = {kind: draw_blocks(seen[kind], length[kind], count, rng) for kind in maps}
    drawn = {}
    for kind, of in maps.items():
        moves = rng.integers(1 << 30, size=blocks[kind].count)
        still = np.zeros((1, len(KEYS)))
        shifts = [np.asarray(sides[kind].shifts.get(name, still)) for name in of]
        drawn[kind] = Drawn(
            found[kind],
            np.stack([drawn_statistics(error, blocks[kind]) for error in of.values()], 1),
            np.array([[memory.inflation(blocks[kind])] for memory in memories[kind]]),
            np.stack([shift[moves % len(shift)] for shift in shifts], 1),
            np.array([memory.patches for memory in memories[kind]]),
        )
    return drawn, blocks


def _seen(maps: list[Map]) -> NDArray[np.bool_]:
    return np.logical_or.reduce([np.isfinite(error) for error in maps])

"""Pixels of the object itself, read in every frame: what there is instead of balls."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

Array = NDArray[np.float64]
MOST_PIXELS = 3000
CANDIDATES = 12000  # pixels that are read where `varied` chooses among them
FEWEST_PIXELS = 50  # from which on pixels say anything
LIT = 0.15  # share of a pixel's own brightness, or cosine, under which it is taken to stand in shadow
USUALLY_LIT = 0.6  # share of the frames in which a pixel must be lit and unclipped to be chosen
DARK = 0.01  # of white: what is darker in most frames is noise, or the sensor's pedestal
CELLS = 12  # normals are sorted into so many cells across the hemisphere, and each cell has the same say at most


@dataclass(frozen=True)
class Probe:
    """P pixels of the object in F frames."""

    pixels: NDArray[np.intp]  # (P, 2) as (u, v)
    values: NDArray[np.float32]  # (F, P, 3) linear
    clipped: NDArray[np.bool_]  # (F, P)

    def take(self, keep: NDArray | slice) -> "Probe":
        """Return some of the pixels."""
        return Probe(self.pixels[keep], self.values[:, keep], self.clipped[:, keep])

    @cached_property
    def bright(self) -> Array:
        """(P,) how bright each is where it is lit."""
        return np.quantile(self.values.mean(-1, dtype=np.float64), 0.9, axis=0) if len(self.pixels) else np.zeros(0)

    @cached_property
    def lit(self) -> NDArray[np.bool_]:
        """(F, P): unclipped and in no shadow."""
        return ~self.clipped & (self.values.mean(-1) > LIT * self.bright)


class ProbePhotometry(NamedTuple):
    """What surfaces beside the balls say of the flashes."""

    surface: str  # in words, whose it is
    intensities: Array  # (F, 3) relative, each channel's mean 1
    sigma: Array  # (F,) relative standard deviation, one frame
    residual: float  # relative misfit of the samples that were believed, robust standard deviation
    pixels: int  # how many spoke
    believed: Array  # (F,) share of a frame's lit samples that keep to the surface of the other frames; of few less


def read_beside(frames: Frames, camera: Camera, spheres: Sequence[Sphere]) -> Probe:
    """Read about `CANDIDATES` pixels of all that is no ball, see `read_probe`."""
    outside = np.ones((frames.height, frames.width), bool)
    for sphere in spheres:
        if not sphere.apart:
            outside &= ~sphere.mask(camera, grow_px=0.1 * sphere.radius_px + 2)
    return read_probe(frames, outside, most=CANDIDATES)


def read_probe(frames: Frames, region: NDArray[np.bool_], *, most: int = MOST_PIXELS) -> Probe:
    """Read about `most` pixels of a region (H, W), evenly spread, in every frame.

    Only some rows are read, whole runs of them: a stack of 24 megapixels is not gone through for 4000 pixels.
    """
    # Every so many rows and columns; the step is a fraction, so that the thinning does not jump.
    step = np.sqrt(max(1.0, np.count_nonzero(region) / most))
    down, across = (np.arange(0, size, step).astype(np.intp) for size in region.shape)
    rows, columns = np.nonzero(region[np.ix_(down, across)])
    rows, columns = down[rows], across[columns]
    values = np.empty((len(frames), len(rows), 3), np.float32)
    clipped = np.empty((len(frames), len(rows)), bool)
    for row in np.unique(rows):
        here = np.flatnonzero(rows == row)
        band, side = slice(int(row), int(row) + 1), slice(int(columns.min()), int(columns.max()) + 1)
        values[:, here] = frames.read(band, columns=side)[:, 0, columns[here] - side.start]
        clipped[:, here] = frames.saturated(band, columns=side)[:, 0, columns[here] - side.start]
    return Probe(np.stack([columns, rows], -1), values, clipped)


def varied(probe: Probe, toward: Array) -> Probe:
    """Return pixels that are lit in most frames, drawn evenly over what they seem to face: a table has one normal."""
    bright, lit = probe.bright, probe.lit
    good = np.flatnonzero((lit.mean(0) > USUALLY_LIT) & (bright > DARK)) if len(bright) else np.zeros(0, np.intp)
    good = good[bright[good] > 0.1 * np.quantile(bright, 0.9)] if len(good) else good
    if not len(good):
        return probe.take(good)
    light, weight = np.moveaxis(toward[:, good], 0, 1), lit[:, good].T[..., None]
    matrix = np.einsum("pfi,pfj->pij", light * weight, light) + 1e-6 * np.eye(3)
    # As if all flashes were equally bright: near enough to sort by.
    values = probe.values[:, good].mean(-1, dtype=np.float64)
    facing = np.linalg.solve(matrix, np.einsum("pfi,fp->pi", light * weight, values)[..., None])[..., 0]
    facing /= np.maximum(np.linalg.norm(facing, axis=1, keepdims=True), 1e-12)
    cell = ((facing[:, :2] + 1) / 2 * CELLS).astype(np.intp) @ [1, CELLS]
    order = np.argsort(cell, kind="stable")
    _, first, count = np.unique(cell[order], return_index=True, return_counts=True)
    most = next((m for m in range(10, len(good)) if np.minimum(count, m).sum() >= MOST_PIXELS), len(good))
    picks = [
        order[a : a + n][np.linspace(0, n - 1, min(n, most)).astype(np.intp)] for a, n in zip(first, count, strict=True)
    ]
    return probe.take(good[np.sort(np.concatenate(picks))])


def turned(facing: NDArray) -> Array:
    """Return the azimuth (P,) of vectors (P, 3) about their mean: pixels that face different ways err differently.

    No surface is quite matte. What that does to a fit agrees among neighbours and does not average out over pixels, so
    that the usual standard error is ten times too small (on DiLiGenT's ball: 0.15 % for an error of 2 %). The spread of
    what parts that face different ways say, not divided by their number, covers it.
    """
    axis = facing.mean(0)
    axis = axis / np.linalg.norm(axis)
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    return np.arctan2(facing @ np.cross(axis, side), facing @ side)

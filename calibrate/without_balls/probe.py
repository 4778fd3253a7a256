"""Pixels of the object itself, read in every frame: what the fall-backs have instead of balls."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.frames import Frames

Array = NDArray[np.float64]
MOST_PIXELS = 3000
SECTORS = 8  # parts of the pixels, by where they face
FEWEST_PIXELS = 50  # from which on pixels say anything


@dataclass(frozen=True)
class Probe:
    """P pixels of the object in F frames."""

    pixels: NDArray[np.intp]  # (P, 2) as (u, v)
    values: NDArray[np.float32]  # (F, P, 3) linear
    clipped: NDArray[np.bool_]  # (F, P)

    def take(self, keep: NDArray) -> "Probe":
        """Return some of the pixels."""
        return Probe(self.pixels[keep], self.values[:, keep], self.clipped[:, keep])


def read_probe(frames: Frames, region: NDArray[np.bool_], *, most: int = MOST_PIXELS) -> Probe:
    """Read about `most` pixels of a region (H, W), evenly spread, in every frame.

    Only some rows are read, whole runs of them: a stack of 24 megapixels is not gone through for 4000 pixels.
    """
    # Every so many rows and columns; the step is a fraction, so that the thinning does not jump.
    step = np.sqrt(max(1.0, np.count_nonzero(region) / most))
    down, across = (np.arange(0, size, step).astype(np.intp) for size in region.shape)
    rows, columns = np.nonzero(region[np.ix_(down, across)])
    rows, columns = down[rows], across[columns]
    if not len(rows):
        empty = np.zeros((len(frames), 0), bool)
        return Probe(np.zeros((0, 2), np.intp), np.zeros((len(frames), 0, 3), np.float32), empty)
    side = slice(int(columns.min()), int(columns.max()) + 1)
    values = np.empty((len(frames), len(rows), 3), np.float32)
    clipped = np.empty((len(frames), len(rows)), bool)
    for row in np.unique(rows):
        here = np.flatnonzero(rows == row)
        band = slice(int(row), int(row) + 1)
        values[:, here] = frames.read(band, columns=side)[:, 0, columns[here] - side.start]
        clipped[:, here] = frames.saturated(band, columns=side)[:, 0, columns[here] - side.start]
    return Probe(np.stack([columns, rows], -1), values, clipped)


def sectors(facing: NDArray) -> list[NDArray[np.intp]]:
    """Return the indices of vectors (P, 3), parted by their azimuth about their mean; small parts are left out.

    Notes
    -----
    No surface is quite matte. What that does to a fit agrees among neighbours and does not average out over pixels,
    so that the usual standard error is ten times too small (on DiLiGenT's ball: 0.15 % for an error of 2 %).
    Parts that face different ways err differently: their spread, not divided by their number, covers it.
    """
    axis = facing.mean(0)
    axis = axis / np.linalg.norm(axis)
    side = np.cross(axis, [0.0, 1.0, 0.0] if abs(axis[1]) < 0.9 else [1.0, 0.0, 0.0])
    azimuth = np.arctan2(facing @ np.cross(axis, side), facing @ side) + np.pi
    number = np.minimum((azimuth / (2 * np.pi) * SECTORS).astype(np.intp), SECTORS - 1)
    parts = [np.flatnonzero(number == k) for k in range(SECTORS)]
    return [part for part in parts if len(part) >= FEWEST_PIXELS]


def by_channel(values: NDArray, strength: Array, cosine: Array, weight: Array) -> Array:
    """Return intensities (F, 3) by values (F, P, 3): each channel has albedos and strengths of its own.

    `strength` (F,) is where they begin; the shading `cosine` (F, P) and the weights (F, P) are shared.
    """
    out = np.empty((len(strength), 3))
    for c in range(3):
        channel, e = values[..., c].astype(np.float64), strength.copy()
        for _ in range(20):
            shape = cosine * e[:, None]
            albedo = np.sum(weight * shape * channel, 0) / np.maximum(np.sum(weight * shape**2, 0), 1e-12)
            part = albedo * cosine
            relative = weight / np.maximum(albedo, 1e-6) ** 2
            e = np.sum(relative * part * channel, 1) / np.sum(relative * part**2, 1)
        out[:, c] = e
    return out

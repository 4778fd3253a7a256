"""Pixels of the object itself, read in every frame: what the fall-backs have instead of balls."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.frames import Frames

MOST_PIXELS = 3000


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

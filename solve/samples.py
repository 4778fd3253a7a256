"""From the frames to what the solvers see: one row of gray samples a pixel, and where the light is."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights

GRAY = np.array([0.2989, 0.5870, 0.1140])
"""Rec. 601 weights, as the published DiLiGenT figures use them [Shi2019]."""

SPARSE = 0.15
"""Share of a box's pixels under which they are read one by one."""
_BAND_BYTES = 64 << 20


@dataclass(frozen=True)
class Samples:
    """P pixels of one row band, pixel-major.

    Parameters
    ----------
    gray : (P, F) float32
        Weighted over channels, each divided by its light's intensity.
    color : (P, F, 3) float32
        Linear RGB.
    valid : (P, F) bool
        Not clipped.
    points : (P, 3) float64
        Camera frame, mm: the pixels' rays at the depth of the lights' reference point.
    """

    gray: NDArray[np.float32]
    color: NDArray[np.float32]
    valid: NDArray[np.bool_]
    points: NDArray[np.float64]


def bands(frames: Frames, mask: NDArray[np.bool_]) -> Iterator[slice]:
    """Yield the row slices that hold pixels of the mask, each small enough for the cache of a worker."""
    used = np.flatnonzero(mask.any(1))
    if not len(used):
        return
    for band in frames.bands(_BAND_BYTES):
        start, stop = max(band.start, used[0]), min(band.stop, used[-1] + 1)
        if start < stop and mask[start:stop].any():
            yield slice(int(start), int(stop))


def read_samples(frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_], rows: slice) -> Samples:
    """Return the samples of the pixels of a row band, in the order of its mask (h, W), read frame by frame."""
    row, column = np.nonzero(mask)
    box = slice(int(column.min()), int(column.max()) + 1)
    inside = mask[:, box]
    color = np.empty((len(row), len(frames), 3), np.float32)
    valid = np.empty((len(row), len(frames)), bool)
    # A mask with few pixels in its box costs less pixel by pixel.
    sparse = len(row) < SPARSE * inside.size
    for index in range(len(frames)):
        if sparse:
            color[:, index], clipped = frames.read_pixels(index, row + rows.start, column)
        else:
            color[:, index] = frames.read(rows, [index], columns=box)[0][inside]
            clipped = frames.saturated(rows, [index], columns=box)[0][inside]
        valid[:, index] = ~clipped
    weights = (GRAY / lights.intensities).astype(np.float32)
    gray = np.einsum("pfc,fc->pf", color, weights)
    pixels = np.stack([column, row + rows.start], -1)
    return Samples(gray, color, valid, camera.points_at_depth(pixels, lights.reference_point_mm[2]))


def scale_of(frames: Frames, lights: Lights, mask: NDArray[np.bool_]) -> float:
    """Return the 99th percentile of the lit gray samples, from at most some 20,000 pixels under the mask.

    Every threshold of the solvers is relative to it, so that exposure changes nothing.
    """
    rows = np.flatnonzero(mask.any(1))
    step = max(1, int(mask.sum() // 20_000))
    values = []
    weights = (GRAY / lights.intensities).astype(np.float32)
    for row in rows[:: max(1, min(step, len(rows) // 16))]:
        line = slice(int(row), int(row) + 1)
        values.append(np.einsum("fpc,fc->fp", frames.read(line)[:, 0][:, mask[row]], weights).ravel())
    return float(np.percentile(np.concatenate(values), 99))

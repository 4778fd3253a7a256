"""The whole stack at a size at which searching is cheap: 24 megapixels cost little more than two."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames, decode
from scene.spheres import Sphere

LONGEST_SIDE_PX = 1200
"""Balls are looked for from a radius of 6 coarse pixels on, and found reliably from 15: 0.5 and 1.25 % of the longer
side, in 24 megapixels (6000 px) 30 and 75 px. A smaller one needs `center_px` and `radius_px`."""

READERS = 2
"""Threads that shrink frames: OpenCV and the page cache work beside Python."""
SEARCHED = 20
"""Frames in which balls are looked for: more of them show no other edges."""


@dataclass(frozen=True)
class Coarse:
    """The stack shrunk by averaging `factor` x `factor` pixels.

    Parameters
    ----------
    images : (F, h, w) float32
        Linear, mean of the channels, ambient subtracted; at most `SEARCHED` of the frames, evenly spread.
    camera : Camera
        The camera of the shrunken images.
    factor : int
    """

    images: NDArray[np.float32]
    camera: Camera
    factor: int

    def window(self, frames: Frames, rows: slice, columns: slice) -> NDArray[np.float32]:
        """Return (F, rows, columns): a window of all frames, shrunk alike."""
        return _shrunk(frames, np.arange(len(frames)), self.factor, rows, columns)

    def to_full(self, pixels: NDArray) -> NDArray[np.float64]:
        """Return full-size pixels of coarse pixels (..., 2): pixel centres are integers at both sizes."""
        return (np.asarray(pixels, np.float64) + 0.5) * self.factor - 0.5

    def sphere_to_full(self, sphere: Sphere) -> Sphere:
        """Return a ball of the shrunken images as the full-size camera sees it."""
        return replace(
            sphere, center_px=self.to_full(sphere.center_px), radius_px=float(sphere.radius_px * self.factor)
        )

    def from_full(self, sphere: Sphere) -> Sphere:
        """Return the ball as `camera` sees it."""
        center = (sphere.center_px + 0.5) / self.factor - 0.5
        return replace(sphere, center_px=center, radius_px=sphere.radius_px / self.factor)


def shrink(frames: Frames, camera: Camera, *, progress: Callable[[int, int], None] | None = None) -> Coarse:
    """Return the stack shrunk so that its longer side is at most `LONGEST_SIDE_PX`, and `SEARCHED` frames of it."""
    factor = max(1, -(-max(frames.width, frames.height) // LONGEST_SIDE_PX))
    height, width = frames.height // factor, frames.width // factor
    chosen = np.linspace(0, len(frames) - 1, min(SEARCHED, len(frames))).astype(int)
    images = _shrunk(frames, chosen, factor, slice(0, height), slice(0, width), progress)
    return Coarse(images, camera.scaled(width, height, 1 / factor, 1 / factor), factor)


def _shrunk(
    frames: Frames,
    chosen: NDArray[np.intp],
    factor: int,
    rows: slice,
    columns: slice,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float32]:
    """Return a window, in coarse pixels, of some frames."""
    window = tuple(slice(side.start * factor, side.stop * factor) for side in (rows, columns))
    ambient = None if frames.ambient is None else _small(frames.ambient[window], factor)
    images = np.empty((len(chosen), rows.stop - rows.start, columns.stop - columns.start), np.float32)

    def read(place: int) -> None:
        index = chosen[place]
        small = _small(frames.codes[index][window], factor) * np.float32(frames.gain[index])
        images[place] = small if ambient is None else small - ambient

    with ThreadPoolExecutor(READERS) as threads:
        for done, _ in enumerate(threads.map(read, range(len(chosen)))):
            if progress:
                progress(done + 1, len(chosen))
    return images


def _small(codes: NDArray, factor: int) -> NDArray[np.float32]:
    """Average codes before they are decoded: decoding is linear, and a frame of floats is four times larger."""
    height, width = codes.shape[0] // factor, codes.shape[1] // factor
    out = np.empty((height, width), np.float32)
    step = max(1, (32 << 20) // (codes.shape[1] * 12 * factor))
    for row in range(0, height, step):
        band = np.asarray(codes[row * factor : min(row + step, height) * factor, : width * factor])
        if band.dtype == np.float16:
            band = band.astype(np.float32)
        if factor > 1:
            band = cv2.resize(band, (width, band.shape[0] // factor), interpolation=cv2.INTER_AREA)
        out[row : row + step] = cv2.transform(decode(band), np.full((1, 3), 1 / 3, np.float32))
    return out

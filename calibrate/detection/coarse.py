"""The whole stack at a size at which searching is cheap: 24 megapixels cost little more than two."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames, gray, shrunk
from scene.spheres import Sphere

LONGEST_SIDE_PX = 1200
"""Balls are looked for from a radius of 6 coarse pixels on, and found reliably from 15: 0.5 and 1.25 % of the longer
side, in 24 megapixels (6000 px) 30 and 75 px. A smaller one needs `center_px` and `radius_px`."""
READERS = 2  # threads that shrink frames: OpenCV and the page cache work beside Python
SEARCHED = 20  # frames in which balls are looked for: more of them show no other edges

Progress = Callable[[int, int], None]


class Box(NamedTuple):
    """Rows and columns around a ball, cut at the picture's border."""

    rows: slice
    columns: slice

    @property
    def grid(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns (h, w) of its pixels."""
        rows, columns = np.mgrid[self.rows, self.columns]
        return rows, columns


@dataclass(frozen=True)
class Coarse:
    """The stack shrunk by averaging `factor` x `factor` pixels."""

    images: NDArray[np.float32]  # (F, h, w) linear, mean of the channels, ambient subtracted; some of the frames
    camera: Camera  # of the shrunken images
    factor: int

    def box(self, sphere: Sphere, reach: float = 1.0, step: int = 1) -> Box:
        """Return the box of a ball in coarse pixels, `reach` radii to each side."""
        (u, v), r = sphere.center_px, reach * sphere.radius_px
        height, width = self.images.shape[1:]
        return Box(
            slice(max(int(v - r), 0), min(int(v + r) + 2, height), step),
            slice(max(int(u - r), 0), min(int(u + r) + 2, width), step),
        )

    @property
    def search_px(self) -> float:
        """How far, in full-size pixels, an outline may lie from a circle of the shrunken images."""
        return 1.4 * self.factor + 0.6

    def crop(self, box: Box) -> "Coarse":
        """Return a part of the pictures and the camera that took it."""
        images = self.images[:, *box]
        height, width = images.shape[1:]
        camera, (top, left) = self.camera, (side.start for side in box)
        camera = replace(camera, width=width, height=height, cx=camera.cx - left, cy=camera.cy - top)
        return replace(self, images=images, camera=camera)

    def halved(self) -> "Coarse":
        """Return the stack at half the size."""
        height, width = (side // 2 for side in self.images.shape[1:])
        even = self.images[:, : 2 * height, : 2 * width]
        images = np.stack([cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA) for image in even])
        return Coarse(images, self.camera.scaled(width, height, 0.5, 0.5), 2 * self.factor)

    def window(self, frames: Frames, box: Box) -> NDArray[np.float32]:
        """Return (F, rows, columns): a window of all frames, shrunk alike."""
        return _shrunk(frames, np.arange(len(frames)), self.factor, box)

    def to_full(self, pixels: NDArray) -> NDArray[np.float64]:
        """Return full-size pixels of coarse pixels (..., 2): pixel centres are integers at both sizes."""
        return (np.asarray(pixels, np.float64) + 0.5) * self.factor - 0.5

    def sphere_to_full(self, sphere: Sphere) -> Sphere:
        """Return a ball of the shrunken images as the full-size camera sees it."""
        return replace(
            sphere, center_px=self.to_full(sphere.center_px), radius_px=float(sphere.radius_px * self.factor)
        )

    def to_coarse(self, pixels: NDArray) -> NDArray[np.float64]:
        """Return the coarse pixels of full-size pixels (..., 2)."""
        return (np.asarray(pixels, np.float64) + 0.5) / self.factor - 0.5

    def from_full(self, sphere: Sphere) -> Sphere:
        """Return the ball as `camera` sees it."""
        return replace(sphere, center_px=self.to_coarse(sphere.center_px), radius_px=sphere.radius_px / self.factor)


def shrink(frames: Frames, camera: Camera, *, progress: Progress | None = None) -> Coarse:
    """Return the stack shrunk so that its longer side is at most `LONGEST_SIDE_PX`, and `SEARCHED` frames of it."""
    factor = max(1, -(-max(frames.width, frames.height) // LONGEST_SIDE_PX))
    height, width = frames.height // factor, frames.width // factor
    chosen = np.linspace(0, len(frames) - 1, min(SEARCHED, len(frames))).astype(int)
    images = _shrunk(frames, chosen, factor, Box(slice(0, height), slice(0, width)), progress)
    return Coarse(images, camera.scaled(width, height, 1 / factor, 1 / factor), factor)


def _shrunk(
    frames: Frames, chosen: NDArray[np.intp], factor: int, box: Box, progress: Progress | None = None
) -> NDArray[np.float32]:
    """Return a window, in coarse pixels, of some frames."""
    window = tuple(slice(side.start * factor, side.stop * factor) for side in box)
    ambient = 0.0 if frames.ambient is None else gray(shrunk(frames.ambient[window], factor))
    images = np.empty((len(chosen), *(side.stop - side.start for side in box)), np.float32)

    def read(place: int) -> None:
        index = chosen[place]
        images[place] = gray(shrunk(frames.codes[index][window], factor)) * np.float32(frames.gain[index]) - ambient

    with ThreadPoolExecutor(READERS) as threads:
        for done, _ in enumerate(threads.map(read, range(len(chosen)))):
            if progress:
                progress(done + 1, len(chosen))
    return images

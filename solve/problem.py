"""What a method is given."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights

UNKNOWN_MM = -1000.0
"""Where an object of unknown distance is put."""


@dataclass(frozen=True)
class Problem:
    """What a method is given, and what it has found out before it fits normals.

    Parameters
    ----------
    frames : Frames
    lights : Lights
    camera : Camera
    mask : (h, W) bool
        The object's pixels.
    rows : slice
        The rows of the frames that `mask` and `z_mm` cover.
    z_mm : (h, W) float64 or None
        Each pixel's depth. None: near lights are evaluated at the depth of `lights.reference_point_mm`.
    own_lights : Lights or None
        The lights that the method itself has found, once it has; `lights` are then the same.
    intensity_covariance : (F, F) float64 or None
        Of the relative errors of `lights`' intensities, where the method has found these.
    cautions : tuple of str
        Why the result should not be believed.
    """

    frames: Frames
    lights: Lights
    camera: Camera
    mask: NDArray[np.bool_]
    rows: slice
    z_mm: NDArray[np.float64] | None = None
    own_lights: Lights | None = None
    intensity_covariance: NDArray[np.float64] | None = None
    cautions: tuple[str, ...] = ()

    @classmethod
    def of(cls, frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_]) -> "Problem":
        """Return the problem of whole frames."""
        return cls(frames, lights, camera, mask, slice(0, len(mask)))

    def part(self, rows: slice) -> "Problem":
        """Return some rows of a problem that covers the whole frames."""
        return replace(self, mask=self.mask[rows], rows=rows, z_mm=None if self.z_mm is None else self.z_mm[rows])

    def pixels(self) -> NDArray[np.int64]:
        """Return the mask's pixels (P, 2), as (u, v)."""
        row, column = np.nonzero(self.mask)
        return np.stack([column, row + self.rows.start], -1)

    def views(self) -> NDArray[np.float64]:
        """Return the unit vectors (P, 3) from the mask's pixels to the camera."""
        return -self.camera.rays(self.pixels())[1]

    def points(self) -> NDArray[np.float64]:
        """Return where the mask's pixels are (P, 3), mm; zeros under distant lights without a depth: nobody looks."""
        if self.z_mm is not None:
            return self.camera.points_at_depth(self.pixels(), self.z_mm[self.mask][:, None])
        if self.lights.positions_mm is None:
            return np.zeros((np.count_nonzero(self.mask), 3))
        return self.camera.points_at_depth(self.pixels(), self.lights.reference_point_mm[2])

    def depth_mm(self) -> float:
        """Return z of the object, mm: its median, that of the lights' reference point, or where nothing tells it."""
        if self.z_mm is not None:
            return float(np.nanmedian(self.z_mm[self.mask]))
        where = float(self.lights.reference_point_mm[2])
        return where if self.camera.is_orthographic or where < 0 else UNKNOWN_MM

    def thinned(self, pixels: float) -> "Problem":
        """Return every n-th pixel of a whole problem, about so many of its mask: pixel u becomes u / n."""
        step = self.step_to(pixels)
        mask = np.ascontiguousarray(self.mask[::step, ::step])
        depth = None if self.z_mm is None else np.ascontiguousarray(self.z_mm[::step, ::step])
        frames, camera = self.frames.every(step), self.camera.every(step)
        return replace(self, frames=frames, camera=camera, mask=mask, rows=slice(0, len(mask)), z_mm=depth)

    def step_to(self, pixels: float) -> int:
        """Return n such that every n-th pixel leaves about so many of the mask."""
        return max(1, round(np.sqrt(np.count_nonzero(self.mask) / pixels)))

    def under(self, lights: Lights) -> "Problem":
        """Return the problem under the lights that the method has found."""
        return replace(self, lights=lights, own_lights=lights)

    def warned(self, *cautions: str) -> "Problem":
        """Return the problem with more cautions."""
        return replace(self, cautions=(*self.cautions, *cautions))


def spread_over(known: NDArray[np.bool_], most: int) -> NDArray[np.bool_]:
    """Return at most so many of the pixels that are known, evenly spread: an array of their shape."""
    places, some = np.flatnonzero(known), np.zeros(known.shape, bool)
    some.flat[places[np.linspace(0, len(places) - 1, min(most, len(places))).astype(int)]] = True
    return some

"""The photograph as a plane in the browser's view: where its pixels stand, and which pixel a ray meets."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
ROOT = "/photograph"
WIDE = 8.0
"""Width of the photograph in the view's units."""
UPRIGHT = (0.0, 1.0, 0.0, 0.0)
"""viser's pictures have OpenCV's axes: turned half around x they stand upright before the viewer."""


@dataclass(frozen=True)
class Plane:
    """A picture that stands upright in the plane z = 0, its middle at x = 0, y = 0.

    width, height: Pixels of the photograph.
    """

    width: int
    height: int

    @property
    def per_px(self) -> float:
        """Units of the view that a pixel is wide."""
        return WIDE / self.width

    @property
    def high(self) -> float:
        """Height in the view's units."""
        return self.height * self.per_px

    def place(self, pixels: ArrayLike, *, lift: float = 0.0) -> Array:
        """Return (..., 3), where pixels (..., 2) stand, `lift` in front of the picture.

        A thousandth of a unit lifts a line clear of the picture in a depth of 24 bits; seen from a ball's radius or
        two away, a thirtieth would already draw its outline too large by a pixel.
        """
        pixels = np.asarray(pixels, np.float64)
        xy = (pixels - [(self.width - 1) / 2, (self.height - 1) / 2]) * [self.per_px, -self.per_px]
        return np.concatenate([xy, np.full((*xy.shape[:-1], 1), lift)], -1)

    def pixel(self, origin: ArrayLike, direction: ArrayLike) -> tuple[float, float] | None:
        """Return the pixel (u, v) that a ray meets; None where it runs beside the picture, or away from it."""
        origin, direction = np.asarray(origin, np.float64), np.asarray(direction, np.float64)
        if abs(direction[2]) < 1e-12 or -origin[2] / direction[2] <= 0:
            return None
        x, y, _ = origin - origin[2] / direction[2] * direction
        u, v = x / self.per_px + (self.width - 1) / 2, -y / self.per_px + (self.height - 1) / 2
        inside = -0.5 <= u <= self.width - 0.5 and -0.5 <= v <= self.height - 0.5
        return (float(u), float(v)) if inside else None


def segments(points: Array) -> Array:
    """Return (K, 2, 3), the strokes of a closed line through points (K, 3)."""
    return np.stack([points, np.roll(points, -1, 0)], 1)


def cross(at: Array, arm: float) -> Array:
    """Return (2, 2, 3), the strokes of a cross at a place (3,)."""
    return np.array([[at - [arm, 0, 0], at + [arm, 0, 0]], [at - [0, arm, 0], at + [0, arm, 0]]])


def add_picture(view: Any, name: str, image: NDArray[np.uint8], wide: float, high: float, middle: Any) -> Any:
    """Add a picture (h, w, 3) beside the photograph or on it, `wide` x `high` units about `middle`; return it."""
    place = tuple(float(value) for value in middle)
    look = {"format": "jpeg", "jpeg_quality": 92, "cast_shadow": False, "receive_shadow": False}
    return view.add_image(f"{ROOT}/{name}", image, wide, high, wxyz=UPRIGHT, position=place, **look)


def add_lines(view: Any, name: str, strokes: Array, colour: tuple[int, int, int], width_px: float) -> Any:
    """Add strokes (K, 2, 3) of one colour; return their handle."""
    return view.add_line_segments(
        f"{ROOT}/{name}",
        strokes.astype(np.float32),
        np.array(colour, np.uint8),
        thickness=width_px,
        thickness_units="screen",
    )

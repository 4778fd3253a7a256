"""The photograph as a plane in the browser's view: where its pixels stand, and which pixel a ray meets."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studio.widgets import NO_SHADOW

Array = NDArray[np.float64]
ROOT = "/photograph"
WIDE = 8.0
"""Width of the photograph in the view's units."""
UPRIGHT = (0.0, 1.0, 0.0, 0.0)
"""viser's pictures have OpenCV's axes: turned half around x they stand upright before the viewer."""


@dataclass(frozen=True)
class Plane:
    """A picture of so many pixels that stands upright in the plane z = 0, its middle at x = 0, y = 0."""

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
        met = met_in_plane(origin, direction)
        if met is None:
            return None
        u, v = met / [self.per_px, -self.per_px] + [(self.width - 1) / 2, (self.height - 1) / 2]
        inside = -0.5 <= u <= self.width - 0.5 and -0.5 <= v <= self.height - 0.5
        return (float(u), float(v)) if inside else None


def met_in_plane(origin: ArrayLike, direction: ArrayLike) -> Array | None:
    """Return (x, y), where a ray meets the plane z = 0; None where it runs along or away from it."""
    origin, direction = np.asarray(origin, np.float64), np.asarray(direction, np.float64)
    if abs(direction[2]) < 1e-12 or -origin[2] / direction[2] <= 0:
        return None
    return (origin - origin[2] / direction[2] * direction)[:2]


def add_picture(
    window: Any, name: str, image: NDArray[np.uint8], size: tuple[float, float], middle: ArrayLike,
    use: Callable[[float, float], Any] | None = None,
) -> Any:  # fmt: skip
    """Add a picture (h, w, 3), wide and high in the view's units, that stands upright before the viewer; return it.

    use: Called with where it is clicked, in shares of its width, to the right, and of its height, downward.
    """
    place = np.asarray(middle, float)
    look = {"wxyz": UPRIGHT, "position": tuple(place.tolist()), **NO_SHADOW}
    handle = window.client.scene.add_image(name, image, *size, format="jpeg", jpeg_quality=92, **look)

    def clicked(origin: Array, direction: Array) -> None:
        met = met_in_plane(origin, direction)
        if use is not None and met is not None:
            across, down = (met - place[:2]) / [size[0], -size[1]] + 0.5
            use(float(across), float(down))

    if use is not None:
        window.on_ray(handle, clicked)
    return handle


def add_lines(view: Any, name: str, strokes: Array, colour: tuple[int, int, int], width_px: float) -> list[Any]:
    """Add strokes (K, 2, 3) of one colour, if there are any; return their handle."""
    look = {"colors": np.array(colour, np.uint8), "thickness": width_px, "thickness_units": "screen"}
    return [view.add_line_segments(f"{ROOT}/{name}", strokes.astype(np.float32), **look)] if len(strokes) else []


def add_numbered(view: Any, root: str, places: list[tuple[float, ...]], radius: float, colour: Any) -> list[Any]:
    """Add numbered balls at places of the view; return their handles."""
    handles = []
    for index, place in enumerate(places):
        name = f"{root}_{index}", f"{root}_number_{index}"
        handles.append(view.add_icosphere(name[0], radius=radius, color=colour, position=place))
        handles.append(view.add_label(name[1], str(index + 1), position=place))
    return handles

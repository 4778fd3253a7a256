"""The part of a picture that is shown, alike on both sides: which pixel stands where, and which one was clicked."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Box

ZOOMS = (1, 2, 4, 8, 16, 32, 64)


@dataclass(frozen=True)
class Viewport:
    """A rectangle of a picture, whose pixel (u, v) covers u..u + 1 across and v..v + 1 down.

    left, top, width, height: Pixels, from the picture's upper left corner.
    """

    left: float
    top: float
    width: float
    height: float

    @classmethod
    def of(cls, box: Box, zoom: float, centre: tuple[float, float], size: tuple[int, int]) -> "Viewport":
        """Return the part of a box's shape that is `zoom` times smaller, about a pixel, moved into the picture.

        box: What zoom 1 shows. centre (u, v): A pixel's centre. size (width, height): Of the picture, px.
        """
        width, height = box.width / zoom, box.height / zoom
        left = np.clip(centre[0] + 0.5 - width / 2, 0, size[0] - width)
        top = np.clip(centre[1] + 0.5 - height / 2, 0, size[1] - height)
        return cls(float(left), float(top), width, height)

    @property
    def centre(self) -> tuple[float, float]:
        """The pixel (u, v) in the middle."""
        return self.left + self.width / 2 - 0.5, self.top + self.height / 2 - 0.5

    def columns(self, count: int) -> NDArray[np.int64]:
        """Return the column under each of `count` points across: one pixel each, none is averaged."""
        return _under(self.left, self.width, count)

    def rows(self, count: int) -> NDArray[np.int64]:
        """Return the row under each of `count` points down."""
        return _under(self.top, self.height, count)

    def share(self, u: float, v: float) -> tuple[float, float]:
        """Return where a pixel's centre stands, in shares of the viewport's width and height."""
        return (u + 0.5 - self.left) / self.width, (v + 0.5 - self.top) / self.height


def _under(start: float, length: float, count: int) -> NDArray[np.int64]:
    return np.floor(start + (np.arange(count) + 0.5) * length / count).astype(np.int64)


@dataclass(frozen=True)
class Layout:
    """Two pictures of one size side by side, a line of words above them and a key below.

    wide, high: Of each picture, points of the screen picture.
    """

    wide: int
    high: int
    gap: int = 16
    above: int = 34
    below: int = 96

    @classmethod
    def of(cls, box: Box, *, largest: int = 640) -> "Layout":
        """Return the layout that shows a box with sides of at most `largest` points."""
        scale = largest / max(box.width, box.height)
        return cls(max(96, round(box.width * scale)), max(96, round(box.height * scale)))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the whole."""
        return 2 * self.wide + self.gap, self.above + self.high + self.below

    def corner(self, side: int) -> tuple[int, int]:
        """Return the upper left corner of the picture on side 0 or 1."""
        return side * (self.wide + self.gap), self.above

    def pixel(self, viewport: Viewport, across: float, down: float) -> tuple[int, int] | None:
        """Return the pixel (u, v) at a place, in shares of the whole; None beside the pictures.

        It is the pixel that is drawn there.
        """
        x, y = int(np.floor(across * self.size[0])), int(np.floor(down * self.size[1]))
        for side in (0, 1):
            left, top = self.corner(side)
            if 0 <= x - left < self.wide and 0 <= y - top < self.high:
                return int(viewport.columns(self.wide)[x - left]), int(viewport.rows(self.high)[y - top])
        return None

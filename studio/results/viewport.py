"""The part of a picture that is shown, alike on both sides: which pixel stands where, and which one was clicked."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Box

ZOOMS = (1, 2, 4, 8, 16, 32, 64)
LARGEST = 640
"""Points of the longer side."""


@dataclass(frozen=True)
class Viewport:
    """A rectangle of a picture, whose pixel (u, v) covers u..u + 1 across and v..v + 1 down.

    left, top, width, height: Pixels, from the picture's upper left corner.
    wide, high: Points that it is drawn with.
    """

    left: float
    top: float
    width: float
    height: float
    wide: int
    high: int

    @classmethod
    def of(cls, box: Box, zoom: float, centre: tuple[float, float], size: tuple[int, int]) -> "Viewport":
        """Return the part of a box's shape that is `zoom` times smaller, about a pixel, moved into the picture.

        box: What zoom 1 shows. centre (u, v): A pixel's centre. size (width, height): Of the picture, px.
        """
        width, height = box.width / zoom, box.height / zoom
        left = np.clip(centre[0] + 0.5 - width / 2, 0, size[0] - width)
        top = np.clip(centre[1] + 0.5 - height / 2, 0, size[1] - height)
        wide, high = (max(96, round(side * LARGEST / max(box.width, box.height))) for side in (box.width, box.height))
        return cls(float(left), float(top), width, height, wide, high)

    @property
    def centre(self) -> tuple[float, float]:
        """The pixel (u, v) in the middle."""
        return self.left + self.width / 2 - 0.5, self.top + self.height / 2 - 0.5

    @property
    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Column under each point across, and row under each point down: one pixel each, none is averaged."""
        across, down = ((np.arange(count) + 0.5) / count for count in (self.wide, self.high))
        places = self.left + across * self.width, self.top + down * self.height
        return np.floor(places[0]).astype(np.int64), np.floor(places[1]).astype(np.int64)

    def share(self, u: float, v: float) -> tuple[float, float]:
        """Return where a pixel's centre stands, in shares of the viewport's width and height."""
        return (u + 0.5 - self.left) / self.width, (v + 0.5 - self.top) / self.height

    def pixel(self, across: float, down: float) -> tuple[int, int] | None:
        """Return the pixel (u, v) that is drawn at a place, in shares of width and height; None beside the picture."""
        if not (0 <= across < 1 and 0 <= down < 1):
            return None
        columns, rows = self.pixels
        return int(columns[int(across * self.wide)]), int(rows[int(down * self.high)])

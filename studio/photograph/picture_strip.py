"""Photographs as a strip of small pictures below the large one, and which of them a place on it is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from compare.report.pictures import Image
from studio.browser_window import BrowserWindow
from studio.photograph.plane import ROOT, WIDE, Plane, add_picture

CELL_PX = 200
"""Width of a small picture."""
GAP_PX = 6
LABEL_PX = 24
PAPER, INK = (38, 38, 40), (225, 225, 225)
CHOSEN = (60, 170, 255)
GAP = 0.25
"""Between the photograph, the strip and what stands beside, in the view's units."""
Label = tuple[str, tuple[int, int, int]]
"""Its words and their colour."""


@dataclass(frozen=True)
class PictureStrip:
    """Small pictures in rows.

    cells (R, C, h, w, 3): Of each, what a picture takes with its label and gap; `count` of them have one.
    """

    cells: Image
    count: int

    @classmethod
    def of(cls, pictures: Sequence[Image], labels: Sequence[Label]) -> "PictureStrip":
        """Return the strip of pictures (h, w, 3), each as high as the first is when it is shown."""
        import cv2

        count, (high, wide, _) = len(pictures), pictures[0].shape
        height = max(1, round(CELL_PX * high / wide))
        columns = max(1, min(count, max(6, int(np.ceil(np.sqrt(3 * count))))))
        rows, gap = -(-count // columns), GAP_PX // 2
        cells = np.full((rows, columns, height + LABEL_PX + GAP_PX, CELL_PX + GAP_PX, 3), PAPER, np.uint8)
        for index, (picture, (text, colour)) in enumerate(zip(pictures, labels, strict=True)):
            cell = cells[divmod(index, columns)]
            small = cv2.resize(picture, (CELL_PX, height), interpolation=cv2.INTER_AREA)
            cell[gap : gap + height, gap : gap + CELL_PX] = small
            place = (gap + 2, gap + height + LABEL_PX - 8)
            cv2.putText(cell, text[:24], place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)
        return cls(cells, count)

    @property
    def image(self) -> Image:
        """(R h, C w, 3)."""
        rows, columns, high, wide, _ = self.cells.shape
        return self.cells.swapaxes(1, 2).reshape(rows * high, columns * wide, 3)

    @property
    def high(self) -> float:
        """Height in the view's units, where it is as wide as the photograph."""
        return WIDE * self.image.shape[0] / self.image.shape[1]

    def frame_at(self, across: float, down: float) -> int | None:
        """Return the picture at a place, in shares of the strip's width and height; None beside the pictures."""
        rows, columns = self.cells.shape[:2]
        index = int(down * rows) * columns + int(across * columns)
        return index if 0 <= across < 1 and 0 <= down < 1 and index < self.count else None

    def with_chosen(self, index: int | None) -> Image:
        """Return the strip with one picture framed."""
        import cv2

        if index is None:
            return self.image
        cells, gap = self.cells.copy(), GAP_PX // 2
        high, wide = cells.shape[2:4]
        cv2.rectangle(cells[divmod(index, cells.shape[1])], (gap - 1, gap - 1), (wide - gap, high - gap), CHOSEN, 3)
        return PictureStrip(cells, self.count).image

    def add_to(self, window: BrowserWindow, plane: Plane, chosen: int | None, use: Callable[[int], Any]) -> list[Any]:
        """Show it below the photograph; `use` is called with the picture that is clicked. Return the handles."""

        def clicked(across: float, down: float) -> None:
            index = self.frame_at(across, down)
            if index is not None:
                use(index)

        middle = (0.0, -plane.high / 2 - GAP - self.high / 2, 0.0)
        return [add_picture(window, f"{ROOT}/strip", self.with_chosen(chosen), (WIDE, self.high), middle, clicked)]


def look_at_photograph(window: Any, plane: Plane, strip: PictureStrip | None, *, aside: float = 0.0) -> None:
    """Look straight at the photograph with its strip, or at the ball that is chosen.

    window: A `PhotographWindow`. aside: Width of what stands beside the photograph.
    """
    if window.ball is not None:
        ball = window.outlines[window.ball]
        size = 3.2 * ball.radius_px * plane.per_px
        window.look_straight(plane.place(ball.center_px), size, size)
        return
    below = 0.0 if strip is None else GAP + strip.high
    window.look_straight([aside / 2, -below / 2, 0.0], WIDE + aside, plane.high + below)

"""Photographs as a strip of small pictures with their names, and which of them a place on it is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scene.map_pictures import Image

CELL_PX = 200
"""Width of a small picture."""
GAP_PX = 6
LABEL_PX = 24
PAPER, INK = (38, 38, 40), (225, 225, 225)
CHOSEN = (60, 170, 255)
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

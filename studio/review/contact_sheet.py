"""The frames as a strip of small pictures, and which of them a place on it is."""

from dataclasses import dataclass

import numpy as np

from compare.report.pictures import Image, thumbnail
from studio.review.folder import Review

CELL_PX = 200
"""Width of a small picture."""
GAP_PX = 6
LABEL_PX = 24
MUCH_CLIPPED = 0.002
"""Share of a frame's pixels; a chrome ball's highlight is far less."""
PAPER, INK = (38, 38, 40), (225, 225, 225)
CLIPPED, WARNED, CHOSEN = (255, 60, 90), (255, 160, 0), (60, 170, 255)


@dataclass(frozen=True)
class ContactSheet:
    """Small pictures in rows.

    cells (R, C, h, w, 3): Of each, what a picture takes with its label and gap; `count` of them have one.
    """

    cells: Image
    count: int

    @property
    def image(self) -> Image:
        """(R h, C w, 3)."""
        rows, columns, high, wide, _ = self.cells.shape
        return self.cells.swapaxes(1, 2).reshape(rows * high, columns * wide, 3)

    def frame_at(self, across: float, down: float) -> int | None:
        """Return the frame at a place, in shares of the sheet's width and height; None beside the pictures."""
        rows, columns = self.cells.shape[:2]
        index = int(down * rows) * columns + int(across * columns)
        return index if 0 <= across < 1 and 0 <= down < 1 and index < self.count else None

    def with_chosen(self, index: int) -> Image:
        """Return the sheet with one picture framed."""
        import cv2

        cells, gap = self.cells.copy(), GAP_PX // 2
        high, wide = cells.shape[2:4]
        cv2.rectangle(cells[divmod(index, cells.shape[1])], (gap - 1, gap - 1), (wide - gap, high - gap), CHOSEN, 3)
        return ContactSheet(cells, self.count).image


def contact_sheet(review: Review) -> ContactSheet | None:
    """Return all frames small, one tone curve for all, each with number, name and what is clipped; None without any."""
    import cv2

    frames, exposure = review.material.frames, review.material.exposure
    if frames is None or exposure is None or not len(frames):
        return None
    warned = {frame for one in review.warnings for frame in one.frames}
    if review.lights is not None:
        warned |= {index for index, flags in enumerate(review.lights.flags) if flags}
    count, height = len(frames), max(1, round(CELL_PX * frames.height / frames.width))
    columns = max(1, min(count, max(6, int(np.ceil(np.sqrt(3 * count))))))
    rows, gap = -(-count // columns), GAP_PX // 2
    cells = np.full((rows, columns, height + LABEL_PX + GAP_PX, CELL_PX + GAP_PX, 3), PAPER, np.uint8)
    for index in range(count):
        cell = cells[divmod(index, columns)]
        picture = exposure.develop(thumbnail(frames, index, CELL_PX))
        small = cv2.resize(picture, (CELL_PX, height), interpolation=cv2.INTER_AREA)
        cell[gap : gap + height, gap : gap + CELL_PX] = small
        label, colour = f"{index + 1} {frames.names[index]}", INK
        share = None if review.clipped_share is None else review.clipped_share[index]
        if share is not None and share >= MUCH_CLIPPED:
            label, colour = f"{index + 1}  clipped {share:.1%}", CLIPPED
        elif index in warned:
            label, colour = f"{label}  (!)", WARNED
        place = (gap + 2, gap + height + LABEL_PX - 8)
        cv2.putText(cell, label[:24], place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)
    return ContactSheet(cells, count)

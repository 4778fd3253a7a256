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

    image (h, w, 3).
    cell: Width and height of what a picture takes with its label and gap.
    """

    image: Image
    columns: int
    count: int
    cell: tuple[int, int]

    def frame_at(self, across: float, down: float) -> int | None:
        """Return the frame at a place, in shares of the sheet's width and height; None beside the pictures."""
        column = int(across * self.image.shape[1] // self.cell[0])
        row = int(down * self.image.shape[0] // self.cell[1])
        index = row * self.columns + column
        inside = 0 <= column < self.columns and row >= 0 and across >= 0 and down >= 0
        return index if inside and index < self.count else None

    def with_chosen(self, index: int) -> Image:
        """Return the sheet with one picture framed."""
        import cv2

        left, top = _corner(index, self.columns, self.cell)
        size = (left + self.cell[0] - GAP_PX // 2, top + self.cell[1] - GAP_PX // 2)
        framed = cv2.rectangle(self.image.copy(), (left + GAP_PX // 2 - 1, top + GAP_PX // 2 - 1), size, CHOSEN, 3)
        return np.asarray(framed, np.uint8)


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
    cell = (CELL_PX + GAP_PX, height + LABEL_PX + GAP_PX)
    rows = -(-count // columns)
    sheet = np.full((rows * cell[1], columns * cell[0], 3), PAPER, np.uint8)
    for index in range(count):
        left, top = _corner(index, columns, cell)
        left, top = left + GAP_PX // 2, top + GAP_PX // 2
        picture = exposure.develop(thumbnail(frames, index, CELL_PX))
        small = cv2.resize(picture, (CELL_PX, height), interpolation=cv2.INTER_AREA)
        sheet[top : top + height, left : left + CELL_PX] = small
        label, colour = f"{index + 1} {frames.names[index]}", INK
        share = None if review.clipped_share is None else review.clipped_share[index]
        if share is not None and share >= MUCH_CLIPPED:
            label, colour = f"{index + 1}  clipped {share:.1%}", CLIPPED
        elif index in warned:
            label, colour = f"{label}  (!)", WARNED
        place = (left + 2, top + height + LABEL_PX - 8)
        sheet = cv2.putText(sheet, label[:24], place, cv2.FONT_HERSHEY_SIMPLEX, 0.45, colour, 1, cv2.LINE_AA)
    return ContactSheet(np.asarray(sheet, np.uint8), columns, count, cell)


def _corner(index: int, columns: int, cell: tuple[int, int]) -> tuple[int, int]:
    return (index % columns) * cell[0], (index // columns) * cell[1]

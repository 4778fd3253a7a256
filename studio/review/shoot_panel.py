"""A shoot under way, as `rgbn watch` tells of it: how many photographs there are, and the map of sigma turns green."""

import threading
from typing import Any

import numpy as np

from compare.report.facts import read_optional
from scene.image_files import read_pixels
from scene.output_folder import read_record
from scene.reading import reading
from shoot.watch.status import MAP, STATUS
from studio.review.review_window import ReviewWindow
from studio.widgets import plain

EVERY_S = 2.0
"""The status is looked at so often."""
SHOWN = 6
"""Warnings that are listed, the newest."""
OVER = (
    "**The shoot is over.** Its photographs are decoded; then the session is shown here. If it does not come: the "
    "terminal of `rgbn watch` says why."
)


class ShootPanel:
    """The state of a shoot, renewed while it goes on; not shown where there is none.

    Of a folder's first shoot nothing else can be shown: `is_alone`. When it is over and its photographs are decoded,
    the window turns to its session.
    """

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui, self._seen = window, window.client.gui, None
        status = read_optional(window.review.store, STATUS)
        self.is_alone = window.review.session is None and isinstance(status, dict) and status.get("is_over") is False
        self._folder = gui.add_folder("Shoot under way", visible=False)
        with self._folder:
            self._text = gui.add_markdown("")
            self._picture = gui.add_image(np.zeros((2, 2, 3), np.uint8), format="png", visible=False)
        threading.Thread(target=self._follow, daemon=True).start()

    def refresh(self) -> None:
        """Show the status where it has changed."""
        folder, status = self._window.folder, read_optional(self._window.review.store, STATUS)
        if status == self._seen or not isinstance(status, dict):
            return
        self._seen = status
        with reading(folder / STATUS, "is no state of a shoot", do="It is written anew by rgbn watch."):
            is_over = bool(status["is_over"])
            self._text.content = OVER if is_over else _text(status)
        self._folder.visible = self.is_alone or not is_over
        if (folder / MAP).is_file():
            self._picture.image, self._picture.visible = read_pixels(folder / MAP)[0], True

    def _follow(self) -> None:
        waiting = threading.Event()
        while not self._window.is_gone:
            waiting.wait(EVERY_S)
            self._window.post(self._look)

    def _look(self) -> None:
        self.refresh()
        record = read_record(self._window.folder) if self.is_alone else None
        if record is not None and "check" in record.done:
            self._window.turn()


def _text(status: dict[str, Any]) -> str:
    lines = [f"**{int(status['flash'])} flash frames**, {int(status['ambient'])} ambient"]
    if normals := status["normals"]:
        following = normals["next_flash"]
        lines += [
            f"- sigma of the normals {float(normals['sigma_deg_median']):.2g}° (median), "
            f"{float(normals['share_under_wanted']):.0%} of the object under {float(normals['wanted_deg']):g}° (green)",
            f"- next flash: {float(following['zenith_deg']):.0f}° from the axis, azimuth "
            f"{float(following['azimuth_deg']):.0f}° (0° right, 90° up): sigma to {float(following['sigma_deg']):.2g}°",
        ]
    lines += [f"- **{plain(str(text))}**" for text in reversed(list(status["warnings"])[-SHOWN:])]
    return "\n".join(lines)

"""A shoot under way, as `rgbn watch` tells of it: the dome fills up, the map of sigma turns green."""

import threading
from math import cos, radians, sin
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import read_optional
from scene.image_files import read_pixels
from scene.output_folder import read_record
from scene.reading import reading
from shoot.watch.status import MAP, STATUS
from studio.review.review_window import ReviewWindow
from studio.widgets import plain

EVERY_S = 2.0
"""The status is looked at so often."""
SIDE_PX = 300
SHOWN = 6
"""Warnings that are listed, the newest."""
GROUND, RIM, LIGHT, NEXT = (38, 38, 40), (120, 120, 125), (255, 210, 90), (90, 220, 255)


class ShootPanel:
    """The state of a shoot, renewed while it goes on; not shown where there is none.

    Of a folder's first shoot nothing else can be shown: `is_alone`. When it is over and its photographs are decoded,
    the window turns to its session.
    """

    def __init__(self, window: ReviewWindow) -> None:
        self._window, gui = window, window.client.gui
        status = read_optional(window.review.store, STATUS)
        self.is_alone = window.review.session is None and isinstance(status, dict) and status.get("is_over") is False
        self._folder = gui.add_folder("Shoot under way", visible=False)
        with self._folder:
            self._text = gui.add_markdown("")
            self._picture = gui.add_image(np.full((SIDE_PX, 2 * SIDE_PX, 3), GROUND, np.uint8), format="png")
        self._path, self._seen, self._was_over = window.folder / STATUS, _stamp(window.folder / STATUS), True
        threading.Thread(target=self._follow, daemon=True).start()

    def refresh(self) -> None:
        """Show the status as it is now."""
        is_there = self._path.is_file()
        status = self._window.review.store.read_json(STATUS) if is_there else {"is_over": True}
        with reading(self._path, "is no state of a shoot", do="It is written anew by rgbn watch."):
            is_over = bool(status["is_over"])
            self._folder.visible = self.is_alone or not is_over
            if not is_over:
                self._text.content = _text(status)
                self._picture.image = np.concatenate([dome(status), self._map()], 1)
        was_over, self._was_over = self._was_over, is_over
        if is_over and self.is_alone:
            self._text.content = (
                "**The shoot is over.** Its photographs are decoded; then the session is shown here. If it does not "
                "come: the terminal of `rgbn watch` says why."
            )
        elif is_over and not was_over:
            self._window.notify("The shoot is over", "Its photographs are decoded now; then read the folder again.")

    def _follow(self) -> None:
        waiting = threading.Event()
        while not self._window.is_gone:
            waiting.wait(EVERY_S)
            stamp = _stamp(self._path)
            if stamp != self._seen:
                self._seen = stamp
                self._window.post(self.refresh)
            elif self.is_alone:
                self._window.post(self._turn_to_session)

    def _turn_to_session(self) -> None:
        record = read_record(self._window.folder)
        if record is not None and "check" in record.done:
            self._window.turn()

    def _map(self) -> NDArray[np.uint8]:
        """Return the map of sigma, (SIDE_PX, SIDE_PX, 3)."""
        import cv2

        out = np.full((SIDE_PX, SIDE_PX, 3), GROUND, np.uint8)
        path = self._window.folder / MAP
        if path.is_file():
            picture, _ = read_pixels(path)
            scale = SIDE_PX / max(picture.shape[:2])
            size = [max(1, round(scale * side)) for side in picture.shape[1::-1]]
            small = cv2.resize(np.ascontiguousarray(picture), size, interpolation=cv2.INTER_NEAREST)
            out[: small.shape[0], : small.shape[1]] = small
        return out


def dome(status: dict[str, Any]) -> NDArray[np.uint8]:
    """Return the lights as the camera sees them, (SIDE_PX, SIDE_PX, 3): the axis in the middle, 90 degrees at the rim.

    Lights of which something is suspicious are rings; the next flash is a cross.
    """
    import cv2

    picture, middle, reach = np.full((SIDE_PX, SIDE_PX, 3), GROUND, np.uint8), SIDE_PX // 2, 0.46 * SIDE_PX
    for zenith in (30, 60, 90):
        cv2.circle(picture, (middle, middle), round(reach * zenith / 90), RIM, 1, cv2.LINE_AA)

    def place(zenith: float, azimuth: float) -> tuple[int, int]:
        along = reach * min(float(zenith), 90.0) / 90
        return round(middle + along * cos(radians(azimuth))), round(middle - along * sin(radians(azimuth)))

    for row in (status["lights"] or {"frames": []})["frames"]:
        if row["zenith_deg"] is not None:
            filled = 1 if row["flags"] else -1
            cv2.circle(picture, place(row["zenith_deg"], row["azimuth_deg"]), 5, LIGHT, filled, cv2.LINE_AA)
    if status["normals"]:
        following = status["normals"]["next_flash"]
        at = place(following["zenith_deg"], following["azimuth_deg"])
        cv2.drawMarker(picture, at, NEXT, cv2.MARKER_TILTED_CROSS, 14, 2, cv2.LINE_AA)
    return picture


def _text(status: dict[str, Any]) -> str:
    lines = [f"**{int(status['flash'])} flash frames**, {int(status['ambient'])} ambient"]
    normals = status["normals"]
    if normals:
        following = normals["next_flash"]
        lines += [
            f"- sigma of the normals {float(normals['sigma_deg_median']):.2g}° (median), "
            f"{float(normals['share_under_wanted']):.0%} of the object under {float(normals['wanted_deg']):g}° (green)",
            f"- next flash (cross): {float(following['zenith_deg']):.0f}° from the axis, azimuth "
            f"{float(following['azimuth_deg']):.0f}° (0° right, 90° up): sigma to {float(following['sigma_deg']):.2g}°",
        ]
    lines += [f"- **{plain(str(text))}**" for text in reversed(list(status["warnings"])[-SHOWN:])]
    return "\n".join(lines)


def _stamp(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0

"""What is shown while photographs are looked at: the first of them at once, and for how long it has gone on."""

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from capture.session.session_types import Encoding
from capture.survey.small_pictures import read_small
from compare.report.pictures import Exposure, Image
from scene.errors import SceneError
from scene.frames import decode
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import ROOT, WIDE, Plane, add_picture
from studio.widgets import Layers

EVERY_S = 1.0
"""So often the time is told."""


def first_look(path: Path, encoding: Encoding = "linear") -> Image | None:
    """Return a photograph small, as 8 bits (h, w, 3); None: it cannot be read."""
    with suppress(OSError, ValueError, SceneError):
        (small,), _ = read_small([path], encoding)
        linear = decode(small.codes)
        return Exposure.for_picture(linear).develop(linear)
    return None


class WaitingView:
    """The first photograph and the seconds so far, for as long as `is_waiting` says so.

    first: Returns the photograph that is shown.
    """

    def __init__(
        self, window: PhotographWindow, is_waiting: Callable[[], bool], first: Callable[[], Path | None]
    ) -> None:
        self._window, self._is_waiting, self._first, self._layers = window, is_waiting, first, Layers()
        self._text = window.client.gui.add_markdown("", visible=False)
        self._since_s = 0.0

    def refresh(self) -> None:
        """Follow the window."""
        is_waiting = self._is_waiting()
        if is_waiting and not self._text.visible:
            self._since_s = time.monotonic()
            threading.Thread(target=self._tick, daemon=True).start()
        self._text.visible = is_waiting
        if not is_waiting:
            self._layers.keep_only(set())
        elif (path := self._first()) is not None:
            self._layers.draw("first", path, lambda: self._add(path))

    def _add(self, path: Path) -> list[Any]:
        image = first_look(path)
        if image is None:
            return []
        plane = Plane(image.shape[1], image.shape[0])
        self._window.look_straight((0.0, 0.0, 0.0), WIDE, plane.high)
        return [add_picture(self._window, f"{ROOT}/first", image, (WIDE, plane.high), (0.0, 0.0, 0.0))]

    def _tick(self) -> None:
        waiting = threading.Event()
        while self._is_waiting() and not self._window.is_gone:
            self._text.content = f"{time.monotonic() - self._since_s:.0f} s so far"
            waiting.wait(EVERY_S)

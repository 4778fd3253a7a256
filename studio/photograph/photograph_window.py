"""One browser's window on a photograph with balls outlined on it."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from scene.camera import Camera
from studio.browser_window import BrowserWindow
from studio.desk import History
from studio.photograph.outlines import Outlines, under
from studio.photograph.plane import Plane


class PhotographWindow(BrowserWindow):
    """What a browser marks balls in. Its panels call `choose` and `correct`; then all panels are refreshed.

    What is corrected is a state, with a past, that lies on the desk; it has `outlines`.
    """

    def __init__(self, *place: Any) -> None:
        super().__init__(*place)
        self.reading = 0
        """How often what is shown was read again: whatever is drawn of it is older than that, or as old."""
        self.looks = 0
        """How often the whole was asked for again."""
        self.ball: int | None = None
        self.on_photograph: Callable[[tuple[float, float]], None] | None = None
        """Who wants the pixels that are clicked on the photograph."""

    @property
    def plane(self) -> Plane | None:
        """Where the photograph stands in the view; None without one."""
        raise NotImplementedError

    @property
    def camera(self) -> Camera | None:
        """By which the outlines are drawn; None where none is known."""
        raise NotImplementedError

    def keep(self, history: History[Any]) -> None:
        """Lay a state with its past on the desk."""
        raise NotImplementedError

    @property
    def outlines(self) -> Outlines:
        """The balls."""
        return self.history.state.outlines if self.history else ()

    def _refresh_panels(self) -> None:
        if self.ball is not None and self.ball >= len(self.outlines):
            self.ball = None
        super()._refresh_panels()

    def choose(self, **changes: Any) -> None:
        """Look at another `ball` or whatever else is kept here; what is not said stays."""
        assert vars(self).keys() >= changes.keys()
        vars(self).update(changes)
        self.refresh()

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph; None: at all of it."""
        self.choose(ball=ball)

    def alter(self, label: str, *, held_s: float | None = None, **changes: Any) -> None:
        """Correct something. held_s: When the hand took what it drags; all of a drag is undone together."""
        if self.history is not None:
            state, now_s = replace(self.history.state, **changes), time.monotonic() if held_s is None else held_s
            self.keep(self.history.did(label, state, now_s, self._input or held_s))
        self.refresh()

    def correct(self, outlines: Outlines, label: str = "correct a ball", held_s: float | None = None) -> None:
        """Take other balls; held_s: as of `alter`."""
        self.alter(label, held_s=held_s, outlines=outlines)

    def restore(self, history: History[Any]) -> None:
        """Take a state of the past or of the future."""
        self.keep(history)
        self.refresh()

    def click(self, pixel: tuple[float, float]) -> None:
        """Give a clicked pixel to who wants it; else choose the ball that it lies on."""
        if self.on_photograph is not None:
            self.on_photograph(pixel)
        elif (ball := under(self.outlines, pixel)) is not None:
            self.choose_ball(ball)

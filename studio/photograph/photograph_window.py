"""One browser's window on a photograph with balls outlined on it."""

from collections.abc import Callable
from typing import Any

from scene.camera import Camera
from studio.browser_window import BrowserWindow
from studio.editor.preview import Preview
from studio.photograph.outlines import Outlines, under
from studio.photograph.plane import Plane
from studio.workspace import Workspace


class PhotographWindow(BrowserWindow):
    """What a browser marks balls in. Its panels call `choose` and `correct`; then all panels are refreshed."""

    def __init__(self, client: Any, workspace: Workspace, preview: Preview) -> None:
        super().__init__(client, workspace, preview)
        self.reading = 0
        """How often what is shown was read again: whatever is drawn of it is older than that, or as old."""
        self.looks = 0
        """How often the whole was asked for again."""
        self.ball: int | None = None
        self.outlines: Outlines = ()
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

    def _refresh_panels(self) -> None:
        if self.ball is not None and self.ball >= len(self.outlines):
            self.ball = None
        for panel in self.panels:
            self.attempt(panel.refresh)

    def choose(self, **changes: Any) -> None:
        """Look at another `ball` or whatever else is kept here; what is not said stays."""
        assert vars(self).keys() >= changes.keys()
        vars(self).update(changes)
        self.refresh()

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph; None: at all of it."""
        self.choose(ball=ball)

    def correct(self, outlines: Outlines) -> None:
        """Take other balls."""
        self.choose(outlines=outlines)

    def click(self, pixel: tuple[float, float]) -> None:
        """Give a clicked pixel to who wants it; else choose the ball that it lies on."""
        if self.on_photograph is not None:
            self.on_photograph(pixel)
        elif (ball := under(self.outlines, pixel)) is not None:
            self.choose_ball(ball)

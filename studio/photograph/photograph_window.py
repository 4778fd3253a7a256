"""A window on a photograph with balls outlined on it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from capture.session.manifest import SphereTable
from compare.report.picture_strip import PictureStrip
from compare.report.pictures import Exposure
from scene.camera import Camera
from scene.frames import Frames
from scene.map_pictures import Image
from studio.photograph.outlines import Outlines, under
from studio.photograph.plane import Plane
from studio.studio_state import History
from studio.window import Window


@dataclass(frozen=True, eq=False)
class Beside:
    """A picture that stands beside the photograph: of the same view, with a caption."""

    image: Image
    caption: str


@dataclass(frozen=True)
class Shown:
    """What the view shows, by what makes it; each is made again where its key is another.

    plane, camera: Where the photograph stands, and by which the outlines are drawn; None: they are not known.
    picture, strip: Key and maker of the large photograph and of the small ones. chosen: Of the small ones.
    crop: Of which the chosen ball is shown enlarged, with the photograph's pixels in one of theirs; None: it is not.
    colours: Of the balls' outlines; None: one is not drawn.
    marks: What else stands on the photograph, by names: key, and what adds it and returns its handles.
    """

    plane: Plane
    camera: Camera | None
    picture: tuple[Any, Callable[[], Image]]
    strip: tuple[Any, Callable[[], PictureStrip | None]] = (None, lambda: None)
    chosen: int | None = None
    crop: tuple[Frames, Exposure, int] | None = None
    colours: tuple[tuple[int, int, int] | None, ...] = ()
    marks: dict[str, tuple[Any, Callable[[], list[Any]]]] = field(default_factory=dict)


class PhotographWindow(Window):
    """What a browser marks balls in. Its panels call `choose` and `correct`; then all panels are refreshed.

    What is corrected is a state with a past, which outlives the window; it has `outlines`.

    reading: How often what is shown was read again: whatever is drawn of it is older than that, or as old.
    looks: How often the whole was asked for again.
    on_photograph: Who wants the pixels that are clicked on the photograph.
    """

    is_flat = True

    def __init__(self, *place: Any) -> None:
        super().__init__(*place)
        self.reading, self.looks = 0, 0
        self.ball: int | None = None
        self.beside: Beside | None = None
        self.on_photograph: Callable[[tuple[float, float]], None] | None = None

    def shown(self) -> Shown | None:
        """Return what stands in the view."""
        raise NotImplementedError

    @property
    def plane(self) -> Plane | None:
        """Where the photograph stands in the view; None without one."""
        shown = self.shown()
        return shown and shown.plane

    def choose_small(self, index: int) -> None:
        """Look at the photograph whose small picture is clicked."""
        raise NotImplementedError

    def keep(self, history: History[Any]) -> None:
        """Keep a state with its past."""
        raise NotImplementedError

    def is_found(self, ball: SphereTable) -> bool:
        """Whether a ball is as it was found."""
        raise NotImplementedError

    def back_to_found(self) -> None:
        """Take the balls as they were found."""
        raise NotImplementedError

    @property
    def outlines(self) -> Outlines:
        """The balls that have circles."""
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

"""A window on a photograph with balls outlined on it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from capture.session.manifest import SphereTable
from compare.report.picture_strip import PictureStrip
from compare.report.pictures import Exposure
from scene.camera import Camera
from scene.frames import Frames
from scene.map_pictures import Image
from scene.spheres import Kind, Sphere
from studio.photograph.plane import Plane
from studio.studio_state import History
from studio.window import Window

SMALLEST_PX = 4.0
"""A ball of a smaller radius tells nothing."""
Outlines = tuple[SphereTable, ...]
"""Each has its circle."""


def outline(
    kind: Kind, center_px: tuple[float, float], radius_px: float, diameter_mm: float | None = None
) -> SphereTable:
    """Return a ball with its circle; a radius that is none is the smallest."""
    u, v = map(float, center_px)
    radius = max(float(radius_px), SMALLEST_PX)
    return SphereTable(kind=kind, center_px=[u, v], radius_px=radius, diameter_mm=diameter_mm)


def circle_of(ball: SphereTable) -> tuple[tuple[float, float], float]:
    """Return centre and radius, px, of a ball that has both."""
    assert ball.center_px and ball.radius_px  # noqa: PT018
    u, v = ball.center_px
    return (u, v), ball.radius_px


def sphere_of(ball: SphereTable) -> Sphere:
    """Return a ball as the fit's type, to be drawn."""
    center, radius = circle_of(ball)
    return Sphere(ball.kind, np.array(center), radius, ball.diameter_mm)


def changed(balls: Outlines, index: int, **keys: Any) -> Outlines:
    """Return the balls, one of them with other keys."""
    return (*balls[:index], balls[index].model_copy(update=keys), *balls[index + 1 :])


def moved(balls: Outlines, index: int, center_px: tuple[float, float], plane: Plane) -> Outlines:
    """Return the balls, one of them elsewhere, its centre inside the picture."""
    return changed(balls, index, center_px=_inside(center_px, plane))


def resized(balls: Outlines, index: int, radius_px: float, plane: Plane) -> Outlines:
    """Return the balls, one of them larger or smaller."""
    return changed(balls, index, radius_px=float(min(max(radius_px, SMALLEST_PX), max(plane.width, plane.height))))


def of_kind(balls: Outlines, index: int, kind: Kind, plane: Plane) -> Outlines:
    """Return the balls, one of them of this kind."""
    return changed(balls, index, kind=kind)


def added(balls: Outlines, kind: Kind, center_px: tuple[float, float], plane: Plane) -> Outlines:
    """Return the balls and one more, as large as most of them."""
    radii = [circle_of(ball)[1] for ball in balls]
    u, v = _inside(center_px, plane)
    return (*balls, outline(kind, (u, v), float(np.median(radii)) if radii else plane.width / 20))


def under(balls: Outlines, pixel: tuple[float, float]) -> int | None:
    """Return the ball that a pixel lies on; of several the one whose middle is nearest, in radii."""
    circles = map(circle_of, balls)
    away = [np.hypot(*np.subtract(center, pixel)) / radius for center, radius in circles]
    return int(np.argmin(away)) if away and min(away) < 1 else None


def _inside(center_px: tuple[float, float], plane: Plane) -> list[float]:
    return np.clip(np.asarray(center_px, float), 0.0, [plane.width - 1.0, plane.height - 1.0]).tolist()


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

    @property
    def plane(self) -> Plane | None:
        """Where the photograph stands in the view; None without one."""
        shown = self.shown()
        return shown and shown.plane

    def choose_small(self, index: int) -> None:
        """Look at the photograph whose small picture is clicked."""

    def keep(self, history: History[Any]) -> None:
        """Keep a state with its past."""

    def is_found(self, ball: SphereTable) -> bool:
        """Whether a ball is as it was found."""
        return True

    def back_to_found(self) -> None:
        """Take the balls as they were found."""

    @property
    def outlines(self) -> Outlines:
        """The balls that have circles."""
        return self.history.state.outlines if self.history else ()

    def _refresh_panels(self) -> None:
        if self.ball is not None and self.ball >= len(self.outlines):
            self.ball = None
        super()._refresh_panels()

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

"""A window on a photograph with balls outlined on it, each a table of session.toml with its circle."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from capture.session.manifest import SphereTable
from capture.session.manifest_file import table_of
from compare.report.picture_strip import PictureStrip
from compare.report.pictures import Exposure
from scene.camera import Camera
from scene.frames import Frames
from scene.map_pictures import Image
from scene.spheres import Kind
from studio.session.plane import Plane
from studio.window import Window

SMALLEST_PX = 4.0
"""A ball of a smaller radius tells nothing."""
Balls = tuple[SphereTable, ...]


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


def changed(balls: Balls, index: int, **keys: object) -> Balls:
    """Return the balls, one of them with other keys. Raises SessionError: a value that session.toml may not have."""
    data = balls[index].model_dump(exclude_none=True) | keys
    return (*balls[:index], table_of("spheres", data), *balls[index + 1 :])  # type: ignore[return-value]


def moved(balls: Balls, index: int, center_px: tuple[float, float], plane: Plane) -> Balls:
    """Return the balls, one of them elsewhere, its centre inside the picture."""
    return changed(balls, index, center_px=_inside(center_px, plane))


def resized(balls: Balls, index: int, radius_px: float, plane: Plane) -> Balls:
    """Return the balls, one of them larger or smaller."""
    return changed(balls, index, radius_px=float(min(max(radius_px, SMALLEST_PX), max(plane.width, plane.height))))


def added(balls: Balls, kind: Kind, center_px: tuple[float, float], plane: Plane) -> Balls:
    """Return the balls and one more, as large as most of them."""
    radii = [circle_of(ball)[1] for ball in balls]
    u, v = _inside(center_px, plane)
    return (*balls, outline(kind, (u, v), float(np.median(radii)) if radii else plane.width / 20))


def under(balls: Balls, pixel: tuple[float, float]) -> int | None:
    """Return the ball that a pixel lies on; of several the one whose middle is nearest, in radii."""
    circles = map(circle_of, balls)
    away = [np.hypot(*np.subtract(center, pixel)) / radius for center, radius in circles]
    return int(np.argmin(away)) if away and min(away) < 1 else None


def of_kind(balls: Balls, index: int, kind: Kind, plane: Plane) -> Balls:
    """Return the balls, one of them of this kind: of another one it was another size."""
    return balls if balls[index].kind == kind else changed(balls, index, kind=kind, diameter_mm=None)


def with_usual_diameters(balls: Balls, before: Sequence[SphereTable]) -> Balls:
    """Return the balls; one of unknown size is as large as all of its kind were before."""
    found = []
    for ball in balls:
        alike = {one.diameter_mm for one in before if one.kind == ball.kind}
        usual = alike.pop() if len(alike) == 1 else None
        found.append(ball.model_copy(update={"diameter_mm": ball.diameter_mm or usual}))
    return tuple(found)


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
    """What a browser marks balls in. Its panels call `choose`, `correct` and `alter`; then all are refreshed.

    What is put right is a state with a past, which outlives the window: it has `balls`, and those that were `found`.

    folder, place: The session's output folder, and where the session lies, if that was given.
    reading: How often what is shown was read again: whatever is drawn of it is older than that, or as old.
    looks: How often the whole was asked for again.
    frame: The photograph that is shown.
    on_photograph: Who wants the pixels that are clicked on the photograph.
    """

    area = "Session"
    is_flat = True
    ball_facts = ""
    """What is known of the chosen ball, or of all, as Markdown."""

    def __init__(self, *window: Any) -> None:
        super().__init__(*window)
        assert self.state.session is not None
        self.folder, self.place = self.state.session
        self.edited = self.folder
        self.reading, self.looks, self.frame = 0, 0, 0
        self.ball: int | None = None
        self.beside: Beside | None = None
        self.on_photograph: Callable[[tuple[float, float]], None] | None = None

    def open(self, place: Path) -> None:
        """Turn to a folder in which a session is begun, or was; what is put right here is kept."""
        if place in self.state.looks and place != self.place:
            self.state.show_session(self.workspace.path(self.state.looks[place].out), place)
            self.turn()

    def shown(self) -> Shown | None:
        """Return what stands in the view."""

    @property
    def plane(self) -> Plane | None:
        """Where the photograph stands in the view; None without one."""
        shown = self.shown()
        return shown and shown.plane

    def choose_small(self, index: int) -> None:
        """Look at the photograph whose small picture is clicked."""
        self.choose(frame=index)

    @property
    def balls(self) -> Balls:
        """The balls that are known so far, in the photograph and shot apart."""
        return self.history.state.balls if self.history else ()

    @property
    def outlines(self) -> Balls:
        """The balls that have circles."""
        return tuple(ball for ball in self.balls if ball.center_px and ball.radius_px)

    def is_found(self, ball: SphereTable) -> bool:
        """Whether a ball is as it was found."""
        return self.history is not None and self.history.state.is_found(ball)

    def _refresh_panels(self) -> None:
        if self.ball is not None and self.ball >= len(self.outlines):
            self.ball = None
        super()._refresh_panels()

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph; None: at all of it."""
        self.choose(ball=ball)

    def alter(self, label: str, state: Any, held_s: float | None = None) -> None:
        """Take another state, and show it; held_s: as of `did`."""
        self.did(label, state, held_s)
        self.refresh()

    def correct(self, outlines: Balls, label: str = "correct a ball", held_s: float | None = None) -> None:
        """Take other balls in the photograph; held_s: as of `did`."""
        if self.history is not None:
            apart = tuple(ball for ball in self.balls if not ball.center_px)
            balls = with_usual_diameters((*apart, *outlines), (*apart, *self.outlines))
            self.alter(label, self.history.state.with_balls(balls), held_s)

    def measure(self, which: str | int, diameter_mm: float) -> None:
        """Say the diameter of all balls of a kind, or of one in the photograph; 0: it is not known."""
        balls, one = self.balls, self.outlines[which] if isinstance(which, int) else None
        for index, ball in enumerate(balls):
            if ball is one or ball.kind == which:
                balls = changed(balls, index, diameter_mm=float(diameter_mm) or None)
        if self.history is not None:
            self.alter("diameter", self.history.state.with_balls(balls))

    def back_to_found(self) -> None:
        """Take the balls as they were found, with the diameters that are known of their kinds."""
        if self.history is not None:
            self.correct(tuple(ball for ball in self.history.state.found if ball.center_px), "balls as found")

    def click(self, pixel: tuple[float, float]) -> None:
        """Give a clicked pixel to who wants it; else choose the ball that it lies on."""
        if self.on_photograph is not None:
            self.on_photograph(pixel)
        elif (ball := under(self.outlines, pixel)) is not None:
            self.choose_ball(ball)

"""The window of a session: its steps, which frame and ball is looked at, and what is corrected."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from capture.session.manifest import SphereTable
from compare.report.facts import read_optional
from scene.output_folder import read_record
from shoot.watch.watch_folder import STATUS
from studio.session.ball_edits import Balls, changed, under
from studio.session.corrections import Corrections, balls_of, tables_of, write_amended
from studio.session.folder import STEPS, Review, is_kept
from studio.session.photograph_picture import PictureLook
from studio.session.plane import Plane
from studio.studio_state import Edits, History, RunningJob
from studio.window import Window

Array = NDArray[np.float64]
View = Literal["Photograph", "Lights in 3-D", "Scan"]


class SessionWindow(Window):
    """What a browser looks at a session in. Its panels call `choose`, `correct` and `alter`; then all are refreshed.

    What is put right are `Corrections`, with a past, which outlives the window.

    folder, place: The session's output folder, and where the session lies, if that was given.
    address_of: Where the server gives out an output folder's report.
    reading: How often the folder was read again: whatever is drawn of it is older than that, or as old.
    looks: How often the whole was asked for again.
    frame: The photograph that is shown. ball: The one that is looked at.
    on_photograph: Who wants the pixels that are clicked on the photograph.
    status: Of a shoot under way, as `rgbn watch` tells it.
    """

    area = "Session"
    first_tab = "Capture"
    review: Review

    def __init__(self, *window: Any, address_of: Callable[[Path], str] = lambda folder: "") -> None:
        super().__init__(*window)
        assert self.state.session is not None
        self.folder, self.place = self.state.session
        self.edited, self._address_of = self.folder, address_of
        self.reading, self.looks, self.frame = 0, 0, 0
        self.ball: int | None = None
        self.how, self.wanted = PictureLook(), ""
        self.on_photograph: Callable[[tuple[float, float]], None] | None = None
        self.status: Any = None

    def begin(self) -> None:
        """Read the folder."""
        self.read()

    @property
    def picks(self) -> Corrections:
        """What is put right, with the pairs of a pixel and a point of the scan."""
        return self.history.state if self.history else Corrections()

    @property
    def view(self) -> View:
        """What is looked at: it follows the tab."""
        if self.tab == "Lights" and self.review.lights is not None:
            return "Lights in 3-D"
        return "Scan" if self.is_picking and self.picks.wants_point else "Photograph"

    @property
    def method(self) -> str:
        """Whose normals are looked at: that is wanted, or the first; empty: none."""
        methods = self.review.material.methods
        return self.wanted if self.wanted in methods else next(iter(methods), "")

    @property
    def is_flat(self) -> bool:
        """Whether the photograph is shown."""
        return "review" not in vars(self) or self.view == "Photograph"

    @property
    def report(self) -> str:
        """Address of the report, where the verdict is looked at."""
        return self._address_of(self.folder) if self.tab == "Verdict" else ""

    @property
    def plane(self) -> Plane | None:
        """Where the photograph stands in the view; None without one."""
        if (frames := self.review.material.frames) is not None:
            return Plane(frames.width, frames.height)
        preview = self.review.preview
        return None if preview is None else Plane(*preview.shape[1::-1])

    @property
    def outlines(self) -> Balls:
        """The balls that have circles."""
        return tuple(ball for ball in self.picks.balls if ball.center_px and ball.radius_px)

    def is_found(self, ball: SphereTable) -> bool:
        """Whether a ball is as it was found."""
        return ball in self.picks.found

    def open_tab(self, name: str) -> None:
        """Turn to a step, and look at what it is about."""
        self.ball = self.ball if name == "Balls" else None
        self.on_photograph = None
        super().open_tab(name)

    def read(self) -> None:
        """Read the folder. Corrections stay, unless they are kept and the balls were found anew with them."""
        self.review = Review(self.folder, self.place)
        self.status = read_optional(self.review.store, STATUS)
        found, history = balls_of(self.review), self.history
        # While the balls are sought anew there are none that corrections could be of.
        is_new = "calibrate" in self.review.done or not self.outlines
        if history is None or (is_new and self.is_kept_so and found != history.state.found):
            now = Corrections(found, found)
            self.state.edits[self.folder] = Edits(History(now), now)

    def follow(self) -> bool:
        """Take what the steps have made, as each ends; and a shoot as it goes on."""
        was, self.status = self.status, read_optional(self.review.store, STATUS)
        record = read_record(self.folder) if self.is_busy or self.status else None
        # A step that begins is forgotten first: there is nothing new to see then.
        has_steps = record and any(self.review.steps.get(step) != entry for step, entry in record.done.items())
        if has_steps or (self.status != was and not self.review.names):
            self.read_again()
        return self.status != was

    def _refresh_panels(self) -> None:
        if self.ball is not None and self.ball >= len(self.outlines):
            self.ball = None
        if "review" in vars(self):
            self.frame = min(self.frame, max(len(self.review.names) - 1, 0))
        super()._refresh_panels()

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph; None: at all of it."""
        if self.tab != "Balls" and ball is not None:
            self.open_tab("Balls")
        self.choose(ball=ball)

    def alter(self, label: str, state: Corrections, held_s: float | None = None) -> None:
        """Take another state, and show it; held_s: as of `did`."""
        self.did(label, state, held_s)
        self.refresh()

    def correct(self, outlines: Balls, label: str = "correct a ball", held_s: float | None = None) -> None:
        """Take other balls in the photograph; held_s: as of `did`."""
        others = tuple(ball for ball in self.picks.balls if not ball.center_px)
        self.alter(label, replace(self.picks, balls=(*others, *outlines)), held_s)

    def measure(self, which: str | int, diameter_mm: float) -> None:
        """Say the diameter of all balls of a kind, or of one in the photograph; 0: it is not known."""
        balls, one = self.picks.balls, self.outlines[which] if isinstance(which, int) else None
        for index, ball in enumerate(balls):
            if ball is one or ball.kind == which:
                balls = changed(balls, index, diameter_mm=float(diameter_mm) or None)
        self.alter("diameter", replace(self.picks, balls=balls))

    def click(self, pixel: tuple[float, float]) -> None:
        """Give a clicked pixel to who wants it; else choose the ball that it lies on."""
        if self.on_photograph is not None:
            self.on_photograph(pixel)
        elif (ball := under(self.outlines, pixel)) is not None:
            self.choose_ball(ball)

    def read_again(self) -> None:
        """Read the folder again."""
        self.read()
        self.choose(reading=self.reading + 1)

    @property
    def is_picking(self) -> bool:
        """Whether pixels and points are picked."""
        return self.on_photograph == self._take_pixel

    def toggle_picking(self) -> None:
        """Begin or end to pick."""
        _ = self.review.scan_mesh  # What is at fault with it is told before anything is picked.
        self.choose(on_photograph=None if self.is_picking else self._take_pixel, ball=None)

    def _take_pixel(self, pixel: tuple[float, float]) -> None:
        self.alter("a pixel", self.picks.with_pixel(pixel))

    def take_point(self, point: Array) -> None:
        """Take the point of the scan, mm, that belongs to the last pixel."""
        self.alter("a point of the scan", self.picks.with_point(point))

    @property
    def is_kept_so(self) -> bool:
        """Whether nothing is corrected that is not in the folder's files."""
        return self.edits is None or self.edits.history.state == self.edits.kept

    def write_kept(self) -> Path:
        """Keep what was corrected, for `rgbn process` and the next run; return the folder of the corrected session."""
        edits, review = self.edits, self.review
        assert edits is not None
        state, spheres = edits.history.state, None
        if state.balls != edits.kept.balls or not state.pairs:
            spheres = tables_of(review.need("session")[0], state.balls, review.material.camera)
        folder = write_amended(review, spheres=spheres, picks=state if state.pairs else None)
        edits.kept = state
        self.notify("Kept", f"{self.workspace.name(folder)}/session.toml; your own session.toml is as it was.")
        self.refresh()
        return folder

    def job(self) -> RunningJob:
        """Run up to the step of the tab; under Verdict all of them."""
        label = "Run everything" if self.tab == "Verdict" else f"Run up to {self.tab}"
        return RunningJob(label, self.folder, self._words, is_possible=self.review.session is not None)

    def _words(self) -> list[str]:
        """Return what runs the steps with what was corrected, which is kept first."""
        self.review.need("session")
        if not self.is_kept_so:
            session = self.write_kept()
        else:
            # The session's own file may have changed since something was kept.
            session = write_amended(self.review) if is_kept(self.review.store) else self.review.session_path
        assert session is not None
        verb = "process" if self.tab == "Verdict" else STEPS[self.tab]
        return [verb, str(session.resolve()), "--out", str(self.folder)]

    def work_ended(self) -> None:
        """Show what the steps have made."""
        self.read_again()

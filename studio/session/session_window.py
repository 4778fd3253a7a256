"""The window of a session: its steps, which frame and ball is looked at, and what is corrected."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import read_optional
from draw.readable import readable, share
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.output_folder import read_record
from shoot.watch.status import STATUS
from studio.session.corrections import Corrections, balls_of, forget_kept, pose_of, tables_of, write_amended
from studio.session.folder import STEPS, Review, is_kept
from studio.session.photograph_picture import PictureLook, normals_beside, shown_of, twin_beside
from studio.session.photograph_window import PhotographWindow, Shown
from studio.studio_state import Edits, History, RunningJob
from studio.widgets import plain

Array = NDArray[np.float64]
View = Literal["Photograph", "Lights in 3-D", "Scan"]
SHOOT_PX = 820
"""Width of a shoot's panel, which is read from the tripod and has nothing beside it."""


class SessionWindow(PhotographWindow):
    """What a browser looks at a session in: what is put right are `Corrections`.

    address_of: Where the server gives out an output folder's report.
    factor: By how much the lights' sigmas are drawn larger; 0: so that they are seen. method: Whose normals are shown;
    empty: the first.
    on_scan: Who wants the points that are clicked on the scan, mm. is_scan_asked: It is shown alone for that.
    picked_pose: That the picks give, once it was asked for.
    status: Of a shoot under way, as `rgbn watch` tells it. is_alone: Of a folder's first shoot nothing else is shown.
    """

    first_tab = "Capture"
    review: Review

    def __init__(self, *window: Any, address_of: Callable[[Path], str] = lambda folder: "") -> None:
        super().__init__(*window)
        self._address_of = address_of
        self.how, self.factor, self.method = PictureLook(), 0, ""
        self.on_scan: Callable[[Array], None] | None = None
        self.is_scan_asked = self.is_alone = False
        self.picks_told, self.strokes = "", np.zeros((0, 2, 2))
        self.status: Any = None
        self.picked_pose: Any = None
        self._beside_of: Any = None

    def begin(self) -> None:
        """Read the folder; where it was asked for, run its steps."""
        self.read()
        status = self.status
        self.is_alone = self.review.session is None and isinstance(status, dict) and status.get("is_over") is False
        self.panel_px = SHOOT_PX if self.is_alone else self.panel_px
        if self.state.to_run:
            self.state.to_run = ""
            self.post(lambda: None if self.is_busy else self.begin_work())

    @property
    def picks(self) -> Corrections:
        """What is put right, with the pairs of a pixel and a point of the scan."""
        return self.history.state if self.history else Corrections()

    @property
    def ball_facts(self) -> str:
        """What is known of the chosen ball, or of all, as Markdown."""
        review, index, balls = self.review, self.ball, self.outlines
        if index is None:
            if not balls:
                return review.missing.get("balls", "There is no ball here.")
            by_hand = [str(number) for number, ball in enumerate(balls, 1) if not self.is_found(ball)]
            told = f" Corrected by hand: {', '.join(by_hand)}." if by_hand else ""
            return f"{len(balls)} balls.{told}"
        lines = ["as found" if self.is_found(balls[index]) else "corrected by hand, not calibrated with yet"]
        if index < len(review.spheres) and len(balls) == len(review.spheres):
            sphere = review.spheres[index]
            lines[0] += f"; fitted: centre ± {readable(sphere.sigma_px)} px, outline seen {share(sphere.score)} %"
            if sphere.kind == "chrome" and (seen := review.highlights_px) is not None:
                count = int(np.isfinite(seen[index, :, 0]).sum())
                lines.append(f"highlight (yellow; of this frame: blue) in {count} of {seen.shape[1]} frames")
        return "\n".join(f"- {line}" for line in lines)

    @property
    def view(self) -> View:
        """What is looked at: it follows the tab."""
        if self.tab == "Lights" and self.review.lights is not None:
            return "Lights in 3-D"
        return "Scan" if self.is_scan_asked else "Photograph"

    @property
    def is_flat(self) -> bool:
        """Whether the photograph is shown."""
        return "review" not in vars(self) or self.view == "Photograph"

    @property
    def report(self) -> str:
        """Address of the report, where the verdict is looked at."""
        return self._address_of(self.folder) if self.tab == "Verdict" else ""

    def shown(self) -> Shown | None:
        """Return the frame with what lies over it, the other frames, and what is marked on it."""
        return shown_of(self)

    def open_tab(self, name: str) -> None:
        """Turn to a step, and look at what it is about."""
        self.ball = self.ball if name == "Balls" else None
        self.on_photograph = self.on_scan = None
        self.is_scan_asked = False
        overlay = "scan, shaded" if name == "Scan" and self._can_shade else "nothing"
        self.how = replace(self.how, overlay=overlay)
        super().open_tab(name)

    @property
    def _can_shade(self) -> bool:
        return not {"frames", "camera", "lights", "scan"} & self.review.missing.keys()

    def read(self) -> None:
        """Read the folder. Corrections stay, unless they are kept and the balls were found anew with them."""
        before = vars(self).get("review")
        self.review = Review(self.folder, self.place)
        self.status = read_optional(self.review.store, STATUS)
        if before is not None and (turned := turned_deg(before.lights, self.review.lights)) is not None:
            self.notify(
                "The lights have turned",
                f"by {readable(np.median(turned))}° (median), {readable(turned.max())}° at most",
            )
        found, history = balls_of(self.review), self.history
        # While the balls are sought anew there are none that corrections could be of.
        is_new = self.is_kept_so and "calibrate" in self.review.done
        if history is None or (is_new and found != history.state.found):
            now = Corrections(found, found)
            self.state.edits[self.folder] = Edits(History(now), now)

    def follow(self) -> bool:
        """Take what the steps have made, as each ends; and a shoot as it goes on."""
        record = read_record(self.folder) if self.is_busy or self.is_alone else None
        status = read_optional(self.review.store, STATUS)
        was, self.status = self.status, status
        if record is not None and self.is_alone and "check" in record.done:
            self.turn()
        # A step that begins is forgotten first: there is nothing new to see then.
        elif record is not None and any(self.review.steps.get(step) != entry for step, entry in record.done.items()):
            self.read_again()
        return status != was

    def _refresh_panels(self) -> None:
        if "review" in vars(self):
            frames = self.review.material.frames
            self.frame = min(self.frame, len(frames) - 1) if frames is not None else 0
            self.attempt(self._look_beside)
        super()._refresh_panels()

    def _look_beside(self) -> None:
        """Have the picture that the tab shows beside the photograph."""
        review, tab = self.review, self.tab
        methods = review.material.methods
        self.method = self.method if self.method in methods else next(iter(methods), "")
        now = (tab, self.reading, self.method) if tab == "Solve" else (tab, self.reading, self.frame, self.how)
        if now != self._beside_of:
            # Kept first: what fails once would fail again at each refresh.
            self._beside_of, self.beside = now, None
            if tab == "Solve":
                self.beside = normals_beside(review, self.method)
            elif tab == "Twin" and not {"twin", "frames"} & review.missing.keys():
                self.beside = twin_beside(review, self.frame, self.how)

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph."""
        if self.tab != "Balls" and ball is not None:
            self.open_tab("Balls")
        self.choose(ball=ball)

    def look_at(self, **changes: Any) -> None:
        """Show the photograph in another way; see `PictureLook`."""
        self.choose(how=replace(self.how, **changes))

    def read_again(self) -> None:
        """Read the folder again; a scan that was registered meanwhile is laid over the photograph."""
        could = self._can_shade
        self.read()
        if self.tab == "Scan" and self._can_shade and not could:
            self.how = replace(self.how, overlay="scan, shaded")
        self.choose(reading=self.reading + 1)

    @property
    def is_picking(self) -> bool:
        """Whether pixels and points are picked."""
        return self.on_photograph == self._take_pixel

    def toggle_picking(self) -> None:
        """Begin or end to pick."""
        if self.is_picking:
            self.on_photograph = self.on_scan = None
        else:
            _ = self.review.scan_mesh  # What is at fault with it is told before anything is picked.
            self.on_photograph, self.on_scan = self._take_pixel, self._take_point
        self.choose(is_scan_asked=False, ball=None)

    def _take_pixel(self, pixel: tuple[float, float]) -> None:
        picks = self.picks.with_pixel(pixel)
        self._pick("a pixel", picks, len(picks.pixels) > len(picks.points))

    def _take_point(self, point: Array) -> None:
        self._pick("a point of the scan", self.picks.with_point(point), False)

    def _pick(self, label: str, picks: Corrections, is_scan_asked: bool) -> None:
        self.is_scan_asked, self.picks_told = is_scan_asked, ""
        self.alter(label, picks)

    def pose_from_picks(self) -> None:
        """Draw the scan's outline at the pose that the picks give."""
        from align.pose.scan_view import outline_strokes

        review = self.review
        found = self.picked_pose = pose_of(review, self.picks, review.scan_mesh)
        self.strokes = outline_strokes(review.scan_mesh, found.pose, *review.need("camera"))
        told = "".join(f"\n\n**Warning:** {plain(text)}" for text in found.warnings)
        self.picks_told = (
            f" They lie {readable(found.residual_px, 1)} px rms apart at the pose that they give. Its outline is drawn "
            f"in pink: a start, which the step `align` refines.{told}"
        )
        self.choose(is_scan_asked=False)

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
            session, camera = review.need("session", "camera")
            spheres = tables_of(session, state.balls, camera)
        folder = write_amended(review, spheres=spheres, picks=state if state.pairs else None)
        edits.kept = state
        self.notify("Kept", f"{self.workspace.name(folder)}/session.toml; your own session.toml is as it was.")
        self.refresh()
        return folder

    def forget(self) -> None:
        """Remove what was kept, and read the folder again."""
        forget_kept(self.review)
        self.state.edits.pop(self.folder, None)
        self.read_again()

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


def turned_deg(before: Lights | None, after: Lights | None) -> Array | None:
    """Return by how much each light's direction (F,) changed; None where they are the same, or not comparable."""
    if before is None or after is None or before.names != after.names:
        return None
    turned = angular_error_deg(after.seen_from(before.reference_point_mm).directions, before.directions)
    return turned if turned.max() > 1e-6 else None

"""One browser's window for a session: its steps, which frame and ball it looks at, and what is corrected."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Image
from scene.camera import Camera
from scene.current import file_digest
from scene.errors import SceneError
from scene.lights import Lights
from scene.normals import angular_error_deg
from studio.desk import Desk, History, Sitting
from studio.editor.preview import Preview
from studio.photograph.outlines import Outlines
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import Plane
from studio.review.corrected_session import PICKS, forget_kept, outlines_of, specs_of, write_amended
from studio.review.folder import KEPT, Review, is_kept
from studio.review.photograph_picture import Look
from studio.review.scan_picks import Picks, write_picks
from studio.workspace import Workspace

Array = NDArray[np.float64]
View = Literal["Photograph", "Lights in 3-D", "Scan"]
STEPS = {"Capture": "check", "Balls": "calibrate", "Lights": "calibrate", "Scan": "align", "Solve": "solve",
         "Twin": "twin", "Verdict": "compare"}  # fmt: skip
"""The tabs of a session, each with the step of `lab.plan` up to which its button runs."""


@dataclass(frozen=True, eq=False)
class Beside:
    """A picture that stands beside the photograph: of the same view, with a caption."""

    image: Image
    caption: str


@dataclass(frozen=True)
class Corrections:
    """What a hand has put right."""

    outlines: Outlines = ()
    picks: Picks = field(default_factory=Picks)


class ReviewWindow(PhotographWindow):
    """What a browser looks at a session in. Its panels call `show`, `choose` and `correct`; then all are refreshed.

    folder: The output folder. session_path: None: the session that the folder names.
    `read` is to be called before anything is shown.
    """

    area = "Session"
    review: Review

    def __init__(
        self, client: Any, workspace: Workspace, preview: Preview, folder: Path, session_path: Path | None = None,
        desk: Desk | None = None,
    ) -> None:  # fmt: skip
        super().__init__(client, workspace, preview, desk)
        self.folder, self.session_path = folder, session_path
        self.frame, self.shown = 0, Look()
        self.view: View = "Photograph"
        self.beside: Beside | None = None
        self.factor = 0
        """By how much the lights' sigmas are drawn larger; 0: so that they are seen."""
        self.on_scan: Callable[[Array], None] | None = None
        """Who wants the points that are clicked on the scan, mm."""
        self.address_of: Callable[[Path], str] = lambda folder: ""
        """Where the server gives out an output folder's report."""

    @property
    def sitting(self) -> Sitting | None:
        """What is corrected here; it lies on the desk."""
        return self.desk.sittings.get(self.folder)

    @property
    def history(self) -> History[Corrections] | None:
        """The corrections with their past."""
        return self.sitting.history if self.sitting else None

    def keep(self, history: History[Any]) -> None:
        """Lay corrections on the desk."""
        assert self.sitting is not None
        self.sitting.history = history

    @property
    def picks(self) -> Picks:
        """Pairs of a pixel and a point of the scan."""
        return self.history.state.picks if self.history else Picks()

    @property
    def is_flat(self) -> bool:
        """Whether the photograph is shown."""
        return self.view == "Photograph"

    @property
    def report(self) -> str:
        """Address of the report, where the verdict is looked at."""
        return self.address_of(self.folder) if self.tab == "Verdict" else ""

    @property
    def plane(self) -> Plane | None:
        """Where the photograph stands in the view; None without frames."""
        frames = self.review.material.frames
        return None if frames is None else Plane(frames.width, frames.height)

    @property
    def camera(self) -> Camera | None:
        """By which the outlines are drawn."""
        return self.review.material.camera

    def open_tab(self, name: str) -> None:
        """Turn to a step, and look at what it is about."""
        self.beside, self.ball = None, self.ball if name == "Balls" else None
        self.on_photograph = self.on_scan = None
        self.view = "Lights in 3-D" if name == "Lights" and self.review.lights is not None else "Photograph"
        overlay = "scan, shaded" if name == "Scan" and "scan" not in self.review.missing else "nothing"
        self.shown = replace(self.shown, overlay=overlay)
        super().open_tab(name)

    def read(self) -> None:
        """Read the folder. Corrections stay, unless they are kept and the balls were found anew with them."""
        before = vars(self).get("review")
        self.review = Review.read(self.folder, self.session_path)
        if before is not None and (turned := turned_deg(before.lights, self.review.lights)) is not None:
            self.notify("The lights have turned", f"by {np.median(turned):.3f}° (median), {turned.max():.3f}° at most")
        found, sitting = Corrections(outlines_of(self.review)), self.sitting
        if sitting is None or (self.is_kept_so and found != sitting.found):
            self.desk.sittings[self.folder] = Sitting(History(found), found, found, self._digest())
        else:
            sitting.seen = self._digest()

    def _refresh_panels(self) -> None:
        frames = self.review.material.frames
        self.frame = min(self.frame, len(frames) - 1) if frames is not None else 0
        super()._refresh_panels()

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph."""
        if self.tab != "Balls" and ball is not None:
            self.open_tab("Balls")
        self.choose(ball=ball, view="Photograph")

    def show(self, **changes: Any) -> None:
        """Show the photograph in another way; see `Look`."""
        self.choose(shown=replace(self.shown, **changes))

    def read_again(self) -> None:
        """Read the folder again."""
        self.read()
        self.choose(reading=self.reading + 1, beside=None)

    @property
    def is_kept_so(self) -> bool:
        """Whether nothing is corrected that is not in the folder's files."""
        return self.sitting is None or self.sitting.history.state == self.sitting.kept

    def _digest(self) -> str:
        """Return a digest of the files of what is kept: another window may write them."""
        return " ".join(str(file_digest(self.folder / KEPT / name)) for name in ("session.toml", PICKS))

    def write_kept(self) -> Path:
        """Keep what was corrected, for `rgbn process` and the next run; return the folder of the corrected session.

        Raises SceneError: another window has kept something since this one has read the folder.
        """
        sitting, review = self.sitting, self.review
        assert sitting is not None
        if sitting.seen != self._digest():
            sitting.seen = self._digest()
            raise SceneError(
                f"{KEPT}/session.toml: corrections were kept elsewhere, by another window, since this one read the "
                "folder. Keep again to put these in their place; or read the folder again, under Verdict."
            )
        state, spheres, picks = sitting.history.state, None, None
        if state.outlines != sitting.kept.outlines or not state.picks.pairs:
            session, camera = review.need("session", "camera")
            spheres = specs_of(session, state.outlines, camera)
        if state.picks.pairs:
            picks = write_picks(review, state.picks)
        folder = write_amended(review, spheres=spheres, picks=picks)
        sitting.kept, sitting.seen = state, self._digest()
        self.notify("Kept", f"{self.workspace.name(folder)}/session.toml; your own session.toml is as it was.")
        self.refresh()
        return folder

    def forget(self) -> None:
        """Remove what was kept, and read the folder again."""
        forget_kept(self.review)
        self.desk.sittings.pop(self.folder, None)
        self.read_again()

    def session_to_run(self) -> Path:
        """Return the session that a run takes: with what was corrected, which is kept first."""
        self.review.need("session")
        if not self.is_kept_so:
            return self.write_kept()
        # The session's own file may have changed since something was kept.
        session = write_amended(self.review) if is_kept(self.review.store) else self.review.session_path
        assert session is not None
        return session


def turned_deg(before: Lights | None, after: Lights | None) -> Array | None:
    """Return by how much each light's direction (F,) changed; None where they are the same, or not comparable."""
    if before is None or after is None or before.names != after.names:
        return None
    turned = angular_error_deg(after.seen_from(before.reference_point_mm).directions, before.directions)
    return turned if turned.max() > 1e-6 else None

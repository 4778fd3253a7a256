"""The window of a session: its steps, which frame and ball is looked at, and what is corrected."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import angular_error_deg
from studio.desk import Desk, History, Sitting
from studio.editor.preview import Preview
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import Plane
from studio.review.corrections import Corrections, Picks, forget_kept, outlines_of, specs_of, write_amended
from studio.review.folder import Review, is_kept
from studio.review.photograph_picture import Beside, Look, normals_beside, twin_beside
from studio.workspace import Workspace

Array = NDArray[np.float64]
View = Literal["Photograph", "Lights in 3-D", "Scan"]


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
        self.frame, self.shown, self.factor, self.method = 0, Look(), 0, ""
        """`factor`: By how much the lights' sigmas are drawn larger; 0: so that they are seen. `method`: Whose normals
        are shown; empty: the first."""
        self.on_scan: Callable[[Array], None] | None = None
        """Who wants the points that are clicked on the scan, mm."""
        self.is_scan_asked = False
        """The scan is shown alone, for a point of it to be clicked."""
        self.beside: Beside | None = None
        self._beside_of: Any = None
        self.picked_pose: Any = None
        """That the picks give, once it was asked for."""
        self.address_of: Callable[[Path], str] = lambda folder: ""
        """Where the server gives out an output folder's report."""

    @property
    def sitting(self) -> Sitting | None:
        """What is corrected here."""
        return self.desk.sittings.get(self.folder)

    @property
    def history(self) -> History[Corrections] | None:
        """The corrections with their past."""
        return self.sitting.history if self.sitting else None

    def keep(self, history: History[Any]) -> None:
        """Take corrections."""
        assert self.sitting is not None
        self.sitting.history = history

    @property
    def picks(self) -> Picks:
        """Pairs of a pixel and a point of the scan."""
        return self.history.state.picks if self.history else Picks()

    @property
    def view(self) -> View:
        """What is looked at: it follows the tab."""
        if self.tab == "Lights" and self.review.lights is not None:
            return "Lights in 3-D"
        return "Scan" if self.is_scan_asked else "Photograph"

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
        """Where the photograph stands in the view; None without one."""
        frames, first = self.review.material.frames, self.review.first_look
        if frames is None:
            return None if first is None else Plane(first.shape[1], first.shape[0])
        return Plane(frames.width, frames.height)

    @property
    def camera(self) -> Camera | None:
        """By which the outlines are drawn."""
        return None if self.review.material.frames is None else self.review.material.camera

    def open_tab(self, name: str) -> None:
        """Turn to a step, and look at what it is about."""
        self.ball = self.ball if name == "Balls" else None
        self.on_photograph = self.on_scan = None
        self.is_scan_asked = False
        overlay = "scan, shaded" if name == "Scan" and self._can_shade else "nothing"
        self.shown = replace(self.shown, overlay=overlay)
        super().open_tab(name)

    @property
    def _can_shade(self) -> bool:
        return not {"frames", "camera", "lights", "scan"} & self.review.missing.keys()

    def read(self) -> None:
        """Read the folder. Corrections stay, unless they are kept and the balls were found anew with them."""
        before = vars(self).get("review")
        self.review = Review(self.folder, self.session_path)
        if before is not None and (turned := turned_deg(before.lights, self.review.lights)) is not None:
            self.notify("The lights have turned", f"by {np.median(turned):.3f}° (median), {turned.max():.3f}° at most")
        found, sitting = Corrections(outlines_of(self.review)), self.sitting
        if sitting is None or (self.is_kept_so and found != sitting.found):
            self.desk.sittings[self.folder] = Sitting(History(found), found, found)

    def _refresh_panels(self) -> None:
        frames = self.review.material.frames
        self.frame = min(self.frame, len(frames) - 1) if frames is not None else 0
        self.attempt(self._look_beside)
        super()._refresh_panels()

    def _look_beside(self) -> None:
        """Have the picture that the tab shows beside the photograph."""
        review, tab = self.review, self.tab
        methods = review.material.methods
        self.method = self.method if self.method in methods else next(iter(methods), "")
        now = (tab, self.reading, self.method) if tab == "Solve" else (tab, self.reading, self.frame, self.shown)
        if now != self._beside_of:
            # Kept first: what fails once would fail again at each refresh.
            self._beside_of, self.beside = now, None
            if tab == "Solve":
                self.beside = normals_beside(review, self.method)
            elif tab == "Twin" and not {"twin", "frames"} & review.missing.keys():
                self.beside = twin_beside(review, self.frame, self.shown)

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph."""
        if self.tab != "Balls" and ball is not None:
            self.open_tab("Balls")
        self.choose(ball=ball)

    def show(self, **changes: Any) -> None:
        """Show the photograph in another way; see `Look`."""
        self.choose(shown=replace(self.shown, **changes))

    def read_again(self) -> None:
        """Read the folder again; a scan that was registered meanwhile is laid over the photograph."""
        could = self._can_shade
        self.read()
        if self.tab == "Scan" and self._can_shade and not could:
            self.shown = replace(self.shown, overlay="scan, shaded")
        self.choose(reading=self.reading + 1)

    @property
    def is_kept_so(self) -> bool:
        """Whether nothing is corrected that is not in the folder's files."""
        return self.sitting is None or self.sitting.history.state == self.sitting.kept

    def write_kept(self) -> Path:
        """Keep what was corrected, for `rgbn process` and the next run; return the folder of the corrected session."""
        sitting, review = self.sitting, self.review
        assert sitting is not None
        state, spheres = sitting.history.state, None
        if state.outlines != sitting.kept.outlines or not state.picks.pairs:
            session, camera = review.need("session", "camera")
            spheres = specs_of(session, state.outlines, camera)
        folder = write_amended(review, spheres=spheres, picks=state.picks if state.picks.pairs else None)
        sitting.kept = state
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

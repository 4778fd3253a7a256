"""One browser's window for a review: which frame and ball it looks at, and its corrections."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import Image
from scene.camera import Camera
from scene.spheres import Sphere
from studio.editor.preview import Preview
from studio.photograph.outlines import Outlines
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import Plane
from studio.review.corrections import outlines_of
from studio.review.folder import Review
from studio.review.photograph_picture import Look
from studio.review.scan_picks import Picks
from studio.widgets import code
from studio.workspace import Workspace

Array = NDArray[np.float64]
View = Literal["Photograph", "Lights in 3-D", "Scan", "Results"]
VIEWS: tuple[View, ...] = get_args(View)


@dataclass(frozen=True, eq=False)
class Beside:
    """A picture that stands beside the photograph: of the same view, with a caption."""

    image: Image
    caption: str


class ReviewWindow(PhotographWindow):
    """What a browser reviews. Its panels call `show`, `choose` and `correct`; then all panels are refreshed.

    folder: The output folder.
    session_path: None: the session that the folder names.
    `read` is to be called before anything is shown.
    """

    review: Review

    def __init__(
        self, client: Any, workspace: Workspace, preview: Preview, folder: Path, session_path: Path | None = None
    ) -> None:
        super().__init__(client, workspace, preview)
        self.folder, self.session_path = folder, session_path
        self.frame, self.shown = 0, Look()
        self.view: View = "Photograph"
        self.beside: Beside | None = None
        self.refitted: tuple[Sphere, ...] = ()
        """The balls as calibrating again has found them."""
        self.factor = 1
        """By how much the lights' sigmas are drawn larger."""
        self.picks = Picks()
        self.on_scan: Callable[[Array], None] | None = None
        """Who wants the points that are clicked on the scan, mm."""

    @property
    def plane(self) -> Plane | None:
        """Where the photograph stands in the view; None without frames."""
        frames = self.review.material.frames
        return None if frames is None else Plane(frames.width, frames.height)

    @property
    def camera(self) -> Camera | None:
        """By which the outlines are drawn."""
        return self.review.material.camera

    def kept_text(self, folder: Path, purpose: str) -> str:
        """Return, as Markdown, where corrections were kept and the command line that uses them."""
        name, out = self.workspace.name(folder), self.workspace.name(self.review.store.folder)
        return (
            f"Kept in {code(f'{name}/session.toml')}; your own session.toml is as it was. To {purpose}: **Run**, or "
            f"{code(f'rgbn process {name} --out {out}')}."
        )

    def read(self) -> None:
        """Read the folder."""
        self.review = Review.read(self.folder, self.session_path)
        self.outlines = outlines_of(self.review)

    def _refresh_panels(self) -> None:
        frames = self.review.material.frames
        self.frame = min(self.frame, len(frames) - 1) if frames is not None else 0
        super()._refresh_panels()

    def choose_ball(self, ball: int | None) -> None:
        """Look at a ball on the photograph."""
        self.choose(ball=ball, view="Photograph")

    def show(self, **changes: Any) -> None:
        """Show the photograph in another way; see `Look`."""
        self.choose(shown=replace(self.shown, **changes))

    def correct(self, outlines: Outlines) -> None:
        """Take other balls for calibrating again."""
        self.choose(outlines=outlines, refitted=())

    def read_again(self) -> None:
        """Read the folder again; corrections that were not kept are dropped."""
        self.read()
        self.choose(reading=self.reading + 1, refitted=(), beside=None)

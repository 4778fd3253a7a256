"""One browser's window on a folder without session.toml: the document that is to be written, as it is put right."""

from concurrent.futures import Future
from pathlib import Path
from typing import Any

from capture.session.manifest import SphereTable
from capture.survey.folder_files import FolderFiles
from lab.session_place import MANIFEST
from scene.camera import Camera
from scene.errors import SceneError
from shoot.init.draft import Draft
from shoot.init.init_session import check_free, write_manifest
from shoot.init.session_text import session_text
from studio.desk import Desk, History
from studio.editor.preview import Preview
from studio.new_session.found_capture import FoundCapture, Looking
from studio.photograph.outlines import Outline, Outlines
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import Plane
from studio.workspace import Workspace


class NewSessionWindow(PhotographWindow):
    """What a browser begins sessions in. Its panels call `edit`, `measure` and `correct`.

    looking: The folders that were named; what is written lies in one of them.
    """

    area = "New session"
    is_flat = True

    def __init__(
        self, client: Any, workspace: Workspace, preview: Preview, looking: Looking, desk: Desk | None = None
    ) -> None:
        super().__init__(client, workspace, preview, desk)
        self.looking = looking
        without = [files for files in looking.folders if not (files.folder / MANIFEST).exists()]
        self.files: FolderFiles = (without or looking.folders)[0]
        self.photograph: Path | None = None
        """The one that is shown; None: the mean of the flash frames."""
        self.state, self.share, self.is_looking = "", 0.0, False
        """What is being looked at and how much of it is done; or why nothing could be made of the folder."""

    @property
    def found(self) -> FoundCapture | None:
        """The folder as it was found; None before it was looked at."""
        return self.looking.found_in(self.files.folder)

    @property
    def history(self) -> History[Draft] | None:
        """The document with what was put right in it; None before the folder was looked at."""
        return self.desk.captures.get(self.files.folder) if self.found else None

    def keep(self, history: History[Any]) -> None:
        """Lay what was put right on the desk."""
        self.desk.captures[self.files.folder] = history

    @property
    def capture(self) -> Draft | None:
        """What would be written now, once the folder was looked at."""
        return self.history.state if self.history else None

    @property
    def balls(self) -> list[SphereTable]:
        """The balls, in the frames and shot apart."""
        return self.capture.manifest.spheres if self.capture else []

    @property
    def outlines(self) -> Outlines:
        """The balls in the frames."""
        draft = self.capture
        return () if draft is None else tuple(
            Outline(ball.kind, (ball.center_px[0], ball.center_px[1]), ball.radius_px, ball.diameter_mm,
                    not draft.is_found(ball))
            for ball in self.balls if ball.center_px and ball.radius_px
        )  # fmt: skip

    def place_of(self, index: int) -> int:
        """Return which of the balls an outline is."""
        return [number for number, ball in enumerate(self.balls) if ball.center_px][index]

    def correct(self, outlines: Outlines, label: str = "correct a ball", held_s: float | None = None) -> None:
        """Take other balls in the frames; a new one, or one of another kind, is as large as all of its kind."""
        was = self.outlines if len(outlines) == len(self.outlines) else outlines
        balls = [ball for ball in self.balls if not ball.center_px]
        for ball, before in zip(outlines, was, strict=True):
            alike = {one.diameter_mm for one in self.balls if one.kind == ball.kind}
            usual = alike.pop() if len(alike) == 1 else None
            diameter = ball.diameter_mm if ball.kind == before.kind else None
            balls.append(
                SphereTable(
                    kind=ball.kind,
                    diameter_mm=diameter or usual,
                    center_px=list(map(float, ball.center_px)),
                    radius_px=float(ball.radius_px),
                )
            )
        self.alter(label, held_s=held_s, manifest=self.need().with_balls(balls).manifest)

    def measure(self, which: str | int, diameter_mm: float) -> None:
        """Say the diameter of all balls of a kind, or of one in the frames; 0: it is not known."""
        of_kind = isinstance(which, str)
        place = None if of_kind else self.place_of(which)
        balls = [
            SphereTable(**{**ball.model_dump(), "diameter_mm": float(diameter_mm) or None})
            if number == place or ball.kind == which
            else ball
            for number, ball in enumerate(self.balls)
        ]
        self.edit(self.need().with_balls(balls), "diameter")

    @property
    def plane(self) -> Plane | None:
        """Where the photographs stand."""
        return None if self.capture is None else Plane(self.capture.width, self.capture.height)

    @property
    def camera(self) -> Camera | None:
        """By which the outlines are drawn."""
        return None if self.capture is None else self.capture.assumed_camera

    @property
    def text(self) -> str:
        """What would be written now, as session.toml has it."""
        return session_text(self.need(), "rgbn studio")

    @property
    def manifest(self) -> Path:
        """Where it is written."""
        return self.files.folder / MANIFEST

    def need(self) -> Draft:
        """Return the document. Raises SceneError: the folder was not looked at yet."""
        if self.capture is None:
            raise SceneError(f"{self.files.folder.name}: is still being looked at. Wait for it.")
        return self.capture

    def open(self, files: FolderFiles) -> None:
        """Look at a folder; what was put right in it, or in another one, is kept."""
        self.files, self.on_photograph = files, None
        if self.manifest.exists():
            self.desk.captures.pop(files.folder, None)
        self.choose(ball=None, photograph=None, is_looking=False, reading=self.reading + 1)
        if self.capture is None and not self.manifest.exists():
            self.choose(state="Reading the photographs ...", share=0.0, is_looking=True)
            self.looking.ask(
                files,
                lambda done, total: self.post(lambda: self._read(files, done, total)),
                lambda found: self.post(lambda: self._show(files, found)),
            )

    def _read(self, files: FolderFiles, done: int, total: int) -> None:
        if files is self.files and self.is_looking:
            reading = f"Reading the photographs: {done} of {total} ..."
            state = reading if done < total else "Looking for balls, board and scan: 10 to 60 seconds ..."
            self.choose(state=state, share=done / total)

    def _show(self, files: FolderFiles, found: "Future[FoundCapture]") -> None:
        if files is not self.files or not self.is_looking:
            return
        self.choose(state=str(found.exception()), is_looking=False)
        self.keep(History(found.result().draft))  # What was at fault is told by the window too.
        self.choose(reading=self.reading + 1)

    def edit(self, draft: Draft, label: str = "edit") -> None:
        """Take the document as it was edited."""
        self.alter(label, manifest=draft.manifest)

    def back_to_found(self) -> None:
        """Take the balls as they were found, with the diameters that are known of their kinds."""
        self.correct(
            tuple(Outline(ball.kind, (ball.center_px[0], ball.center_px[1]), ball.radius_px)
                  for ball in self.need().found if ball.center_px and ball.radius_px),
            "balls as found",
        )  # fmt: skip

    def write(self) -> None:
        """Write session.toml, once, and go on with the session.

        Raises SceneError: there is one already, what it would say cannot be read again, or the output folder would lie
        outside of the workspace.
        """
        draft, out = self.need(), self.out
        check_free(self.files)
        write_manifest(draft, self.text)
        self.desk.captures.pop(self.files.folder, None)
        self.looking.forget(self.files.folder)
        self.desk.show_session(out, self.files.folder, tab="Verdict")
        self.turn()

    @property
    def out(self) -> Path:
        """The output folder, in the workspace."""
        return self.workspace.path(self.looking.out_of(self.files))

    def open_session(self) -> None:
        """Show the session that the folder has already."""
        self.desk.show_session(self.out, self.files.folder)
        self.turn()

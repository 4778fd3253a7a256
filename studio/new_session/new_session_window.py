"""One browser's window on a folder without session.toml: what was found there, as it is put right."""

from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from capture.session.session import load_session
from capture.survey.folder_files import FolderFiles
from lab.session_place import MANIFEST
from scene.camera import Camera
from scene.errors import SceneError
from scene.files import write_text
from shoot.init.draft import Draft
from shoot.init.init_session import check_free
from shoot.init.prepare import with_camera
from shoot.init.session_text import session_text
from studio.desk import Desk, History
from studio.editor.preview import Preview
from studio.new_session.edited_capture import EditedCapture, as_found
from studio.new_session.found_capture import FoundCapture, Looking
from studio.photograph.outlines import Outlines
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import Plane
from studio.workspace import Workspace


@dataclass(frozen=True)
class PutRight:
    """A capture as a person has put it right, with the balls."""

    capture: EditedCapture
    outlines: Outlines


class NewSessionWindow(PhotographWindow):
    """What a browser begins sessions in. Its panels call `edit` and `correct`.

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
    def history(self) -> History[PutRight] | None:
        """What was put right; None before the folder was looked at."""
        return self.desk.captures.get(self.files.folder)

    def keep(self, history: History[Any]) -> None:
        """Lay what was put right on the desk."""
        self.desk.captures[self.files.folder] = history

    @property
    def capture(self) -> EditedCapture | None:
        """The capture, once it was looked at."""
        return self.history.state.capture if self.history else None

    @property
    def plane(self) -> Plane | None:
        """Where the photographs stand."""
        return None if self.capture is None else Plane(self.capture.draft.width, self.capture.draft.height)

    @property
    def camera(self) -> Camera | None:
        """By which the outlines are drawn."""
        return None if self.capture is None else self.capture.draft.assumed_camera

    @property
    def draft(self) -> Draft:
        """What would be written now."""
        return self.need().described(self.outlines)

    @property
    def text(self) -> str:
        """What would be written now, as session.toml has it."""
        return session_text(self.draft).replace("rgbn init", "rgbn studio", 1)

    @property
    def manifest(self) -> Path:
        """Where it is written."""
        return self.files.folder / MANIFEST

    def need(self) -> EditedCapture:
        """Return the capture. Raises SceneError: the folder was not looked at yet."""
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
        fault = found.exception()
        self.choose(state=str(fault), is_looking=False)
        capture = found.result()  # What was at fault is told by the window too.
        self.keep(History(PutRight(EditedCapture.of(capture), as_found(capture))))
        self.choose(reading=self.reading + 1)

    def edit(self, capture: EditedCapture, label: str = "edit") -> None:
        """Take the capture as it was edited."""
        self.alter(label, capture=capture)

    def back_to_found(self) -> None:
        """Take the balls as they were found."""
        self.correct(as_found(self.need().found), "balls as found")

    def write(self) -> None:
        """Write session.toml, once, and go on with the session.

        Raises SceneError: there is one already, what it would say cannot be read again, or the output folder would lie
        outside of the workspace.
        """
        draft, manifest, text, out = self.draft, self.manifest, self.text, self.out
        with_camera(draft, draft.lens)
        check_free(self.files)
        write_text(manifest, text)
        try:
            load_session(manifest)
        except SceneError:
            manifest.unlink()
            raise
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

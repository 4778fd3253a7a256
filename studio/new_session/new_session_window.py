"""One browser's window on a folder without session.toml: what was found there, as it is put right."""

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from capture.session.session import load_session
from capture.survey.folder_files import FolderFiles
from lab.init.draft import Draft
from lab.init.init_session import check_free
from lab.init.prepare import with_camera
from lab.init.session_text import session_text
from lab.session_place import MANIFEST
from scene.camera import Camera
from scene.errors import SceneError
from scene.files import write_text
from studio.editor.preview import Preview
from studio.new_session.edited_capture import EditedCapture, as_found
from studio.new_session.found_capture import FoundCapture
from studio.new_session.looking import Looking
from studio.photograph.outlines import Outlines
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import Plane
from studio.workspace import Workspace


class NewSessionWindow(PhotographWindow):
    """What a browser begins sessions in. Its panels call `edit` and `correct`.

    looking: The folders that were named on the command line; what is written lies in one of them.
    review: Called with an output folder and its session, to show them in this browser instead.
    """

    def __init__(
        self, client: Any, workspace: Workspace, preview: Preview, looking: Looking,
        review: Callable[[Path, Path], Any],
    ) -> None:  # fmt: skip
        super().__init__(client, workspace, preview)
        self.looking, self._review = looking, review
        without = [files for files in looking.folders if not (files.folder / MANIFEST).exists()]
        self.files: FolderFiles = (without or looking.folders)[0]
        self.capture: EditedCapture | None = None
        self.photograph: Path | None = None
        """The one that is shown; None: the mean of the flash frames."""
        self.state, self.share, self.is_looking = "", 0.0, False
        """What is being looked at and how much of it is done; or why nothing could be made of the folder."""
        self.written: set[Path] = set()
        """Folders whose session.toml was written here."""
        self.tabs: Any = None
        """What is of no use before something was found."""
        self._others: dict[Path, tuple[EditedCapture, Outlines]] = {}

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

    @property
    def is_written(self) -> bool:
        """Whether it was, from here."""
        return self.files.folder in self.written

    def _refresh_panels(self) -> None:
        self.tabs.visible = self.capture is not None
        super()._refresh_panels()

    def need(self) -> EditedCapture:
        """Return the capture. Raises SceneError: the folder was not looked at yet."""
        if self.capture is None:
            raise SceneError(f"{self.files.folder.name}: is still being looked at. Wait for it.")
        return self.capture

    def open(self, files: FolderFiles) -> None:
        """Look at a folder; what was put right in another one is kept."""
        if self.capture is not None:
            self._others[self.files.folder] = self.capture, self.outlines
        self.files = files
        capture, outlines = self._others.get(files.folder, (None, ()))
        self._begin(capture, outlines)
        if capture is None and not self.manifest.exists():
            self.choose(state="Reading the photographs ...", share=0.0, is_looking=True)
            self.looking.ask(
                files,
                lambda done, total: self.post(lambda: self._read(files, done, total)),
                lambda found: self.post(lambda: self._show(files, found)),
            )

    def _begin(self, capture: EditedCapture | None, outlines: Outlines) -> None:
        self.on_photograph = None
        here = {"capture": capture, "outlines": outlines, "ball": None, "photograph": None, "is_looking": False}
        self.choose(**here, reading=self.reading + 1)

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
        self._begin(EditedCapture.of(capture), as_found(capture))

    def edit(self, capture: EditedCapture) -> None:
        """Take the capture as it was edited."""
        self._check_open()
        self.choose(capture=capture)

    def correct(self, outlines: Outlines) -> None:
        """Take other balls."""
        self._check_open()
        super().correct(outlines)

    def _check_open(self) -> None:
        if self.is_written:
            self.refresh()  # Inputs show again what was written.
            raise SceneError(
                f"{self.manifest}: is written, and nothing here changes it any more. Correct balls in the review, once "
                "they are calibrated; the rest by hand in the file. Or remove the file, and start the studio again."
            )

    def back_to_found(self) -> None:
        """Take the balls as they were found."""
        self.correct(as_found(self.need().found))

    def write(self) -> None:
        """Write session.toml, once.

        Raises SceneError: there is one already, or what it would say cannot be read again.
        """
        draft, manifest, text = self.draft, self.manifest, self.text
        if self.is_written:
            raise SceneError(f"{manifest}: is written already.")
        with_camera(draft, draft.lens)
        check_free(self.files)
        write_text(manifest, text)
        try:
            load_session(manifest)
        except SceneError:
            manifest.unlink()
            raise
        self.choose(written=self.written | {self.files.folder})

    @property
    def out(self) -> Path:
        """The output folder, in the workspace."""
        return self.workspace.path(self.looking.out_of(self.files.folder))

    def open_review(self) -> None:
        """Show what was made of the session, in this browser."""
        self.looking.forget(self.files.folder)
        self._review(self.out, self.files.folder)

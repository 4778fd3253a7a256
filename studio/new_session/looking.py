"""The folders that a studio was given to begin sessions in, each looked at once, whichever window asks."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

from capture.survey.folder_files import FolderFiles
from lab.session_place import default_out
from scene.errors import SceneError
from studio.new_session.found_capture import FoundCapture, look

Told = Callable[[int, int], Any]


class Looking:
    """Folders, and what was found in those that somebody has asked for.

    out: Output folder of the one session, or, with `is_parent`, the folder in which each has its own; None: out/NAME.
    Raises SceneError: there are several, and one output folder.
    """

    def __init__(self, folders: Sequence[FolderFiles], out: Path | None = None, *, is_parent: bool = False) -> None:
        if out is not None and not is_parent and len(folders) > 1:
            raise SceneError(f"--out {out}: there are {len(folders)} objects, each with a folder of its own: out/NAME.")
        self.folders, self._out, self._is_parent = tuple(folders), out, is_parent
        self._found: dict[Path, Future[FoundCapture]] = {}
        self._told: dict[Path, list[Told]] = {}
        self._lock = threading.Lock()

    def out_of(self, folder: Path) -> Path:
        """Return the output folder of a session."""
        own = self._out / folder.name if self._out and self._is_parent else self._out
        return (own or default_out(folder, folder.name)).resolve()

    def ask(self, files: FolderFiles, told: Told, done: Callable[["Future[FoundCapture]"], Any]) -> None:
        """Have a folder looked at, in a thread of its own.

        told: Called with how many photographs are read, and of how many. done: Called with what was found, or why not.
        """
        folder = files.folder
        with self._lock:
            # What failed may have been mended.
            is_new = folder not in self._found or (self._found[folder].done() and self._found[folder].exception())
            if is_new:
                self._found[folder], self._told[folder] = Future(), []
            self._told[folder].append(told)
            future = self._found[folder]
        if is_new:
            # A daemon: whoever ends the studio does not wait for it.
            threading.Thread(target=self._look, args=(files, future), daemon=True).start()
        future.add_done_callback(done)

    def forget(self, folder: Path) -> None:
        """Let go of what was found in a folder: its photographs are hundreds of megabytes."""
        with self._lock:
            if folder in self._found and self._found[folder].done():
                del self._found[folder], self._told[folder]

    def _look(self, files: FolderFiles, future: "Future[FoundCapture]") -> None:
        def progress(done: int, total: int) -> None:
            for told in list(self._told[files.folder]):
                told(done, total)

        try:
            found = look(files, progress)
        except BaseException as fault:
            future.set_exception(fault)
        else:
            future.set_result(found)

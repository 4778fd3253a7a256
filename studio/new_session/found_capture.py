"""Folders of photographs looked at as `rgbn init` does, each once, whichever window asks."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.session.globs import natural_key
from capture.survey.folder_files import FolderFiles
from capture.survey.small_pictures import Small, read_small
from compare.report.picture_strip import CELL_PX
from compare.report.pictures import Exposure, Image, shrink
from lab.session_place import default_out
from scene.errors import SceneError
from scene.frames import decode
from scene.origin import Origin
from shoot.init.answers import Answers, Asking
from shoot.init.contact_sheet import MOST
from shoot.init.draft import ROLES, Draft
from shoot.init.prepare import prepare


@dataclass(frozen=True, eq=False)
class FoundCapture:
    """A folder as it was found; nobody was asked.

    Parameters
    ----------
    draft : Draft
    small : dict of Small
        Every photograph that can be read, whatever it is used for, in natural order.
    mean : (h, w, 3) float32
        Of the flash frames, linear, small.
    """

    draft: Draft
    small: dict[Path, Small]
    mean: NDArray[np.float32]

    @property
    def photographs(self) -> tuple[Path, ...]:
        """All that can be read."""
        return tuple(self.small)

    def picture(self, path: Path | None) -> Image:
        """Return a photograph, or the mean of the flash frames, as 8 bits (h, w, 3); all by one tone curve."""
        if path is None:
            return Exposure.for_picture(self.mean).develop(self.mean)
        return self.exposure.develop(decode(self.small[path].codes))

    @cached_property
    def exposure(self) -> Exposure:
        """The tone curve of all photographs."""
        return Exposure.for_frames(self.draft.small, white_value=Exposure.for_picture(self.mean).balance)

    @cached_property
    def thumbnails(self) -> tuple[Image, ...]:
        """All photographs, as wide as the strip shows them."""
        return tuple(self.exposure.develop(shrink(decode(one.codes), CELL_PX)) for one in self.small.values())


def look(files: FolderFiles, progress: "Told") -> FoundCapture:
    """Look at a folder; progress is told of the photographs, which are read first.

    Raises
    ------
    SceneError
        As `shoot.init.prepare.prepare`.
    """
    draft = prepare(files, Asking(Answers(), silent=True), nullcontext(progress))
    mean = draft.small.some(MOST).read().mean(axis=0)
    return FoundCapture(draft, _small(files, draft), mean)


def _small(files: FolderFiles, draft: Draft) -> dict[Path, Small]:
    flash, frames = draft.photographs["flash"], draft.small
    found = {
        path: Small(path, codes, draft.width, draft.height, draft.step, frames.is_mosaic)
        for path, codes in zip(flash, frames.codes, strict=True)
    }
    roles = (*ROLES, "board")
    listed = {path for some in (files.photographs, draft.photographs) for role in roles for path in some.get(role, [])}
    others = sorted(listed - found.keys(), key=natural_key)
    if others:
        read, _ = read_small(others, "srgb" if draft.manifest.frames.linear is False else "linear")
        found |= {one.path: one for one in read}
    return {path: found[path] for path in sorted(found, key=natural_key)}


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
        self._lock = threading.Lock()

    def out_of(self, files: FolderFiles) -> Path:
        """Return the output folder of a session."""
        if self._out and not self._is_parent:
            return self._out.resolve()
        origin = Origin("session", files.folder, tuple(files.photographs.get("flash", ())))
        return default_out(origin, files.folder.name, self._out).resolve()

    def ask(self, files: FolderFiles, told: Told, done: Callable[["Future[FoundCapture]"], Any]) -> None:
        """Have a folder looked at, in a thread of its own.

        told: Called with how many photographs are read, and of how many, by who asked first. done: Called with what was
        found, or why not.
        """
        with self._lock:
            future = self._found.get(files.folder)
            # What failed may have been mended.
            is_new = future is None or (future.done() and future.exception() is not None)
            if future is None or is_new:
                future = self._found[files.folder] = Future()
        if is_new:
            # A daemon: whoever ends the studio does not wait for it.
            threading.Thread(target=_fulfil, args=(future, files, told), daemon=True).start()
        future.add_done_callback(done)

    def found_in(self, folder: Path) -> FoundCapture | None:
        """Return what was found in a folder; None before it was looked at, and after it is forgotten."""
        with self._lock:
            future = self._found.get(folder)
        return future.result() if future and future.done() and not future.exception() else None

    def forget(self, folder: Path) -> None:
        """Let go of what was found in a folder: its photographs are hundreds of megabytes."""
        with self._lock:
            if folder in self._found and self._found[folder].done():
                del self._found[folder]


def _fulfil(future: "Future[FoundCapture]", files: FolderFiles, told: Told) -> None:
    try:
        found = look(files, told)
    except BaseException as fault:
        future.set_exception(fault)
    else:
        future.set_result(found)

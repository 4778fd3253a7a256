"""Folders of photographs looked at as `rgbn init` does: each once, in a thread that outlives the window."""

import threading
import time
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.session.globs import natural_key
from capture.session.session_types import Encoding
from capture.survey.folder_files import FolderFiles
from capture.survey.small_pictures import Small, read_small
from compare.report.picture_strip import CELL_PX
from compare.report.pictures import Exposure
from lab.session_place import default_out
from scene.errors import SceneError
from scene.frames import decode
from scene.map_pictures import Image, shrink
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


class Look:
    """A look at a folder, in a thread of its own, from when it is made.

    done, total: Photographs that are read, and how many there are. draft: What is known so far: the photographs' uses,
    then the balls. found: In the end; or `fault`, why nothing could be made of the folder.
    """

    def __init__(self, files: FolderFiles) -> None:
        self.files, self.done, self.total = files, 0, 1
        self.draft: Draft | None = None
        self.found: FoundCapture | None = None
        self.fault: Exception | None = None
        self.begun_s = time.monotonic()
        # A daemon: whoever ends the studio does not wait for it.
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """Whether it has ended."""
        return self.found is not None or self.fault is not None

    def wait(self) -> None:
        """Return when it has ended."""
        self._thread.join()

    @property
    def state(self) -> str:
        """What it is at, and for how long."""
        at = f"Reading the photographs: {self.done} of {self.total}" if self.done else "Reading the photographs"
        if self.draft is not None:
            has_balls = self.draft.manifest.spheres
            at = "Looking at the scan" if has_balls else "Looking for balls, board and scan: 10 to 60 seconds"
        return f"{at} ... {time.monotonic() - self.begun_s:.0f} s so far"

    @cached_property
    def first(self) -> Image | None:
        """The first photograph, small; None: it cannot be read."""
        return first_look(self.files.photographs["flash"][0])

    def _read(self, done: int, total: int) -> None:
        self.done, self.total = done, total

    def _see(self, draft: Draft) -> None:
        self.draft = draft

    def _run(self) -> None:
        try:
            asking = Asking(Answers(), silent=True)
            draft = prepare(self.files, asking, nullcontext(self._read), self._see)
            self.found = FoundCapture(draft, _small(self.files, draft), mean_of(draft))
        except Exception as fault:
            self.fault = fault


def mean_of(draft: Draft) -> NDArray[np.float32]:
    """Return the mean (h, w, 3) of the flash frames, linear, small."""
    return draft.small.some(MOST).read().mean(axis=0)


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


def first_look(path: Path, encoding: Encoding = "linear") -> Image | None:
    """Return a photograph small, as 8 bits (h, w, 3); None: it cannot be read."""
    with suppress(OSError, ValueError, SceneError):
        (small,), _ = read_small([path], encoding)
        linear = decode(small.codes)
        return Exposure.for_picture(linear).develop(linear)
    return None


class Looking:
    """Folders, and the looks at those that somebody has asked for.

    out: Output folder of the one session, or, with `is_parent`, the folder in which each has its own; None: out/NAME.
    Raises SceneError: there are several, and one output folder.
    """

    def __init__(self, folders: Sequence[FolderFiles], out: Path | None = None, *, is_parent: bool = False) -> None:
        if out is not None and not is_parent and len(folders) > 1:
            raise SceneError(f"--out {out}: there are {len(folders)} objects, each with a folder of its own: out/NAME.")
        self.folders, self._out, self._is_parent = tuple(folders), out, is_parent
        self.looks: dict[Path, Look] = {}
        """By folder. One that is taken out is made anew: its photographs are hundreds of megabytes."""

    def out_of(self, files: FolderFiles) -> Path:
        """Return the output folder of a session."""
        if self._out and not self._is_parent:
            return self._out.resolve()
        origin = Origin("session", files.folder, tuple(files.photographs.get("flash", ())))
        return default_out(origin, files.folder.name, self._out).resolve()

    def look_at(self, files: FolderFiles) -> Look:
        """Return the look at a folder, which is begun now if none was; one that failed is begun again."""
        look = self.looks.get(files.folder)
        if look is None or look.fault is not None:
            look = self.looks[files.folder] = Look(files)
        return look

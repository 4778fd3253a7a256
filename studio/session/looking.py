"""A folder of photographs looked at as `rgbn init` does, in a thread that outlives the window."""

import threading
import time
from contextlib import nullcontext, suppress
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.session.globs import natural_key
from capture.session.session_types import Encoding
from capture.survey.folder_files import FEWEST, FolderFiles
from capture.survey.small_pictures import Small, read_small
from compare.report.picture_strip import CELL_PX, INK, PictureStrip
from compare.report.pictures import Exposure
from scene.errors import SceneError
from scene.frames import decode
from scene.map_pictures import Image, shrink
from shoot.init.answers import Answers, Asking
from shoot.init.draft import ROLES, Draft
from shoot.init.prepare import prepare

BOARD, UNUSED = "board", "not used"
MOST = 12
"""Flash frames that their mean is made of."""
LEFT_OUT, OTHER = (255, 120, 110), (255, 210, 90)
"""Colours of the names of photographs that are not used, and of those that are no flash frames."""


class FolderLook:
    """A folder, and what is found in it once `begin` was called; nobody is asked.

    files, out: Of the folder, and its session's output folder.
    draft: What is known so far: the photographs' uses, then the balls, then all, when it `is_done`; or `fault`, why
    nothing could be made of the folder.
    small: In the end every photograph that can be read, whatever it is used for, in natural order.
    """

    def __init__(self, files: FolderFiles, out: Path) -> None:
        self.files, self.out, self.done, self.total = files, out, 0, 1
        self.draft: Draft | None = None
        self.small: dict[Path, Small] = {}
        self.is_done, self.begun_s = False, 0.0
        self.fault: Exception | None = None
        self._thread: threading.Thread | None = None

    def begin(self) -> None:
        """Look at it, once; what failed may have been mended."""
        if self._thread is None or self.fault is not None:
            self.fault, self.begun_s = None, time.monotonic()
            # A daemon: whoever ends the studio does not wait for it.
            self._thread = threading.Thread(target=self._run, daemon=True)
            self._thread.start()

    def wait(self) -> None:
        """Return when the look has ended."""
        if self._thread is not None:
            self._thread.join()

    @property
    def is_over(self) -> bool:
        """Whether the look has ended."""
        return self.is_done or self.fault is not None

    @property
    def told(self) -> str:
        """What the look is at, and for how long; or why it failed."""
        at = f"Reading the photographs: {self.done} of {self.total}" if self.done else "Reading the photographs"
        if self.draft is not None:
            is_last = self.draft.manifest.spheres
            at = "Looking at the scan" if is_last else "Looking for balls, board and scan: 10 to 60 seconds"
        return str(self.fault or f"{at} ... {time.monotonic() - self.begun_s:.0f} s so far")

    def _run(self) -> None:
        try:
            tell = nullcontext(lambda done, total: vars(self).update(done=done, total=total))
            seen = lambda draft: vars(self).update(draft=draft)  # noqa: E731
            draft = prepare(self.files, Asking(Answers(), silent=True), tell, seen=seen)
            self.small = self._read_small(draft)
            self.draft, self.is_done = draft, True
        except Exception as fault:
            self.fault = fault

    def _read_small(self, draft: Draft) -> dict[Path, Small]:
        flash, frames = draft.photographs["flash"], draft.small
        found = {
            path: Small(path, codes, draft.width, draft.height, draft.step, frames.is_mosaic)
            for path, codes in zip(flash, frames.codes, strict=True)
        }
        listed = {
            path for some in (self.files.photographs, draft.photographs) for role in (*ROLES, BOARD)
            for path in some.get(role, [])
        }  # fmt: skip
        if others := sorted(listed - found.keys(), key=natural_key):
            read, _ = read_small(others, "srgb" if draft.manifest.frames.linear is False else "linear")
            found |= {one.path: one for one in read}
        return {path: found[path] for path in sorted(found, key=natural_key)}

    @cached_property
    def _mean(self) -> NDArray[np.float32]:
        """Of the flash frames (h, w, 3), linear."""
        assert self.draft is not None
        return self.draft.small.some(MOST).read().mean(axis=0)

    @cached_property
    def exposure(self) -> Exposure:
        """The tone curve of all photographs."""
        assert self.draft is not None
        return Exposure.for_frames(self.draft.small, white_value=Exposure.for_picture(self._mean).balance)

    def picture(self, path: Path | None) -> Image:
        """Return a photograph, or the mean of the flash frames, as 8 bits (h, w, 3); all by one tone curve."""
        if path is None:
            return Exposure.for_picture(self._mean).develop(self._mean)
        return self.exposure.develop(decode(self.small[path].codes))

    @cached_property
    def _thumbnails(self) -> tuple[Image, ...]:
        """All photographs, as wide as the strip shows them."""
        return tuple(self.exposure.develop(shrink(decode(one.codes), CELL_PX)) for one in self.small.values())

    @cached_property
    def first(self) -> Image | None:
        """The first photograph, small, before anything else is known; None: it cannot be read."""
        return first_look(self.files.photographs["flash"][0])

    def strip(self, roles: tuple[str, ...]) -> PictureStrip:
        """Return the small photographs, each with its use; those that are not used are dim."""
        colours = {"flash": INK, UNUSED: LEFT_OUT}
        labels = [
            (path.stem if role == "flash" else f"{role}: {path.stem}", colours.get(role, OTHER))
            for path, role in zip(self.small, roles, strict=True)
        ]
        dimmed = [small // (3 if role == UNUSED else 1) for small, role in zip(self._thumbnails, roles, strict=True)]
        return PictureStrip.of(dimmed, labels)


def first_look(path: Path, encoding: Encoding = "linear") -> Image | None:
    """Return a photograph small, as 8 bits (h, w, 3); None: it cannot be read."""
    with suppress(OSError, ValueError, SceneError):
        (small,), _ = read_small([path], encoding)
        linear = decode(small.codes)
        return Exposure.for_picture(linear).develop(linear)
    return None


def role_of(draft: Draft, path: Path) -> str:
    """Return what a photograph is used for."""
    return next((role for role, paths in draft.photographs.items() if path in paths), UNUSED)


def with_role(draft: Draft, small: dict[Path, Small], path: Path, role: str) -> Draft:
    """Return a draft with a photograph used for something else.

    Raises SceneError: too few flash frames would be left, it is of another size, or it is one of a board.
    """
    was = role_of(draft, path)
    if role == was:
        return draft
    if BOARD in (role, was):
        raise SceneError(
            f"{path.name}: a board's shots are found by themselves. Put three or more that show all of it into a "
            "folder called board, or others out of it, and look at the folder again."
        )
    if "flash" in (role, was) and any(ball.frames for ball in draft.manifest.spheres):
        raise SceneError(
            f"{path.name}: the balls that were shot apart have one photograph for each flash frame. Name it under "
            "frames.skip in session.toml, which leaves out theirs, too."
        )
    photographs = {one: [other for other in paths if other != path] for one, paths in draft.photographs.items()}
    if role != UNUSED:
        photographs[role] = sorted([*photographs.get(role, []), path], key=natural_key)
    if len(photographs["flash"]) < FEWEST:
        raise SceneError(f"{path.name}: {FEWEST} flash frames are the fewest. Leave it, or add others first.")
    size = small[path].width, small[path].height
    if role != UNUSED and size != (draft.width, draft.height):
        raise SceneError(f"{path.name}: {size[0]} x {size[1]} px; the flash frames: {draft.width} x {draft.height}.")
    return draft.with_photographs(photographs)

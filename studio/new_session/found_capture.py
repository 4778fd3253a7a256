"""A folder of photographs looked at as `rgbn init` does, with all of its photographs small, to be shown."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.session.globs import natural_key
from capture.survey.folder_files import FolderFiles
from capture.survey.small_pictures import Small, read_small
from compare.report.picture_strip import CELL_PX
from compare.report.pictures import Exposure, Image, shrink
from lab.init.answers import Answers, Asking
from lab.init.contact_sheet import MOST
from lab.init.draft import Draft
from lab.init.prepare import Progress, prepare
from scene.frames import decode

ROLES = ("flash", "ambient", "dark", "flat", "board")


@dataclass(frozen=True, eq=False)
class FoundCapture:
    """A folder as it was found; nobody was asked.

    Parameters
    ----------
    files : FolderFiles
    draft : Draft
    small : dict of Small
        Every photograph that can be read, whatever it is used for, in natural order.
    mean : (h, w, 3) float32
        Of the flash frames, linear, small.
    """

    files: FolderFiles
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


def look(files: FolderFiles, progress: Progress) -> FoundCapture:
    """Look at a folder; progress is told of the photographs, which are read first.

    Raises
    ------
    SceneError
        As `lab.init.prepare.prepare`.
    """
    draft = prepare(files, Asking(Answers(), silent=True), progress)
    mean = draft.small.some(MOST).read().mean(axis=0)
    return FoundCapture(files, draft, _small(files, draft), mean)


def _small(files: FolderFiles, draft: Draft) -> dict[Path, Small]:
    flash, frames = draft.photographs["flash"], draft.small
    found = {
        path: Small(path, codes, draft.width, draft.height, draft.step, frames.is_mosaic)
        for path, codes in zip(flash, frames.codes, strict=True)
    }
    listed = {
        path for paths in (files.photographs, draft.photographs) for role in ROLES for path in paths.get(role, [])
    }
    others = sorted(listed - found.keys(), key=natural_key)
    if others:
        read, _ = read_small(others, "srgb" if draft.linear is False else "linear")
        found |= {one.path: one for one in read}
    return {path: found[path] for path in sorted(found, key=natural_key)}

"""A folder of photographs looked at as `rgbn init` does, with all of its photographs small, to be shown."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.camera.exif import Exif, read_exif
from capture.camera.session_camera import usual_camera
from capture.session.globs import natural_key
from capture.survey.folder_files import FolderFiles
from capture.survey.small_pictures import Small, read_small
from compare.report.pictures import Exposure, Image, shrink
from lab.init.answers import Answers, Asking
from lab.init.contact_sheet import MOST
from lab.init.draft import Draft
from lab.init.prepare import Progress, prepare, with_camera
from lab.init.scan_unit import ScanSize, object_size_mm, read_scan
from scene.camera import Camera
from scene.frames import decode
from scene.spheres import Kind
from studio.photograph.picture_strip import CELL_PX

KINDS: tuple[Kind, ...] = ("chrome", "white")
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
    exif : tuple of Exif
        The flash frames'.
    scan : ScanSize or None
        Of the draft's scan.
    across_px : float or None
        The object's diagonal in the picture, full-size pixels; None where it was not found, or no scan needs it.
    mean : (h, w, 3) float32
        Of the flash frames, linear, small.
    """

    files: FolderFiles
    draft: Draft
    small: dict[Path, Small]
    exif: tuple[Exif, ...]
    scan: ScanSize | None
    across_px: float | None
    mean: NDArray[np.float32]

    @property
    def photographs(self) -> tuple[Path, ...]:
        """All that can be read."""
        return tuple(self.small)

    def picture(self, path: Path | None) -> Image:
        """Return a photograph, or the mean of the flash frames, as 8 bits (h, w, 3); all by one tone curve."""
        if path is None:
            return Exposure(1.0, self._white).develop(self.mean)
        return self.exposure.develop(decode(self.small[path].codes))

    @cached_property
    def exposure(self) -> Exposure:
        """The tone curve of all photographs."""
        return Exposure.for_frames(self.draft.small, white_value=self._white)

    @cached_property
    def thumbnails(self) -> tuple[Image, ...]:
        """All photographs, as wide as the strip shows them."""
        return tuple(self.exposure.develop(shrink(decode(one.codes), CELL_PX)) for one in self.small.values())

    @property
    def _white(self) -> NDArray[np.float64]:
        """RAW colours are the sensor's, greenish: each channel by its own white."""
        return np.maximum(np.quantile(self.mean, 0.995, axis=(0, 1)), 1e-6).astype(np.float64)


def look(files: FolderFiles, progress: Progress) -> FoundCapture:
    """Look at a folder; progress is told of the photographs, which are read first.

    Raises
    ------
    SceneError
        As `lab.init.prepare.prepare`.
    """
    draft = prepare(files, Asking(Answers(), silent=True), progress)
    small = _small(files, draft)
    exif = tuple(read_exif(path) for path in draft.photographs["flash"])
    _, camera = with_camera(draft, draft.lens, exif)
    camera = camera or usual_camera(draft.small.width, draft.small.height)
    mean = draft.small.some(MOST).read().mean(axis=0)
    scan = read_scan(draft.scan) if draft.scan else None
    return FoundCapture(files, draft, small, exif, scan, _across_px(draft, camera) if scan else None, mean)


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


def _across_px(draft: Draft, camera: Camera) -> float | None:
    """Return the object's diagonal: its size in millimetres, were each ball as many across as it is pixels."""
    balls = tuple(replace(ball, diameter_mm=2 * ball.radius_px or None) for ball in draft.balls)
    return object_size_mm(replace(draft, balls=balls), camera)

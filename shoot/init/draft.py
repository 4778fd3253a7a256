"""A capture as it was found: what goes into its session.toml, and what speaks for each part of it."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from capture.camera.exif import Exif
from capture.camera.session_camera import usual_camera
from capture.session.session_types import Lens
from capture.survey.board_layout import Layout
from scene.camera import Camera
from scene.frames import Frames
from scene.length_units import Unit
from scene.spheres import Kind, Sphere
from shoot.init.scan_unit import ScanSize, unit_by_size


@dataclass(frozen=True)
class DraftBall:
    """A ball as it was found.

    center_px, radius_px : in pixels of the full-size photographs.
    by_hand : it was placed or moved by a person; its circle then goes into session.toml.
    files : its own photographs, where it was shot apart.
    """

    kind: Kind
    center_px: tuple[float, float] = (0.0, 0.0)
    radius_px: float = 0.0
    diameter_mm: float | None = None
    by_hand: bool = False
    files: tuple[Path, ...] = ()

    @property
    def mm_per_px(self) -> float | None:
        """At its distance; None where its circle or its diameter is not known."""
        return self.diameter_mm / (2 * self.radius_px) if self.diameter_mm and self.radius_px else None

    def sphere(self, step: int) -> Sphere:
        """Return its circle in frames of which a pixel is `step` of the photographs' wide."""
        return Sphere(self.kind, (np.array(self.center_px) + 0.5) / step - 0.5, self.radius_px / step)


@dataclass(frozen=True)
class Draft:
    """What was found in a folder.

    Parameters
    ----------
    folder : Path
        Where session.toml is to lie.
    photographs : dict of lists of Path
        By role: flash, ambient, dark, flat, board.
    width, height : int
        Of the photographs, pixels.
    small, step : Frames, int
        The flash frames, reduced: pixels of a photograph in one of theirs, along a side.
    exif : tuple of Exif
        The flash frames'.
    lens : Lens
        What is to be said of the camera; `Lens()`: nothing, EXIF tells it.
    camera, camera_told : Camera or None, str
        Of the photographs, None where it is not known yet; how its focal length is known, for people.
    board : Layout or None
    linear : bool or None
        Of 8-bit files; None: their kind tells.
    balls : tuple of DraftBall
    scan, scan_size, unit : Path or None, ScanSize or None, str
    across_px : float or None
        The object's diagonal in the picture; None where it was not found, or no scan needs it.
    mask, lights, normals : Path or None
    notes : tuple of str
        What was assumed and what was left out as the folder was looked at: a sentence each.
    """

    folder: Path
    photographs: dict[str, list[Path]]
    width: int
    height: int
    small: Frames
    step: int
    exif: tuple[Exif, ...] = ()
    lens: Lens = field(default_factory=Lens)
    camera: Camera | None = None
    camera_told: str = ""
    board: Layout | None = None
    linear: bool | None = None
    balls: tuple[DraftBall, ...] = ()
    scan: Path | None = None
    scan_size: ScanSize | None = None
    unit: Unit = "mm"
    across_px: float | None = None
    mask: Path | None = None
    lights: Path | None = None
    normals: Path | None = None
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def assumed_camera(self) -> Camera:
        """Of the photographs; one as most are where it is not known."""
        return self.camera or usual_camera(self.width, self.height)

    @property
    def small_camera(self) -> Camera:
        """The same of the small frames."""
        return self.assumed_camera.scaled(self.small.width, self.small.height, 1 / self.step, 1 / self.step)

    @property
    def object_mm(self) -> float | None:
        """The object's diagonal in the picture, at the balls' distance; None where no ball tells the scale."""
        scales = [ball.mm_per_px for ball in self.balls if ball.mm_per_px]
        return self.across_px * float(np.median(scales)) if scales and self.across_px else None

    @property
    def likely_unit(self) -> Unit | None:
        """The scan's, by the object's size in the picture; None where that does not tell it."""
        return unit_by_size(self.scan_size.diagonal, self.object_mm) if self.scan_size else None

    @property
    def scan_told(self) -> str:
        """The scan's size, for people."""
        return self.scan_size.told(self.unit) if self.scan_size else ""

    @property
    def unit_told(self) -> str:
        """How the scan's unit is known, for people; empty where only a person says it."""
        return f"the object looks {self.object_mm:.0f} mm large in the picture" if self.likely_unit == self.unit else ""

    def noting(self, *notes: str) -> "Draft":
        """Return the draft with more notes."""
        return replace(self, notes=(*self.notes, *notes))

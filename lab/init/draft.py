"""A capture as it was found: what goes into its session.toml, and what speaks for each part of it."""

from dataclasses import dataclass, field, replace
from pathlib import Path

from capture.session.session_types import Lens
from capture.survey.board_layout import Layout
from lab.init.answers import Unit
from scene.frames import Frames
from scene.spheres import Kind


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
    lens : Lens
        What is to be said of the camera; `Lens()`: nothing, EXIF tells it.
    camera_told : str
        How the focal length is known, for people.
    board : Layout or None
    linear : bool or None
        Of 8-bit files; None: their kind tells.
    balls : tuple of DraftBall
    scan, unit : Path or None, str
    scan_told, unit_told : str
        The scan's size, and how its unit is known, for people.
    mask, lights, normals : Path or None
    notes : tuple of str
        What was assumed, and what was left out: a sentence each.
    """

    folder: Path
    photographs: dict[str, list[Path]]
    width: int
    height: int
    small: Frames
    step: int
    lens: Lens = field(default_factory=Lens)
    camera_told: str = ""
    board: Layout | None = None
    linear: bool | None = None
    balls: tuple[DraftBall, ...] = ()
    scan: Path | None = None
    unit: Unit = "mm"
    scan_told: str = ""
    unit_told: str = ""
    mask: Path | None = None
    lights: Path | None = None
    normals: Path | None = None
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return self.folder.name

    def noting(self, *notes: str) -> "Draft":
        """Return the draft with more notes."""
        return replace(self, notes=(*self.notes, *notes))

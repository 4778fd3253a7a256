"""A session.toml that is not written yet: the document itself, and what was seen of the folder that speaks for it."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from capture.camera.exif import Exif
from capture.camera.focal_length import camera_from_lens
from capture.camera.session_camera import usual_camera
from capture.session.globs import expand
from capture.session.manifest import Manifest, SphereTable
from capture.session.manifest_file import table_of
from capture.session.session_types import Lens
from capture.survey.folder_files import pattern_of
from scene.camera import Camera
from scene.errors import SessionError
from scene.frames import Frames
from scene.length_units import UNITS_MM, Unit
from scene.spheres import KINDS

ROLES = ("flash", "ambient", "dark", "flat")
"""What a photograph may be used for, but for a board's shots."""
FOCAL = ("fx", "focal_mm", "sensor_mm", "pixel_um", "crop_factor", "model")
LIKELY_UNITS: tuple[Unit, ...] = ("mm", "cm", "m", "inch")
FACTOR = 1.5
"""By which the object's size in the picture may differ from the scan's: parts are hidden, or were not scanned."""


class ScanSize(NamedTuple):
    """A scan's extent, in its file's unit."""

    vertices: int
    sides: tuple[float, ...]

    def told(self, unit: Unit) -> str:
        """Return the size in words."""
        sides = " x ".join(f"{UNITS_MM[unit] * side:.4g}" for side in self.sides)
        return f"{self.vertices:,} vertices, {sides} {'of its unit' if unit == 'unknown' else 'mm'}"


@lru_cache(maxsize=16)
def read_scan(path: Path) -> ScanSize:
    """Return how large a scan is, freed of dust; AlignError for one that cannot be read."""
    from align.scan.mended_scan import load_scan

    vertices = load_scan(path, "unknown").vertices
    return ScanSize(len(vertices), tuple(map(float, np.ptp(vertices, axis=0))))


def unit_by_size(diagonal: float, size_mm: float | None) -> Unit | None:
    """Return the unit under which a scan is as large as the object looks; None where none or two are.

    A picture shows two of the scan's three sides, so the scan's diagonal is 1 to 1.2 times the picture's.
    """
    if size_mm is None:
        return None
    off = {unit: abs(float(np.log(UNITS_MM[unit] * diagonal / (1.1 * size_mm)))) for unit in LIKELY_UNITS}
    first, second = sorted(LIKELY_UNITS, key=lambda unit: off[unit])[:2]
    return first if off[first] < np.log(FACTOR) < off[second] else None


@dataclass(frozen=True, eq=False)
class Draft:
    """A session's document before it is written, and what was seen of its folder. Only the document is edited.

    Parameters
    ----------
    manifest : Manifest
        Each ball of the frames with its circle, found or placed; `object.scan_unit` only where a person said it.
    width, height : int
        Of the photographs, pixels.
    small, step : Frames, int
        The flash frames, reduced: pixels of a photograph in one of theirs, along a side.
    exif : tuple of Exif
        The flash frames'.
    found : tuple of SphereTable
        The balls as they were found, in pixels of the full-size photographs.
    across_px : float or None
        The object's diagonal in the picture; None where it was not found, or no scan needs it.
    notes : tuple of str
        What was assumed and what was left out as the folder was looked at: a sentence each.
    """

    manifest: Manifest
    folder: Path
    width: int
    height: int
    small: Frames
    step: int
    exif: tuple[Exif, ...] = ()
    found: tuple[SphereTable, ...] = ()
    across_px: float | None = None
    notes: tuple[str, ...] = ()

    def noting(self, *notes: str) -> "Draft":
        """Return the draft with more notes."""
        return replace(self, notes=(*self.notes, *notes))

    def saying(self, table: str, **keys: Any) -> "Draft":
        """Return the draft with other keys in a table of its manifest; None takes a key away.

        Raises SessionError: a value that session.toml may not have.
        """
        was = getattr(self.manifest, table)
        data = (was.model_dump(exclude_unset=True) if was else {}) | keys
        data = {key: value for key, value in data.items() if value is not None}
        new = table_of(table, data) if data or table in ("frames", "object") else None
        return replace(self, manifest=self.manifest.model_copy(update={table: new}))

    @property
    def balls(self) -> tuple[SphereTable, ...]:
        """The balls that are known, in the frames and shot apart."""
        return tuple(self.manifest.spheres)

    def with_balls(self, balls: "tuple[SphereTable, ...] | list[SphereTable]") -> "Draft":
        """Return the draft with other balls."""
        return replace(self, manifest=self.manifest.model_copy(update={"spheres": list(balls)}))

    def with_photographs(self, photographs: dict[str, list[Path]]) -> "Draft":
        """Return the draft with other uses of the photographs but the board's."""
        globs = {role: pattern_of(some, self.folder) if (some := photographs.get(role)) else None for role in ROLES}
        return self.saying("frames", **globs)

    @cached_property
    def photographs(self) -> dict[str, list[Path]]:
        """The photographs by what they are used for."""
        frames, camera = self.manifest.frames, self.manifest.camera
        globs = {role: getattr(frames, role) for role in ROLES}
        globs["board"] = camera and (camera.charuco or camera.chessboard)
        return {role: expand(patterns, self.folder)[0] for role, patterns in globs.items() if patterns}

    def known_camera(self) -> tuple[Camera | None, str]:
        """Return the photographs' camera, None where it is not known yet, and how its focal length is known.

        Raises SessionError: the lens is known in a part that does not tell the camera.
        """
        table = self.manifest.camera
        if table and table.board:
            kind = "chessboard" if table.chessboard else "ChArUco board"
            across = " x ".join(map(str, table.board.squares))
            return None, f"{len(self.photographs['board'])} shots of a {kind} of {across} squares"
        lens = Lens(**table.model_dump(include=set(FOCAL), exclude_none=True)) if table else Lens()
        camera, told = camera_from_lens(lens, self.exif, self.width, self.height)
        if camera.is_orthographic:
            return None, "not known: no EXIF, no board. It is sought by the balls; or give focal_mm and sensor_mm."
        words = told[0].removeprefix("camera: ").partition(". ")[0] if told else f"focal length {camera.fx:.0f} px"
        return camera, words

    @cached_property
    def _camera(self) -> tuple[Camera | None, str]:
        try:
            return self.known_camera()
        except SessionError as error:
            # One of two numbers is typed before the other.
            return None, f"not known yet: {error}"

    @property
    def assumed_camera(self) -> Camera:
        """The photographs' camera; one as most are where it is not known."""
        return self._camera[0] or usual_camera(self.width, self.height)

    @property
    def camera_told(self) -> str:
        """How the camera is known, for people."""
        return self._camera[1]

    @property
    def scan_size(self) -> ScanSize | None:
        """The scan's size. AlignError: it cannot be read."""
        scan = self.manifest.object.scan
        return read_scan(self.folder / scan) if scan else None

    @property
    def object_mm(self) -> float | None:
        """The object's diagonal in the picture, at the balls' distance; None where no ball tells the scale."""
        balls = self.manifest.spheres
        scales = [ball.diameter_mm / (2 * ball.radius_px) for ball in balls if ball.diameter_mm and ball.radius_px]
        return self.across_px * float(np.median(scales)) if scales and self.across_px else None

    @property
    def likely_unit(self) -> Unit | None:
        """The scan's unit by the object's size in the picture; None where that does not tell it."""
        size = self.scan_size
        return unit_by_size(float(np.linalg.norm(size.sides)), self.object_mm) if size else None

    @property
    def unit(self) -> Unit:
        """The scan's unit: as it was said, else as the picture tells."""
        known = self.manifest.object
        said = known.scan_unit if "scan_unit" in known.model_fields_set else None
        return said or self.likely_unit or "unknown"

    @property
    def scan_told(self) -> str:
        """The scan's size and unit, and how that is known, for people."""
        why = f": the object looks {self.object_mm:.0f} mm large" if self.likely_unit == self.unit else ""
        return f"{self.scan_size.told(self.unit)}; unit {self.unit}{why}" if self.scan_size else ""

    def is_found(self, ball: SphereTable) -> bool:
        """Whether a ball has a circle that was found."""
        return _circle(ball) in map(_circle, self.found)

    @property
    def written(self) -> Manifest:
        """What session.toml is to say: without the circles that are found again, with the scan's unit.

        It says how many balls of a kind are looked for. Where a hand has changed the circles of a kind, detection
        would find one that was given up in place of one that was kept; and of balls of several diameters it is known
        which has which. Then all of that kind have their circles.
        """
        draft = self.saying("object", scan_unit=self.unit) if self.manifest.object.scan else self
        balls, by_hand = self.manifest.spheres, set()
        for kind in KINDS:
            there, found = ([ball for ball in some if ball.kind == kind] for some in (balls, self.found))
            is_as_found = sorted(map(_circle, there)) == sorted(map(_circle, found))
            if not is_as_found or len({ball.diameter_mm for ball in there}) > 1:
                by_hand.add(kind)
        spheres = [_written(ball, ball.kind in by_hand) for ball in balls]
        written = draft.manifest.model_copy(update={"spheres": spheres})
        if not balls and not self.found:
            # An empty list would say that no ball is to be looked for.
            written.model_fields_set.discard("spheres")
        return written


def _circle(ball: SphereTable) -> tuple[float, ...]:
    return (*ball.center_px, ball.radius_px) if ball.center_px and ball.radius_px else ()


def _written(ball: SphereTable, with_circle: bool) -> SphereTable:
    *center, radius = (round(value, 1) for value in _circle(ball)) if with_circle and _circle(ball) else (None,)
    return ball.model_copy(update={"center_px": center or None, "radius_px": radius})

"""The unit of a scan, by the size that the object has in the picture beside balls of known diameter."""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames
from scene.length_units import UNITS_MM, Unit
from scene.spheres import Sphere

CANDIDATES: tuple[Unit, ...] = ("mm", "cm", "m", "inch")
FACTOR = 1.5
"""By which the object's size in the picture may differ from the scan's: parts are hidden, or were not scanned."""


class ScanSize(NamedTuple):
    """A scan's extent, in its file's unit."""

    vertices: int
    sides: tuple[float, ...]

    @property
    def diagonal(self) -> float:
        return float(np.linalg.norm(self.sides))

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


def object_across_px(frames: Frames, camera: Camera, balls: Sequence[Sphere]) -> float | None:
    """Return the object's diagonal in the picture, pixels of the frames; None where it is not found."""
    from align.mask.object_mask import find_object

    try:
        mask = find_object(frames, camera, list(balls)).mask
    except AlignError:
        return None
    rows, columns = np.nonzero(mask)
    return float(np.hypot(np.ptp(rows), np.ptp(columns)))


def unit_by_size(diagonal: float, size_mm: float | None) -> Unit | None:
    """Return the unit under which a scan is as large as the object looks; None where none or two are.

    A picture shows two of the scan's three sides, so the scan's diagonal is 1 to 1.2 times the picture's.
    """
    if size_mm is None:
        return None
    off = {unit: abs(float(np.log(UNITS_MM[unit] * diagonal / (1.1 * size_mm)))) for unit in CANDIDATES}
    first, second = sorted(CANDIDATES, key=lambda unit: off[unit])[:2]
    return first if off[first] < np.log(FACTOR) < off[second] else None

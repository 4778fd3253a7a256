"""Pairs of a pixel and a point of the scan, and the pose that they give: where no pose was found without help."""

from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.files import write_text
from scene.length_units import UNITS_MM
from scene.mesh import Mesh
from studio.own_files import put_own
from studio.review.corrected_session import PICKS
from studio.review.folder import KEPT, Review

if TYPE_CHECKING:
    from scene.rays import RayCaster

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Picks:
    """Pixels and points as they were clicked; the first pixel belongs to the first point.

    pixels: Of the frames.
    points: Of the scan, in millimetres, or in its own unit where that is unknown.
    """

    pixels: tuple[tuple[float, float], ...] = ()
    points: tuple[tuple[float, float, float], ...] = ()

    @property
    def pairs(self) -> int:
        """How many are whole."""
        return min(len(self.pixels), len(self.points))

    def with_pixel(self, pixel: tuple[float, float]) -> "Picks":
        """Return them with one more pixel; it replaces a last one that has no point yet."""
        return replace(self, pixels=(*self.pixels[: len(self.points)], pixel))

    def with_point(self, point: Array) -> "Picks":
        """Return them with one more point; it replaces a last one that has no pixel yet."""
        x, y, z = (float(value) for value in point)
        return replace(self, points=(*self.points[: len(self.pixels)], (x, y, z)))


def met(caster: "RayCaster", origin: Array, direction: Array) -> Array | None:
    """Return the point (3,) at which a ray first meets a mesh, None where it misses."""
    direction = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    hits = caster.cast(np.asarray(origin, np.float64)[None], direction[None])
    return np.asarray(origin) + hits.distance[0] * direction if hits.hit[0] else None


def write_picks(review: Review, picks: Picks) -> Path:
    """Write OUT/review/picks.csv, as `object.picks` is read, and return its path."""
    path, text = review.store.path(KEPT, PICKS), _table(review, picks)
    put_own(review.store.folder, lambda place: write_text(place / KEPT / PICKS, text))
    return path


def _table(review: Review, picks: Picks) -> str:
    from capture.session.requests import hint_scale

    session, camera = review.need("session", "camera")
    scale, unit = hint_scale(session, camera.width), UNITS_MM[session.scan_unit]
    rows = ["u,v,x,y,z"]
    for (u, v), point in list(zip(picks.pixels, picks.points, strict=False))[: picks.pairs]:
        x, y, z = (value / unit for value in point)
        rows.append(f"{(u + 0.5) * scale - 0.5:.3f},{(v + 0.5) * scale - 0.5:.3f},{x:.9g},{y:.9g},{z:.9g}")
    return "\n".join(rows) + "\n"


def pose_of(review: Review, picks: Picks, mesh: Mesh) -> Any:
    """Return `align.pose.picks.Picked`, the pose that the picks give. What was kept stays as it is.

    Raises SceneError: too few picks, on one line, or contradicting each other.
    """
    from align.pose.picks import read_picks
    from capture.session.requests import hint_scale

    (session, camera), text = review.need("session", "camera"), _table(review, picks)
    with TemporaryDirectory() as folder:
        path = Path(folder) / PICKS
        path.write_text(text)
        try:
            return read_picks(path, camera, mesh, unit=session.scan_unit, half=hint_scale(session, camera.width) == 2)
        except SceneError as error:
            raise SceneError(str(error).replace(str(path), "The picks")) from None

"""Balls corrected by hand and points picked on the scan, and the session with them, as the command line reads it.

What is written lies in the output folder; the user's own session.toml is read and never written.
"""

import glob
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from capture.session.manifest import SphereTable
from capture.session.manifest_file import toml_tables
from capture.session.requests import hint_scale
from capture.session.session import load_session
from capture.session.session_types import CaptureSession, SphereSpec
from formats.toml_documents import toml_text
from scene.camera import Camera
from scene.errors import SceneError
from scene.files import write_text
from scene.length_units import UNITS_MM
from scene.spheres import Sphere
from studio.session.ball_edits import Balls, circle_of, outline
from studio.session.folder import HEADLINE, KEPT, OWN, Review, is_kept
from studio.workspace import put_own

if TYPE_CHECKING:
    from scene.rays import RayCaster

Array = NDArray[np.float64]
PICKS = "picks.csv"
"""Beside the session with what was corrected."""
GLOBS = {"flash", "ambient", "dark", "flat", "charuco", "chessboard", "frames"}
FILES = {"mask", "scan", "normals", "picks", "file", "chart"}
"""Keys of a session that name files, by patterns or one each."""


@dataclass(frozen=True)
class Corrections:
    """What a hand has put right: balls, and pixels and points of the scan as they were clicked, which belong in pairs.

    found: The balls as they were found.
    pixels: Of the frames.
    points: Of the scan, in millimetres, or in its own unit where that is unknown.
    """

    found: Balls = ()
    balls: Balls = ()
    pixels: tuple[tuple[float, float], ...] = ()
    points: tuple[tuple[float, float, float], ...] = ()

    @property
    def pairs(self) -> int:
        """How many are whole."""
        return min(len(self.pixels), len(self.points))

    @property
    def wants_point(self) -> bool:
        """Whether the last pixel has no point yet."""
        return len(self.pixels) > len(self.points)

    def with_pixel(self, pixel: tuple[float, float]) -> "Corrections":
        """Return them with one more pixel; it replaces a last one that has no point yet."""
        return replace(self, pixels=(*self.pixels[: len(self.points)], pixel))

    def with_point(self, point: Array) -> "Corrections":
        """Return them with one more point; it replaces a last one that has no pixel yet."""
        x, y, z = (float(value) for value in point)
        return replace(self, points=(*self.points[: len(self.pixels)], (x, y, z)))


def balls_of(review: Review) -> Balls:
    """Return the balls as they were found; where none were, as the session gives them."""
    camera, session, specs = review.material.camera, review.session, _specs(review)
    if review.spheres:
        diameters = [one.diameter_mm if session is None else _stated_mm(specs, one) for one in review.spheres]
        return tuple(
            outline(one.kind, (one.center_px[0], one.center_px[1]), one.radius_px, diameter)
            for one, diameter in zip(review.spheres, diameters, strict=True)
        )
    specs = [spec for spec in specs if not spec.frames]
    if camera is None or session is None:
        # In which pixels circles are given is not known before the photographs are.
        is_placed = any(spec.center_px or spec.mask for spec in specs)
        return () if is_placed else tuple(SphereTable(kind=one.kind, diameter_mm=one.diameter_mm) for one in specs)
    scale, found = hint_scale(session, camera.width), []
    for i, spec in enumerate(specs):
        # Those that the session names without a place wait in the middle of the picture to be put in place.
        place = (camera.width * (i + 0.5) / len(specs), camera.height / 2)
        if spec.center_px is not None:
            place = (spec.center_px[0] + 0.5) / scale - 0.5, (spec.center_px[1] + 0.5) / scale - 0.5
        found.append(outline(spec.kind, place, (spec.radius_px or 0) / scale or camera.width / 20, spec.diameter_mm))
    return tuple(found)


def tables_of(session: CaptureSession, balls: Balls, camera: Camera | None) -> list[dict[str, Any]]:
    """Return `[[spheres]]` tables that say these outlines, in the pixels that the session counts in.

    Balls that were shot apart stay as the session has them. Raises SceneError: its balls cannot be said by circles:
    their lights are given, or a ball has a mask.
    """
    apart, fault = [spec for spec in session.spheres if spec.frames], ""
    if session.lights_file is not None:
        fault = (
            f"lights.file: this session's lights are from {session.lights_file.name}, not from balls. Take the table "
            "[lights] out of session.toml to calibrate with balls."
        )
    elif any(spec.mask for spec in session.spheres):
        fault = (
            "spheres.mask: this session gives its balls by masks. Correct the masks, or replace them by center_px and "
            "radius_px in session.toml."
        )
    elif not balls and not apart:
        fault = "spheres: there is no ball to calibrate with. Add one."
    if fault:
        raise SceneError(fault)
    scale, tables = hint_scale(session, camera.width) if camera else 1.0, []
    for ball in balls:
        if not ball.center_px:
            tables.append(ball)
            continue
        (u, v), radius = circle_of(ball)
        place = {"center_px": [(u + 0.5) * scale - 0.5, (v + 0.5) * scale - 0.5], "radius_px": radius * scale}
        tables.append(ball.model_copy(update=place))
    for spec in apart:
        files = [glob.escape(str(path)) for path in spec.frames]
        tables.append(SphereTable(kind=spec.kind, diameter_mm=spec.diameter_mm, frames=files))
    return [one.model_dump(exclude_none=True) for one in tables]


def _specs(review: Review) -> list[SphereSpec]:
    """Return the balls as the session states them, or as they were kept."""
    if is_kept(review.store):
        with suppress(SceneError):
            return list(load_session(review.store.path(KEPT)).spheres)
    return list(review.session.spheres) if review.session else []


def _stated_mm(specs: list[SphereSpec], sphere: Sphere) -> float | None:
    """Return a found ball's diameter where it is stated; a white ball's may have been guessed."""
    # Calibration leaves a stated diameter as it is.
    stated = [spec.diameter_mm for spec in specs if spec.kind == sphere.kind and spec.diameter_mm]
    found = sphere.diameter_mm
    return found if found and any(abs(one - found) < 1e-6 * one for one in stated) else None


def write_amended(
    review: Review, *, spheres: list[dict[str, Any]] | None = None, picks: Corrections | None = None
) -> Path:
    """Write OUT/review/session.toml, and return its folder: a session for `rgbn process OUT/review --out OUT`.

    spheres: Instead of the session's `[[spheres]]`; picks: for `object.picks`, beside it. None: those of an earlier
    correction, else the session's. Its relative paths are written out in full. Raises SceneError: there is none to
    correct, or a file that is not the studio's is in the way.
    """
    path, source = review.store.path(KEPT, "session.toml"), _source(review)
    before = toml_tables(path) if path.exists() and path != source else {}
    data = _in_full(toml_tables(source), source.parent)
    if review.session is not None:
        data["name"] = review.session.name
    if spheres is not None:
        data["spheres"] = spheres
    elif "spheres" in before:
        data["spheres"] = before["spheres"]
    rows = None if picks is None else _table(review, picks)
    marked = before.get("object", {}).get("picks") if rows is None else str(path.with_name(PICKS).resolve())
    if marked is not None:
        data["object"] = {**data.get("object", {}), "picks": marked}
    own = [] if path == source else [f"{OWN}{review.session_path}"]
    text = "\n".join([HEADLINE, *own, toml_text(data)])

    def write(place: Path) -> None:
        write_text(place / KEPT / path.name, text)
        if rows is not None:
            write_text(place / KEPT / PICKS, rows)

    put_own(review.store.folder, write)
    return path.parent


def _source(review: Review) -> Path:
    (session,), path = review.need("session"), review.session_path
    if session.layout != "toml":
        raise SceneError(
            f"{session.folder}: is in the DiLiGenT layout, which has no place for balls or picks. Write a "
            "session.toml to correct it."
        )
    assert path is not None
    return path if path.is_file() else path / "session.toml"


def _in_full(value: Any, folder: Path, key: str = "") -> Any:
    """Return a manifest, or the value of a key of it, with its paths absolute."""
    if isinstance(value, dict):
        return {name: _in_full(part, folder, name) for name, part in value.items()}
    if key in GLOBS:
        # Signs in the folder's own name are no wildcards.
        root = Path(glob.escape(str(folder.resolve())))
        return [str(root / pattern) for pattern in ([value] if isinstance(value, str) else value)]
    if key in FILES:
        return str(folder.resolve() / value)
    return [_in_full(part, folder) for part in value] if isinstance(value, list) else value


def _table(review: Review, picks: Corrections) -> str:
    """Return picks as `object.picks` is read."""
    session, camera = review.need("session", "camera")
    scale, unit = hint_scale(session, camera.width), UNITS_MM[session.scan_unit]
    rows = ["u,v,x,y,z"]
    for (u, v), point in list(zip(picks.pixels, picks.points, strict=False))[: picks.pairs]:
        x, y, z = (value / unit for value in point)
        rows.append(f"{(u + 0.5) * scale - 0.5:.3f},{(v + 0.5) * scale - 0.5:.3f},{x:.9g},{y:.9g},{z:.9g}")
    return "\n".join(rows) + "\n"


def met(caster: "RayCaster", origin: Array, direction: Array) -> Array | None:
    """Return the point (3,) at which a ray first meets a mesh, None where it misses."""
    direction = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    hits = caster.cast(np.asarray(origin, np.float64)[None], direction[None])
    return np.asarray(origin) + hits.distance[0] * direction if hits.hit[0] else None

"""A start by hand: points of the scan, the pixels that show them, and the pose of both (perspective-n-point)."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from formats.meshes.scan_files import LARGEST
from scene.camera import FROM_OPENCV, Camera
from scene.errors import AlignError
from scene.length_units import UNITS_MM
from scene.mesh import Mesh
from scene.pose import Pose, rotation_from_vector
from scene.rays import RayCaster
from scene.reading import reading, text_of

Array = NDArray[np.float64]

COLUMNS = ("u", "v", "x", "y", "z")
FEWEST = 4
FAR_FROM_SURFACE = 0.03
"""Of the scan's radius: a pick that lies further from its surface was not made on it."""
STRAIGHT = 0.05
"""Picks whose second principal extent is a smaller share of their first lie on one line."""


@dataclass(frozen=True)
class Picked:
    """The pose that picks give."""

    pose: Pose
    """camera_from_scan, mm: a start for the refinement, no more."""
    residual_px: float
    """Rms distance between pixels and projected points, of the picks that agree."""
    warnings: tuple[str, ...] = ()
    """Picks that were left out, by their rows."""


def read_picks(path: Path, camera: Camera, mesh: Mesh, *, unit: str = "mm", half: bool = False) -> Picked:
    """Read a table of picks, and find the pose at which they fit.

    Parameters
    ----------
    path : Path
        CSV with a header row naming the columns u, v (pixels of the photographs, 0-based, integers are pixel
        centres) and x, y, z (the same point on the scan, in the scan's own unit). Four rows or more; from six
        on, one wrong row is found and left out.
    camera : Camera
    mesh : Mesh
        The scan, mm.
    unit : {"m", "cm", "mm", "inch", "unknown"}
        Of x, y, z.
    half : bool
        The pixels count those of photographs twice as large as the camera's.

    Raises
    ------
    AlignError
        Unreadable, too few, outside the picture, off the scan's surface, on one line, or contradicting each other.
    """
    rows, table = _read(Path(path))
    pixels, points = table[:, :2], table[:, 2:] * UNITS_MM[unit]
    if half:
        pixels = (pixels + 0.5) / 2 - 0.5
    _check(path, rows, pixels, points, camera, mesh, unit)
    # Hand and eye are good to some pixels; a wrong correspondence is off by far more.
    tolerance_px = max(5.0, 0.005 * float(np.hypot(camera.width, camera.height)))
    everyone = np.ones(len(rows), bool)

    def fitted(agree: NDArray[np.bool_]) -> tuple[float, Pose | None, Array, NDArray[np.bool_]]:
        pose = pose_of(camera, points[agree], pixels[agree], mesh.radius_mm, mesh.center_mm)
        misses = np.full(len(rows), np.inf) if pose is None else misses_px(pose, camera, points, pixels)
        return float(misses[agree].max()), pose, misses, agree

    fits = [fitted(everyone)]
    # A wrong pick draws the pose to itself: each is left out in turn. Any four points fit some pose fairly; it takes a
    # fifth to say that they are right.
    if fits[0][0] > tolerance_px and len(rows) > FEWEST + 1:
        fits += [fitted(rest) for rest in ~np.eye(len(rows), dtype=bool)]
    apart, pose, misses, agree = min(fits, key=lambda fit: fit[0])
    if pose is None:
        raise AlignError(f"{path}: no pose puts these {len(rows)} points at their pixels. Pick again.")
    if apart > tolerance_px:
        worst = int(np.argmax(misses))
        raise AlignError(
            f"{path}: the picks contradict each other: at the best pose {(misses > tolerance_px).sum()} of {len(rows)} "
            f"lie farther than {tolerance_px:.0f} px from their pixels, row {rows[worst]} by {misses[worst]:.0f} px. "
            "Are u, v counted from the upper left, x, y, z in the scan's own axes, and is the scan not mirrored? Of "
            "six picks or more a single wrong one is found."
        )
    warnings = tuple(
        f"{Path(path).name}: row {rows[index]} was left out: its point lies {misses[index]:.0f} px from its pixel "
        f"({pixels[index, 0]:.0f}, {pixels[index, 1]:.0f}) where the other {agree.sum()} agree within "
        f"{misses[agree].max():.1f} px."
        for index in np.flatnonzero(~agree)
    )
    return Picked(pose, float(np.sqrt(np.mean(misses[agree] ** 2))), warnings)


def _read(path: Path) -> tuple[list[int], Array]:
    """Return the rows' line numbers, and u, v, x, y, z (K, 5)."""
    picks, do = "the picks cannot be read", "Give a CSV file in UTF-8."
    text = text_of(path, picks, AlignError, do=do)
    with reading(path, picks, AlignError, do=do):
        reader = csv.DictReader(text.splitlines(), skipinitialspace=True)
        found = [name.strip() for name in reader.fieldnames or []]
        if not set(COLUMNS) <= set(found):
            raise AlignError(
                f"{path}: the first row names {', '.join(found) or 'nothing'}; expected the columns "
                f"{', '.join(COLUMNS)}, with commas between them."
            )
        reader.fieldnames = found
        rows, table = [], []
        for row in reader:
            values = [row[name] for name in COLUMNS]
            try:
                numbers = [float(value) for value in values]
            except (TypeError, ValueError):
                numbers = [np.nan]
            if not (np.abs(numbers) < LARGEST).all():
                raise AlignError(
                    f"{path}: row {reader.line_num} holds {values}; expected five numbers, {', '.join(COLUMNS)}."
                )
            rows.append(reader.line_num)
            table.append(numbers)
    if len(rows) < FEWEST:
        raise AlignError(f"{path}: {len(rows)} picks are too few for a pose; expected {FEWEST}, better 6 or more.")
    return rows, np.array(table)


def _check(path: Path, rows: list[int], pixels: Array, points: Array, camera: Camera, mesh: Mesh, unit: str) -> None:
    """Raise on what no pose can mend."""
    limit = np.array([camera.width, camera.height]) - 0.5
    for row, pixel in zip(rows, pixels, strict=True):
        if (pixel < -0.5).any() or (pixel > limit).any():
            raise AlignError(
                f"{path}: row {row} has its pixel at {pixel[0]:.1f}, {pixel[1]:.1f}, outside the picture of "
                f"{camera.width} x {camera.height} px."
            )
    away = RayCaster(mesh).distance(points)
    far = FAR_FROM_SURFACE * mesh.radius_mm
    if (away > far).any():
        worst = int(np.argmax(away))
        name = "units" if unit == "unknown" else unit
        off, bound, size = (value / UNITS_MM[unit] for value in (away[worst], far, 2 * mesh.radius_mm))
        raise AlignError(
            f"{path}: the point of row {rows[worst]} lies {off:.4g} {name} from the scan's surface, "
            f"{(away > far).sum()} of {len(rows)} further than {bound:.2g} {name} (the scan is {size:.4g} {name} "
            "across). Give x, y, z in the scan's own unit and axes."
        )
    for what, values in (("points", points), ("pixels", pixels)):
        extent = np.linalg.svd(values - values.mean(0), compute_uv=False)
        if extent[1] < STRAIGHT * max(extent[0], 1e-12):
            raise AlignError(
                f"{path}: the {what} lie on one line, about which the scan could still turn. Add picks beside it."
            )
        if what == "points" and camera.is_orthographic and extent[2] < STRAIGHT * extent[0]:
            raise AlignError(
                f"{path}: the points lie in one plane; an orthographic camera does not tell its tilt from the "
                "opposite one. Add a pick in front of that plane, or behind."
            )


def pose_of(camera: Camera, points: Array, pixels: Array, radius_mm: float, center_mm: Array) -> Pose | None:
    """Return the pose that puts points at their pixels, by least squares; None where there is none.

    `points` (K, 3), scan frame, mm, four or more; `pixels` (K, 2), whose distortion is undone first; radius and middle
    (3,) are the scan's. An orthographic camera does not tell depth: the scan is put just behind the plane z = 0.

    Perspective: SQPnP [Terzakis2020]. Orthographic: the linear least-squares map from points to the image plane,
    of which the nearest pair of orthonormal rows is taken (polar decomposition); on a shallow relief its errors are
    large, so the turn of least squares is found from there.
    """
    origins, directions = camera.rays(pixels)
    if camera.is_orthographic:
        return _orthographic(origins[:, :2], points, radius_mm, center_mm)
    import cv2

    image = np.stack([directions[:, 0], -directions[:, 1]], -1) / -directions[:, 2:]
    try:
        done, turn, shift = cv2.solvePnP(points, image, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    except cv2.error:
        return None
    if not done:
        return None
    rotation = FROM_OPENCV @ cv2.Rodrigues(turn)[0]
    pose = Pose.from_rotation_translation(rotation, FROM_OPENCV @ shift[:, 0])
    return pose if np.isfinite(pose.matrix).all() else None


def _orthographic(image_mm: Array, points: Array, radius_mm: float, center_mm: Array) -> Pose | None:
    from scipy.optimize import least_squares

    middle, middle_mm = points.mean(0), image_mm.mean(0)
    away, seen = points - middle, image_mm - middle_mm
    rows = np.linalg.lstsq(away, seen, rcond=1e-6)[0].T
    u, singular, v = np.linalg.svd(rows, full_matrices=False)
    if singular[1] < 1e-6:
        return None
    rows = u @ v
    start = np.vstack([rows, np.cross(rows[0], rows[1])])

    def misses(turn: Array) -> Array:
        return (away @ (rotation_from_vector(turn) @ start)[:2].T - seen).ravel()

    rotation = rotation_from_vector(least_squares(misses, np.zeros(3), method="lm").x) @ start
    shift = np.append(middle_mm - rotation[:2] @ middle, -1.5 * radius_mm - rotation[2] @ center_mm)
    return Pose.from_rotation_translation(rotation, shift)


def misses_px(pose: Pose, camera: Camera, points: Array, pixels: Array) -> Array:
    """Return (K,), px, how far points land from their pixels; inf behind the camera."""
    miss = np.linalg.norm(camera.project(pose.apply(points)) - pixels, axis=1)
    return np.where(np.isfinite(miss), miss, np.inf)

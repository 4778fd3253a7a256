"""Ground-truth normals: the registered scan, seen through the camera, and how sure each normal is; or a file's.

Files that are already registered are those of DiLiGenT and its relatives.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import nudge
from align.pose.scan_view import View
from align.scan.smooth_normals import smooth_normals
from formats.normal_maps import read_normal_map
from scene.camera import Camera
from scene.errors import AlignError, SceneError
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.rays import Hits, RayCaster

Array = NDArray[np.float64]

GRAZING_DEG = 80.0
"""Beyond this angle between normal and view a pixel covers six times its width of surface, and more."""
EDGE_FOOTPRINTS = 2.0
"""Neighbours whose depths miss each other's tangent plane by more pixel widths than this lie across a depth edge."""
SPREAD_DEG = 60.0
"""Corner normals of one face that differ by more lie across a crease finer than the scan."""
BAND_PIXELS = 1 << 19


@dataclass(frozen=True)
class Truth:
    """What the scan says of each pixel."""

    normals: NDArray[np.float32]
    """(H, W, 3). Unit, camera frame; NaN where unknown: off the scan, at depth edges and holes, at grazing angles, on
    back faces, across creases finer than the scan."""
    depth_mm: NDArray[np.float32]
    """(H, W) -z of the point, NaN off the scan."""
    sigma_deg: NDArray[np.float32]
    """(H, W): expected (rms) angle between `normals` and the real normal: pose, scan noise, smoothing, and what lies
    between the scan's vertices; NaN where normals are."""
    mask: NDArray[np.bool_]
    """(H, W): the scan's silhouette, with the pixels whose normal is unknown."""


def ground_truth(
    mesh: Mesh,
    pose: Pose,
    camera: Camera,
    *,
    covariance: NDArray | None = None,
    at_vertices: tuple[Array, Array] | None = None,
) -> Truth:
    """Cast a ray through every pixel's centre and read the scan's normals.

    Parameters
    ----------
    mesh : Mesh
        The scan, mm.
    pose : Pose
        camera_from_scan.
    camera : Camera
        Perspective or orthographic; distortion is honoured.
    covariance : (6, 6) float, optional
        Of the pose, as in `Registration.covariance`; without it, sigma is the scan's part, and the focal length's.
    at_vertices : ((V, 3), (V,)), optional
        What `smooth_normals(mesh)` returned; computed here when absent.

    Returns
    -------
    truth : Truth

    Notes
    -----
    The pose's part of sigma is what the normal at the pixel changes by when the pose moves one sigma along each
    axis of its covariance (so curvature counts, and the ray's new hit with it). Over one sigma of a focal length that
    is not known, pose and camera change together: an object farther away through a lens longer by as much looks the
    same but for its perspective. The scan's part is that of `smooth_normals`.
    """
    corners, scatter = smooth_normals(mesh) if at_vertices is None else at_vertices
    caster, square = RayCaster(mesh, corners), scatter[:, None] ** 2
    view = View(caster, camera, pose)
    height, width = camera.height, camera.width
    found = np.full((height, width, 3), np.nan, np.float32)
    depth = np.full((height, width), np.nan, np.float32)
    sigma = np.full((height, width), np.nan, np.float32)
    top, bottom = _rows(view)
    step = max(1, BAND_PIXELS // width)
    for first in range(top, bottom, step):
        last = min(first + step, bottom)
        # One row more on each side: its depth decides about edges.
        rows = slice(max(first - 1, 0), min(last + 1, height))
        inner = slice(first - rows.start, last - rows.start)
        pixels = camera.grid(rows)
        shape = pixels.shape[:2]
        hits = view.hits(pixels.reshape(-1, 2))
        if not hits.hit.any():
            continue
        origins, directions = camera.rays(pixels)
        points = origins + directions * np.where(hits.hit, hits.distance, np.nan).reshape(*shape, 1)
        smooth = view.normals(hits).reshape(*shape, 3)
        good = _reliable(view, hits, points, smooth, directions)[inner]
        depth[first:last] = -points[inner, :, 2]
        v, u = np.nonzero(good)
        if not len(v):
            continue
        here, middle = pixels[inner][v, u], smooth[inner][v, u]
        variance = hits.interpolate(mesh, square).reshape(shape)[inner][v, u]
        if covariance is not None:
            variance = variance + _pose_variance(view, here, middle, covariance)
        if camera.focal_sigma and not camera.is_orthographic:
            variance = variance + _turned(_longer(view), here, middle)
        found[first + v, u] = middle
        sigma[first + v, u] = np.sqrt(variance)
    return Truth(found, depth, sigma, np.isfinite(depth))


def _rows(view: View) -> tuple[int, int]:
    """Return the range of rows that can see the mesh: of all its vertices, where `View.box` takes some."""
    v = view.camera.project(view.pose.apply(view.caster.mesh.vertices))[:, 1]
    if np.isnan(v).any():
        return 0, view.camera.height
    return max(int(v.min()) - 2, 0), min(int(v.max()) + 3, view.camera.height)


def _reliable(view: View, hits: Hits, points: Array, normals: Array, directions: Array) -> NDArray[np.bool_]:
    """Return (h, w): the pixel sees one piece of well-sampled surface, from its front."""
    shape, mesh = points.shape[:2], view.caster.mesh
    face = np.maximum(hits.face, 0)
    facing = -np.einsum("hwk,hwk->hw", normals, directions)
    front = -np.einsum("hwk,hwk->hw", view.pose.rotate(mesh.face_normals[face]).reshape(*shape, 3), directions)
    good = hits.hit.reshape(shape) & (facing > np.cos(np.radians(GRAZING_DEG))) & (front > 0)
    corners = view.caster.normals[mesh.faces[face]]
    closest = np.minimum.reduce([np.einsum("pk,pk->p", corners[:, i], corners[:, i - 1]) for i in range(3)])
    good &= closest.reshape(shape) > np.cos(np.radians(SPREAD_DEG))
    depth = np.ones(shape) if view.camera.is_orthographic else -points[..., 2]
    footprint = depth / view.camera.fx
    for a, b in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        across = points[b] - points[a]
        miss = np.minimum(*(np.abs(np.einsum("hwk,hwk->hw", across, normals[side])) for side in (a, b)))
        # A neighbour off the scan gives NaN, and is an edge: silhouette or hole.
        edge = ~(miss < EDGE_FOOTPRINTS * footprint[a])
        good[a] &= ~edge
        good[b] &= ~edge
    return good


def _pose_variance(view: View, pixels: NDArray, normals: Array, covariance: NDArray) -> Array:
    """Return (P,), degrees squared: the normals' change over one sigma of each axis of the pose's covariance."""
    # The axes are found in lengths (radians times the scan's radius): radians and millimetres do not mix.
    length = np.array([view.caster.mesh.radius_mm] * 3 + [1.0] * 3)
    values, axes = np.linalg.eigh(covariance * length * length[:, None])
    total = np.zeros(len(pixels))
    for value, axis in zip(values, axes.T, strict=True):
        if value > 0:
            moved = nudge(view.pose, axis * np.sqrt(value) / length, view.pivot)
            total += _turned(replace(view, pose=moved), pixels, normals)
    return total


def _longer(view: View) -> View:
    """Return the view through a lens one sigma longer, of the scan as much farther away."""
    ratio = 1 + view.camera.focal_sigma
    camera = replace(view.camera, fx=view.camera.fx * ratio, fy=view.camera.fy * ratio)
    return View(view.caster, camera, nudge(view.pose, [0, 0, 0, 0, 0, (ratio - 1) * view.pivot[2]], view.pivot))


def _turned(view: View, pixels: NDArray, normals: Array) -> Array:
    """Return (P,), degrees squared: by how much the normals of another view differ."""
    return np.nan_to_num(angular_error_deg(view.normals(view.hits(pixels)), normals) ** 2)


def read_normals(path: Path, height: int, width: int) -> NDArray[np.float32]:
    """Read a normal map that lies on the frames' pixels.

    .mat (`Normal_gt` or the only H x W x 3 array; MATLAB 5 to 7.3), .txt (H * W rows of 3, row by row), .npy (H, W, 3),
    or .png of 8 or 16 bits, RGB = (n + 1) / 2. Return (H, W, 3): unit, camera frame (x right, y up, z toward the
    viewer), NaN where the file has none.

    Raises
    ------
    AlignError
        The file cannot be read, has another size, no unit vectors, or looks away from the camera.
    """
    path = Path(path)
    if not path.is_file():
        raise AlignError(f"{path}: there is no such file. Check normals under [object] in session.toml.")
    try:
        values = read_normal_map(path, height, width)
    except SceneError as error:
        raise AlignError(str(error)) from error
    is_coded = path.suffix.lower() == ".png"
    # The most by which a length may differ from 1.
    tolerance = 0.1 if is_coded else 0.05
    length = np.linalg.norm(values.astype(np.float64), axis=-1)
    known = np.isfinite(length) & (length > 0.1)
    if not known.any():
        raise AlignError(f"{path}: no pixel has a normal (all are zero or no numbers).")
    off = np.abs(length[known] - 1) > tolerance
    if off.mean() > 0.02:
        raise AlignError(
            f"{path}: {100 * off.mean():.0f} % of the vectors are not of length 1 (median length "
            f"{np.median(length[known]):.3f}). Store unit vectors"
            f"{', coded as (n + 1) / 2' if is_coded else ''}."
        )
    behind = values[known][:, 2] < 0
    if behind.mean() > 0.1:
        raise AlignError(
            f"{path}: {100 * behind.mean():.0f} % of the normals have z < 0 and look away from the camera; expected "
            "x right, y up, z toward the viewer. Normals in OpenCV's frame: flip the signs of y and z."
        )
    # A few vectors of a wrong length (interpolation at the border) are unknown, not errors of the whole map.
    known &= np.abs(length - 1) <= tolerance
    normals = np.full(values.shape, np.nan, np.float32)
    normals[known] = values[known] / length[known][:, None]
    return normals

"""The law of the mirror on an exact sphere."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
USUAL_FOCAL = 1.4  # widths of the picture that an unknown camera is taken to have: 50 mm on 36 mm
PARALLEL = 1e7  # condition from which on rays do not meet
TURNS, RESTS = 60, 1e-12
"""Of the iteration to where a ball mirrors a light: each brings it nearer by the ball's radius over its distance."""


def toward_camera(camera: Camera, points: Array) -> Array:
    """Return the unit vectors (..., 3) from points to the camera, NaN where they are."""
    if camera.is_orthographic:
        return np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    return -points / np.linalg.norm(points, axis=-1, keepdims=True)


def mirrored_at(camera: Camera, sphere: Sphere, toward: Callable[[Array], Array]) -> Array:
    """Return the pixels (N, 2) at which a mirror ball shows N lights.

    `toward` gives the unit vectors (N, 3) from points (N, 3), mm, to the lights.

    Notes
    -----
    The normal halves the angle between view and light: n = unit(v + l), x = c + R n, again from there until it rests.
    """
    center, radius = sphere.center_mm(camera), sphere.radius_mm
    normals = np.array([[0.0, 0.0, 1.0]])
    for _ in range(TURNS):
        points = center + radius * normals
        normals, before = unit(toward_camera(camera, points) + toward(points)), normals
        if np.abs(normals - before).max() < RESTS:
            break
    if camera.is_orthographic:
        return sphere.center_px + sphere.radius_px * normals[:, :2] * [1.0, -1.0]
    return camera.project(center + radius * normals)


def mirrored_rays(camera: Camera, sphere: Sphere, pixels: NDArray) -> tuple[Array, Array]:
    """Return where the rays of pixels (..., 2) meet a mirror ball, and where they go from there.

    Points (..., 3) in mm, or in radii where the diameter is unknown, and unit vectors (..., 3) toward what is mirrored;
    NaN where the ray misses.

    Notes
    -----
    l = 2 (n . v) n - v with v toward the camera along the pixel's own ray. With v = (0, 0, 1) in a
    perspective picture the error is twice the angle off axis.
    """
    normals, points = sphere.normals(camera, pixels)
    view = toward_camera(camera, points)
    return points, 2 * np.sum(normals * view, -1, keepdims=True) * normals - view


def ray_meeting(points: Array, directions: Array) -> Array:
    """Return the point (3,) nearest to rays (K, 3), (K, 3) in the least-squares sense; NaN if they are parallel."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    normal = across.sum(0)
    if np.linalg.cond(normal) > PARALLEL:
        return np.full(3, np.nan)
    return np.linalg.solve(normal, np.einsum("kij,kj->i", across, points))


def mean_directions(directions: Array) -> Array:
    """Return (F, 3) unit mean over balls of (S, F, 3), NaN balls left out; NaN where no ball saw the flash."""
    seen = np.isfinite(np.asarray(directions)[..., :1])
    total = np.where(seen, directions, 0).sum(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(seen.any(0), total / np.linalg.norm(total, axis=1, keepdims=True), np.nan)


def two_across(directions: Array) -> tuple[Array, Array]:
    """Return two unit vectors (..., 3) across each unit direction (..., 3) and each other."""
    helper = np.where(np.abs(directions[..., :1]) < 0.7, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    side = unit(np.cross(directions, helper))
    return side, np.cross(directions, side)


def unknown_view_deg(camera: Camera, spheres: list[Sphere]) -> float:
    """Return by how much all directions may turn because nothing is known of the camera, degrees, one axis.

    An orthographic camera sees every ball from straight ahead. From beside the axis, at a usual focal length, its
    directions are off by about as much as the ball lies off it; balls on opposite sides cancel each other's error.
    0 for any camera of which something is known.
    """
    if not camera.is_orthographic or camera.source != "assumed":
        return 0.0
    offset = np.mean([sphere.center_px for sphere in spheres], axis=0) - [camera.cx, camera.cy]
    return float(np.rad2deg(np.arctan(np.hypot(*offset) / (USUAL_FOCAL * camera.width))) / np.sqrt(2))

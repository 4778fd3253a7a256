"""Small motions of a pose and what they do in the image; even samples of all directions."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.camera import Camera
from scene.light_layouts import GOLDEN_ANGLE, directions_of
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose

Array = NDArray[np.float64]


def nudge(pose: Pose, twist: ArrayLike, pivot: ArrayLike) -> Pose:
    """Return `pose` (camera_from_scan) after a small motion in the camera frame.

    `twist` (6,): rotation vector (radians) about `pivot`, then translation (mm), camera axes. `pivot` (3,), mm: about
    the object's own middle, rotation and translation stay nearly independent; about the camera's centre a rotation of
    an object one metre away is mostly a translation.
    """
    turn = Pose.exp(np.concatenate([np.asarray(twist, np.float64)[:3], np.zeros(3)]))
    pivot = np.asarray(pivot, np.float64)
    shift = pivot + np.asarray(twist, np.float64)[3:] - turn.rotate(pivot)
    return Pose.from_rotation_translation(turn.rotation, shift) @ pose


def small_steps(mesh: Mesh, camera: Camera, pose: Pose, *, step_px: float) -> Array:
    """Return (6,) twists (radians, mm) that each move the scan's image by about `step_px`; 0 where nothing moves."""
    depth = 1.0 if camera.is_orthographic else -float(pose.apply(mesh.center_mm)[2])
    side = step_px * depth / camera.fx
    along = 0.0 if camera.is_orthographic else side * depth / mesh.radius_mm
    return np.array([side / mesh.radius_mm] * 3 + [side, side, along])


def image_flow(camera: Camera, points: NDArray, pivot: NDArray) -> Array:
    """Return d(pixel)/d(twist) (P, 2, 6) of points (P, 3), camera frame, for `nudge` about `pivot`."""
    step_mm = 1e-4 * max(1.0, float(np.nanmax(np.abs(points[:, 2]), initial=0.0)))
    flow = np.stack(
        [(camera.project(points + step_mm * axis) - camera.project(points - step_mm * axis)) for axis in np.eye(3)], -1
    ) / (2 * step_mm)
    # d(point)/d(twist): omega x arm = -[arm]x omega, then the shift.
    jacobian = np.concatenate([-cross_matrices(points - pivot), np.broadcast_to(np.eye(3), (len(points), 3, 3))], -1)
    return flow @ jacobian


def cross_matrices(vectors: NDArray) -> Array:
    """Return (P, 3, 3) matrices [v]x of vectors (P, 3): [v]x w = v x w."""
    return np.cross(vectors[:, None], np.eye(3)).transpose(0, 2, 1)


def apart_px(mesh: Mesh, camera: Camera, a: Pose, b: Pose) -> float:
    """Return the rms distance, in pixels, between the images of the scan at two poses."""
    points = mesh.vertices[:: max(1, len(mesh.vertices) // 500)]
    apart = np.linalg.norm(a.apply(points) - b.apply(points), axis=1)
    scale = 1.0 if camera.is_orthographic else max(-float(a.apply(mesh.center_mm)[2]), 1e-9)
    return float(np.sqrt(np.mean(apart**2)) * camera.fx / scale)


def distinct(mesh: Mesh, camera: Camera, poses: Sequence[Pose], *, least_px: float) -> list[int]:
    """Return the numbers of the poses that move the scan's image by more than so much from every earlier one kept."""
    kept: list[int] = []
    for number, pose in enumerate(poses):
        if all(apart_px(mesh, camera, pose, poses[other]) > least_px for other in kept):
            kept.append(number)
    return kept


def even_directions(count: int) -> Array:
    """Return (count, 3) unit vectors, evenly over the sphere (Fibonacci's spiral)."""
    index = np.arange(count) + 0.5
    return directions_of(1 - 2 * index / count, GOLDEN_ANGLE * index)


def looking_along(directions: NDArray) -> Array:
    """Return rotations (..., 3, 3) that turn each unit direction (..., 3) to +z; the turn about z is arbitrary."""
    z = np.asarray(directions, np.float64)
    helper = np.where(np.abs(z[..., 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    x = unit(np.cross(helper, z))
    return np.stack([x, np.cross(z, x), z], -2)

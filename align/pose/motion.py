"""Small motions of a pose, and even samples of all directions."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.pose import Pose

Array = NDArray[np.float64]


def nudge(pose: Pose, twist: ArrayLike, pivot: ArrayLike) -> Pose:
    """Return `pose` after a small motion in the camera frame.

    Parameters
    ----------
    pose : Pose
        camera_from_scan.
    twist : (6,) float
        Rotation vector (radians) about `pivot`, then translation (mm), camera axes.
    pivot : (3,) float
        Camera frame, mm. About the object's own middle, rotation and translation stay nearly independent;
        about the camera's centre a rotation of an object one metre away is mostly a translation.
    """
    turn = Pose.exp(np.concatenate([np.asarray(twist, np.float64)[:3], np.zeros(3)]))
    pivot = np.asarray(pivot, np.float64)
    shift = pivot + np.asarray(twist, np.float64)[3:] - turn.rotate(pivot)
    return Pose.from_rotation_translation(turn.rotation, shift) @ pose


def point_jacobian(points: NDArray, pivot: NDArray) -> Array:
    """Return d(point)/d(twist) (P, 3, 6) of points (P, 3), camera frame, for `nudge`."""
    arm = points - pivot
    jacobian = np.zeros((len(points), 3, 6))
    # omega x arm = -[arm]x omega
    jacobian[:, 0, 1], jacobian[:, 0, 2] = arm[:, 2], -arm[:, 1]
    jacobian[:, 1, 0], jacobian[:, 1, 2] = -arm[:, 2], arm[:, 0]
    jacobian[:, 2, 0], jacobian[:, 2, 1] = arm[:, 1], -arm[:, 0]
    jacobian[:, :, 3:] = np.eye(3)
    return jacobian


def even_directions(count: int) -> Array:
    """Return (count, 3) unit vectors, evenly over the sphere (Fibonacci's spiral)."""
    index = np.arange(count) + 0.5
    z = 1 - 2 * index / count
    angle = index * (np.pi * (3 - math.sqrt(5)))
    ring = np.sqrt(np.maximum(1 - z * z, 0.0))
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], -1)


def looking_along(directions: NDArray) -> Array:
    """Return rotations (..., 3, 3) that turn each unit direction (..., 3) to +z; the turn about z is arbitrary."""
    z = np.asarray(directions, np.float64)
    helper = np.where(np.abs(z[..., 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    x: Array = np.cross(helper, z)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], -2)


def apart_px(mesh: Mesh, camera: Camera, a: Pose, b: Pose) -> float:
    """Return the rms distance, in pixels, between the images of the scan at two poses."""
    points = mesh.vertices[:: max(1, len(mesh.vertices) // 500)]
    apart = np.linalg.norm(a.apply(points) - b.apply(points), axis=1)
    scale = 1.0 if camera.is_orthographic else max(-float(a.apply(mesh.center_mm)[2]), 1e-9)
    return float(np.sqrt(np.mean(apart**2)) * camera.fx / scale)

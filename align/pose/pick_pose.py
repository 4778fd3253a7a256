"""The pose of a few points whose pixels are known (perspective-n-point), under either projection."""

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import nudge
from scene.camera import FROM_OPENCV, Camera
from scene.pose import Pose

Array = NDArray[np.float64]


def pose_of(camera: Camera, points: Array, pixels: Array, radius_mm: float, center_mm: Array) -> Pose | None:
    """Return the pose that puts points at their pixels, by a closed form; None where there is none.

    `points` (K, 3), scan frame, mm, four or more; `pixels` (K, 2), whose distortion is undone first; radius and middle
    (3,) are the scan's. An orthographic camera does not tell depth: the scan is put just behind the plane z = 0.

    Perspective: SQPnP [Terzakis2020]. Orthographic: the linear least-squares map from points to the image plane,
    of which the nearest pair of orthonormal rows is taken (polar decomposition).
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
    middle, middle_mm = points.mean(0), image_mm.mean(0)
    rows = np.linalg.lstsq(points - middle, image_mm - middle_mm, rcond=1e-6)[0].T
    u, singular, v = np.linalg.svd(rows, full_matrices=False)
    if singular[1] < 1e-6:
        return None
    rotation = u @ v
    rotation = np.vstack([rotation, np.cross(rotation[0], rotation[1])])
    shift = np.append(middle_mm - rotation[:2] @ middle, -1.5 * radius_mm - rotation[2] @ center_mm)
    return Pose.from_rotation_translation(rotation, shift)


def misses_px(pose: Pose, camera: Camera, points: Array, pixels: Array) -> Array:
    """Return (K,), px, how far points land from their pixels; inf behind the camera."""
    miss = np.linalg.norm(camera.project(pose.apply(points)) - pixels, axis=1)
    return np.where(np.isfinite(miss), miss, np.inf)


def refined(pose: Pose, camera: Camera, points: Array, pixels: Array, center_mm: Array) -> Pose:
    """Return the pose of least squared distance in pixels, distortion honoured, from `pose` on."""
    from scipy.optimize import least_squares

    pivot = pose.apply(center_mm)
    length = float(np.abs(points - points.mean(0)).max())
    # Depth moves nothing under an orthographic camera.
    depth = 0.0 if camera.is_orthographic else 1.0

    def moved(step: Array) -> Pose:
        twist = step * [1 / length, 1 / length, 1 / length, 1, 1, depth]
        return nudge(pose, twist, pivot)

    def residuals(step: Array) -> Array:
        return np.nan_to_num((camera.project(moved(step).apply(points)) - pixels).ravel(), nan=1e4)

    return moved(least_squares(residuals, np.zeros(6), x_scale=1.0).x)

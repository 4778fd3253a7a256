"""The law of the mirror on an exact sphere."""

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]


def mirrored_rays(camera: Camera, sphere: Sphere, pixels: NDArray) -> tuple[Array, Array]:
    """Return where the rays of pixels meet a mirror ball and where they go from there.

    Parameters
    ----------
    camera : Camera
    sphere : Sphere
    pixels : (..., 2) float

    Returns
    -------
    points : (..., 3) float64
        On the ball, mm, or in radii where the diameter is unknown. NaN where the ray misses.
    directions : (..., 3) float64
        Unit, toward what is mirrored.

    Notes
    -----
    l = 2 (n . v) n - v with v toward the camera along the pixel's own ray. With v = (0, 0, 1) in a
    perspective picture the error is twice the angle off axis.
    """
    normals, points = sphere.normals(camera, pixels)
    if camera.is_orthographic:
        view = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    else:
        view = -points / np.linalg.norm(points, axis=-1, keepdims=True)
    return points, 2 * np.sum(normals * view, -1, keepdims=True) * normals - view


def mean_directions(directions: Array) -> Array:
    """Return (F, 3) unit mean over balls of (S, F, 3), NaN balls left out; NaN where no ball saw the flash."""
    seen = np.isfinite(np.asarray(directions)[..., :1])
    total = np.where(seen, directions, 0).sum(0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(seen.any(0), total / np.linalg.norm(total, axis=1, keepdims=True), np.nan)

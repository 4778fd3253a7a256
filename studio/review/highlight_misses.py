"""Where a mirror ball must show each flash, and by how much the highlights that were seen miss that place."""

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]


def mirrored_px(camera: Camera, sphere: Sphere, lights: Lights) -> Array:
    """Return (N, 2), the pixels at which a mirror ball shows each light.

    At the point p = c + R n the normal halves the angle between the way to the camera and the way to the light, n = (v
    + l) / |v + l|. Solved by repetition: p moves by R at most, which turns v and l by little where both are many radii
    away, and each round shrinks the error by that factor.
    """
    center, radius = sphere.center_mm(camera), sphere.radius_mm
    near = lights.positions_mm is not None and sphere.diameter_mm and not camera.is_orthographic
    normals = np.tile([0.0, 0.0, 1.0], (len(lights), 1))
    for _ in range(60):
        points = center + radius * normals
        view = np.array([[0.0, 0.0, 1.0]]) if camera.is_orthographic else unit(-points)
        toward = unit(lights.positions_mm - points) if near and lights.positions_mm is not None else lights.directions
        normals, before = unit(view + toward), normals
        if np.abs(normals - before).max() < 1e-12:
            break
    if camera.is_orthographic:
        return sphere.center_px + sphere.radius_px * normals[:, :2] * [1.0, -1.0]
    return camera.project(center + radius * normals)


def residuals_px(camera: Camera, sphere: Sphere, lights: Lights, highlights_px: Array) -> Array:
    """Return (N, 2): highlights as seen (N, 2) less where they must be; NaN where none was seen or believed."""
    return highlights_px - mirrored_px(camera, sphere, lights)


def rms_px(residuals: Array) -> float:
    """Return the root mean square length of residuals (..., 2), NaN left out; NaN where there are none."""
    lengths = np.linalg.norm(residuals, axis=-1)
    return float(np.sqrt(np.nanmean(lengths**2))) if np.isfinite(lengths).any() else float("nan")

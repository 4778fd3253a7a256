"""How the table lies on which the balls stand."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from scene.camera import Camera
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
TOWARD_CAMERA = np.array([0.0, 0.0, 1.0])
SLANT, STEEPEST = 0.5, 2.0
"""Tangents of the angle by which a camera looks at a table aslant: the standard deviation in each direction (27
degrees), and from where on (63 degrees) a ball stands on something, or a diameter is wrong."""
DEPTH = 0.005
"""Relative doubt of a ball's distance beside its outline's: a diameter that was rounded, a ball on a ring."""


def table_normal(camera: Camera, spheres: Sequence[Sphere]) -> Array:
    """Return the unit normal (3,) of the plane that touches all balls from below, toward the camera where none is told.

    N . c - r is the same for all balls of centre c and radius r; N is likelier the less it turns from the camera.
    """
    placed = [sphere for sphere in spheres if sphere.diameter_mm and not sphere.apart]
    if camera.is_orthographic or len(placed) < 2:
        return TOWARD_CAMERA
    centers = np.stack([sphere.center_mm(camera) for sphere in placed])
    radii = np.array([sphere.radius_mm for sphere in placed])
    doubt = [np.hypot(DEPTH, np.hypot(sphere.sigma_px / sphere.radius_px, sphere.diameter_sigma)) for sphere in placed]
    sigma = np.linalg.norm(centers, axis=1) * np.array(doubt)

    def misses(x: Array) -> Array:
        heights = centers @ unit(np.append(x[:2], 1.0)) - radii
        return np.concatenate([(heights - x[2]) / sigma, x[:2] / SLANT])

    found = least_squares(misses, [0.0, 0.0, np.median(centers[:, 2] - radii)], loss="soft_l1", x_scale="jac")
    slope = np.hypot(*found.x[:2])
    return unit(np.append(found.x[:2], 1.0)) if slope < STEEPEST else TOWARD_CAMERA

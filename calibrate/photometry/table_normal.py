"""How the table lies on which the balls stand."""

from collections.abc import Callable, Sequence

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

    See `touching`; N is likelier the less it turns from the camera.
    """
    placed = standing(camera, spheres)
    if len(placed) < 2:
        return TOWARD_CAMERA
    _, plane = touching(camera, placed)
    return normal_of(plane) if np.hypot(*plane[:2]) < STEEPEST else TOWARD_CAMERA


def standing(camera: Camera, spheres: Sequence[Sphere]) -> list[Sphere]:
    """Return the balls whose places are known, among those that were photographed with the object."""
    return [] if camera.is_orthographic else [s for s in spheres if s.diameter_mm and not s.apart]


def normal_of(plane: Array) -> Array:
    """Return the unit normal (3,) of a plane (3,): slopes N_x / N_z and N_y / N_z, and N . p of its points, mm."""
    return unit(np.append(plane[:2], 1.0))


def touching(camera: Camera, balls: Sequence[Sphere]) -> tuple[Callable[[Array], Array], Array]:
    """Return how far balls miss a plane (3,), in sigmas, with what is known of slopes; and the plane that fits best.

    N . c - r is the same for all balls of centre c and radius r.
    """
    centers = np.stack([ball.center_mm(camera) for ball in balls])
    radii = np.array([ball.radius_mm for ball in balls])
    doubt = [np.hypot(DEPTH, np.hypot(ball.sigma_px / ball.radius_px, ball.diameter_sigma)) for ball in balls]
    sigma = np.linalg.norm(centers, axis=1) * np.array(doubt)

    def misses(plane: Array) -> Array:
        return np.concatenate([(centers @ normal_of(plane) - radii - plane[2]) / sigma, plane[:2] / SLANT])

    start = [0.0, 0.0, np.median(centers[:, 2] - radii)]
    return misses, least_squares(misses, start, loss="soft_l1", x_scale="jac").x

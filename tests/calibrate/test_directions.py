"""The law of the mirror: signs by cases that fail for each wrong one, exactness by geometry alone."""

import numpy as np
import pytest

from calibrate.lights.directions import mirrored_rays, unknown_view_deg
from scene.camera import Camera
from scene.spheres import Sphere

PERSPECTIVE = Camera(900, 600, 1000.0, 1000.0, 450.0, 300.0)


def _ball(camera, center, radius):
    center = np.asarray(center, float)
    scale = camera.fx / (1 if camera.is_orthographic else -center[2])
    return Sphere("chrome", camera.project(center), radius * scale, 2 * radius)


@pytest.mark.parametrize("center", [[0, 0, -900], [260, 150, -1000], [-300, 100, -800]])
def test_mirrored_ray_bends_by_the_normal_of_the_true_sphere(center):
    """Points are put on the sphere and projected; nothing of Sphere.normals is used to predict."""
    rng = np.random.default_rng(0)
    center = np.array(center, float)
    ball = _ball(PERSPECTIVE, center, 35.0)
    normals = rng.normal(size=(200, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = center + 35.0 * normals
    view = -points / np.linalg.norm(points, axis=1, keepdims=True)
    visible = np.sum(view * normals, 1) > 0.1
    found_points, found = mirrored_rays(PERSPECTIVE, ball, PERSPECTIVE.project(points[visible]))
    np.testing.assert_allclose(found_points, points[visible], atol=1e-6)
    # The normal is the bisector of view and mirrored ray, and all three lie in a plane.
    half = found + view[visible]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    np.testing.assert_allclose(half, normals[visible], atol=1e-9)


def test_an_unknown_camera_turns_all_directions_alike():
    """0.14 widths beside the centre, at 1.4 widths of focal length: 5.7 degrees off the axis, 4 each way."""
    camera = Camera.orthographic(1000, 600)
    ball = Sphere("chrome", np.array([499.5 + 140, 299.5]), 40.0)
    other = Sphere("chrome", np.array([499.5 - 140, 299.5]), 40.0)
    assert abs(unknown_view_deg(camera, [ball]) - np.rad2deg(np.arctan(0.1)) / np.sqrt(2)) < 1e-9
    assert unknown_view_deg(camera, [ball, other]) == 0
    assert unknown_view_deg(Camera(1000, 600, 1400, 1400, 499.5, 299.5), [ball]) == 0
    assert unknown_view_deg(Camera.orthographic(1000, 600, source="session.toml"), [ball]) == 0

"""Pixels to rays and back; each wrong sign fails a case."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scene.camera import FROM_OPENCV, Camera

PLAIN = Camera(1200, 800, 1666.7, 1650.0, 606.8, 394.9)
CURVED = Camera(1200, 800, 1666.7, 1650.0, 606.8, 394.9, (-0.12, 0.05, 0.001, -0.002, 0.01))
FLAT = Camera.orthographic(1200, 800)


@pytest.mark.parametrize("camera", [PLAIN, CURVED, FLAT])
@given(u=st.floats(0, 1199), v=st.floats(0, 799), z=st.floats(-3000, -100))
def test_projecting_a_ray_gives_its_pixel(camera, u, v, z):
    point = camera.points_at_depth(np.array([u, v]), z)
    assert point[2] == pytest.approx(z)
    np.testing.assert_allclose(camera.project(point), [u, v], atol=1e-6)


@pytest.mark.parametrize("camera", [PLAIN, CURVED])
def test_agrees_with_opencv(camera):
    points = np.random.default_rng(0).uniform([-200, -120, -1200], [200, 120, -900], (50, 3))
    theirs, _ = cv2.projectPoints(
        points @ FROM_OPENCV, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion)
    )
    np.testing.assert_allclose(camera.project(points), theirs[:, 0], atol=1e-9)


@pytest.mark.parametrize("camera", [PLAIN, FLAT])
def test_axes(camera):
    """+x is to the right, +y is up in the picture (smaller v), what is seen has z < 0."""
    u, v = camera.project([0.0, 0, -1000])
    assert camera.project([10.0, 0, -1000])[0] > u
    assert camera.project([0.0, 10, -1000])[1] < v
    _, ray = camera.rays([u, v])
    assert ray[2] == -1


def test_halved_camera_sees_superpixel_centres():
    """The 2 x 2 block of pixels 10, 11 becomes pixel 5: its centre was at 10.5."""
    _, whole = PLAIN.rays([[10.5, 20.5], [611.0, 7.5]])
    _, half = PLAIN.halved().rays([[5.0, 10.0], [305.25, 3.5]])
    np.testing.assert_allclose(half, whole, atol=1e-12)
    assert (PLAIN.halved().width, PLAIN.halved().height) == (600, 400)

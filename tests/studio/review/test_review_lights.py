"""Where a ball must mirror each light, and how the lights' sigmas are drawn: laws, and the truth by another way."""

from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import flashes_at
from scene.camera import Camera
from scene.lights import Lights
from scene.spheres import Sphere
from studio.review.ball_marks import mirrored_px, residuals_px, rms_px
from studio.review.light_sigmas import covariance_mm2, ellipsoid_of, fitting_factor
from twin.description.light_groups import direction

CAMERA = Camera(640, 480, 900.0, 910.0, 330.7, 228.1, (0.02, -0.01, 1e-3, -5e-4, 0.0))
ORTHOGRAPHIC = Camera(640, 480, 1.0, 1.0, 320.0, 240.0, projection="orthographic")
BALL = Sphere("chrome", np.array([150.0, 330.0]), 45.0, 100.0)


def lights(near=True, count=7):
    generator = np.random.default_rng(10_003)
    reference = np.array([10.0, -20.0, -950.0])
    positions = reference + generator.uniform([-900, -900, 200], [900, 900, 1200], (count, 3))
    return flashes_at(positions, reference, near=near, digits=1, direction_sigma_deg=np.full(count, 0.3))


@pytest.mark.parametrize(("camera", "near"), [(CAMERA, True), (CAMERA, False), (ORTHOGRAPHIC, False)])
def test_the_ray_of_the_pixel_is_mirrored_to_the_light(camera, near):
    """By the mirror's law on the ray through the pixel that was found: every light is met."""
    shining = lights(near)
    pixels = mirrored_px(camera, BALL, shining)
    normals, points = BALL.normals(camera, pixels)
    view = np.broadcast_to([0.0, 0.0, 1.0], points.shape) if camera.is_orthographic else -points
    view = view / np.linalg.norm(view, axis=1, keepdims=True)
    out = 2 * np.sum(normals * view, 1, keepdims=True) * normals - view
    wanted = shining.positions_mm - points if near else shining.directions
    wanted = wanted / np.linalg.norm(wanted, axis=1, keepdims=True)
    np.testing.assert_allclose(out, wanted, atol=2e-6)
    assert np.linalg.norm(pixels - BALL.center_px, axis=1).max() < BALL.radius_px * 1.1


def test_what_a_highlight_misses_is_counted_in_pixels_right_and_down():
    shining = lights()
    seen = mirrored_px(CAMERA, BALL, shining) + [1.5, 2.0]
    seen[2] = np.nan
    misses = residuals_px(CAMERA, BALL, shining, seen)
    np.testing.assert_allclose(np.delete(misses, 2, 0), np.tile([1.5, 2.0], (6, 1)), atol=1e-9)
    assert np.isnan(misses[2]).all()
    assert rms_px(misses) == pytest.approx(2.5)
    assert np.isnan(rms_px(np.full((3, 2), np.nan)))


def test_right_is_0_degrees_and_up_is_90():
    one = replace(lights(near=False, count=1), directions=np.array([[0.25, 0.4330127, 0.8660254]]))
    (facts,) = one.facts()["frames"]
    assert (facts["zenith_deg"], facts["azimuth_deg"]) == pytest.approx((30, 60), abs=1e-5)


def test_sigmas_are_drawn_so_large_that_they_are_seen():
    assert fitting_factor(replace(lights(), direction_sigma_deg=np.full(7, 0.11))) == 30
    assert fitting_factor(replace(lights(), direction_sigma_deg=np.full(7, 5.0))) == 1
    assert fitting_factor(replace(lights(), direction_sigma_deg=np.full(7, np.nan))) == 1


def test_an_ellipsoid_is_its_covariance():
    factor = np.random.default_rng(10_005).normal(size=(3, 3))
    covariance = factor @ factor.T
    half_axes, rotation = ellipsoid_of(covariance)
    assert np.linalg.det(rotation) == pytest.approx(1)
    np.testing.assert_allclose(rotation @ np.diag(half_axes**2) @ rotation.T, covariance)
    assert ellipsoid_of(np.full((3, 3), np.nan)) is None


def test_a_distant_lights_ellipsoid_is_flat_and_as_wide_as_its_sigma():
    away = direction(130, 50)
    one = Lights(("a",), away[None], np.ones((1, 3)), None, np.zeros(3), np.array([1.0]))
    half_axes, rotation = ellipsoid_of(covariance_mm2(one, None)[0])
    np.testing.assert_allclose(np.sort(half_axes), [0, 17.455, 17.455], atol=1e-3)
    assert abs(rotation[:, np.argmin(half_axes)] @ away) == pytest.approx(1)
    unknown = replace(one, direction_sigma_deg=np.array([np.nan]))
    assert ellipsoid_of(covariance_mm2(unknown, None)[0]) is None

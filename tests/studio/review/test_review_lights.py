"""Where a ball must mirror each light, and how the lights' sigmas are drawn: laws, and the truth by another way."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import flashes_at
from scene.camera import Camera
from scene.lights import Lights
from scene.spheres import Sphere
from studio.review.hemisphere import (
    covariance_mm2,
    ellipsoid_of,
    fitting_factor,
    hemisphere_picture,
    place_in_picture,
)
from studio.review.recalibration import mirrored_px, residuals_px, rms_px
from studio.review.twin_panel import one_light, toward

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


def test_right_is_right_and_up_is_up():
    x, y = place_in_picture(np.array(30.0), np.array(60.0))
    middle = place_in_picture(np.array(0.0), np.array(17.0))
    assert x > middle[0]
    assert y < middle[1]
    np.testing.assert_allclose(toward(30, 60), [0.25, 0.4330127, 0.8660254], atol=1e-6)


def ellipses(svg):
    """Return the covariance (N, 2, 2) that each ellipse of a picture draws, in its coordinates: right, down."""
    found = []
    for rx, ry, turn in re.findall(r'rx="([\d.]+)" ry="([\d.]+)".*?rotate\((-?[\d.]+)\)', svg):
        angle = np.radians(float(turn))
        # SVG turns clockwise on the screen, which is from right toward down.
        axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        found.append(axes @ np.diag([float(rx) ** 2, float(ry) ** 2]) @ axes.T)
    return np.array(found)


def drawn_directions(shining, positions):
    away = positions - shining.reference_point_mm
    zenith = np.degrees(np.arctan2(np.hypot(away[..., 0], away[..., 1]), away[..., 2]))
    return place_in_picture(zenith, np.degrees(np.arctan2(away[..., 1], away[..., 0])))


def test_an_ellipse_is_the_cloud_of_lights_that_the_covariance_allows():
    """Lights are drawn at random about their positions, each is put into the picture: the ellipse is their spread."""
    shining, generator = lights(), np.random.default_rng(10_004)
    factors = generator.normal(0, 4, (7, 3, 3))
    covariance = factors @ factors.transpose(0, 2, 1)
    svg = hemisphere_picture(shining, covariance, chosen=2, factor=10)
    drawn = ellipses(svg) / 10**2
    assert drawn.shape == (7, 2, 2)
    for index in range(7):
        cloud = generator.multivariate_normal(shining.positions_mm[index], covariance[index], 40_000)
        spread = np.cov(drawn_directions(shining, cloud).T)
        np.testing.assert_allclose(drawn[index], spread, atol=0.05 * np.trace(spread))
    assert svg.count("<ellipse") == 7
    assert svg.count("#1a73e8") == 4, "one light is chosen: dot, ellipse's two, number"


def test_without_positions_a_stated_sigma_holds_all_round():
    """At 60 degrees from the axis a turn around it is drawn by its angle, not its sine: longer by 1.047 / 0.866."""
    away = toward(60, 25)
    one = Lights(("a",), away[None], np.ones((1, 3)), None, np.zeros(3), np.array([2.0]))
    (drawn,) = ellipses(hemisphere_picture(one, None, chosen=0, factor=1))
    values = np.sqrt(np.linalg.eigvalsh(drawn))
    unit = np.linalg.norm(place_in_picture(2.0, 0.0) - place_in_picture(0.0, 0.0))
    np.testing.assert_allclose(values, [unit, unit * np.pi / 3 / np.sin(np.pi / 3)], rtol=1e-3)
    unknown = replace(one, direction_sigma_deg=np.array([np.nan]))
    assert "<ellipse" not in hemisphere_picture(unknown, None, chosen=0, factor=1)


def test_a_name_with_signs_of_html_is_only_a_name():
    one = Lights(('<b>"&',), toward(20, 0)[None], np.ones((1, 3)))
    svg = hemisphere_picture(one, None, chosen=0, factor=1)
    assert "<b>" not in svg
    assert "&lt;b&gt;" in svg


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
    direction = toward(40, 130)
    one = Lights(("a",), direction[None], np.ones((1, 3)), None, np.zeros(3), np.array([1.0]))
    half_axes, rotation = ellipsoid_of(covariance_mm2(one, None)[0])
    np.testing.assert_allclose(np.sort(half_axes), [0, 17.455, 17.455], atol=1e-3)
    assert abs(rotation[:, np.argmin(half_axes)] @ direction) == pytest.approx(1)
    unknown = replace(one, direction_sigma_deg=np.array([np.nan]))
    assert ellipsoid_of(covariance_mm2(unknown, None)[0]) is None


def test_a_light_from_elsewhere_shines_from_there():
    shining = lights()
    one = one_light(shining, toward(50, -90))
    away = one.positions_mm[0] - shining.reference_point_mm
    assert away[1] < 0, "azimuth -90 is below the camera's axis"
    np.testing.assert_allclose(away / np.linalg.norm(away), one.directions[0], atol=1e-12)
    distances = np.linalg.norm(shining.positions_mm - shining.reference_point_mm, axis=1)
    assert np.linalg.norm(away) == pytest.approx(np.median(distances))
    assert one_light(lights(near=False), toward(50, 0)).positions_mm is None

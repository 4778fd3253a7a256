"""The white ball as photometer, on photographs that are traced."""

import re
from dataclasses import replace

import numpy as np
import pytest

from calibrate.calibration import Notes
from calibrate.photometry.from_white import intensities_from_white
from calibrate.photometry.matte_shading import read_surface, shading_directions
from calibrate.photometry.photometer import measure
from calibrate.photometry.table_normal import TOWARD_CAMERA, table_normal
from fixtures.ball_scene import Ball, World, distant, flashes, radiance
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere

CAMERA = Camera(200, 160, 900.0, 900.0, 96.0, 82.0)
CENTER, RADIUS = np.array([20.0, -10.0, -800.0]), 45.0
REFERENCE = np.array([0.0, 0.0, -800.0])
NAMES = "abcdefg"
LIGHTS = flashes(7, near_mm=700.0, far_mm=1000.0, center=REFERENCE, seed=5)
LAMP = np.array([0.6, 0.0, 0.8])
POWERS = np.random.default_rng(6).uniform([[0.6]] * 7, 1.3) * [1.0, 0.95, 1.05]
UP = np.array([0.1, -0.15, 1.0]) / np.linalg.norm([0.1, -0.15, 1.0])


def _frames(*, near=True, ambient=0.0, gloss=0.0, bounce=0.0, shadow=None, lamp=None, gain=0.35):
    """Photographs of a white ball on a table of albedo `bounce`, traced.

    `shadow`: in this frame half of it is hidden; `lamp`: from this frame on one of a third of a flash shines.
    """
    white = Ball("white", CENTER, RADIUS, albedo=1.0, gloss=gloss, shininess=200.0)
    table = {"table_point": CENTER - RADIUS * UP, "table_normal": UP, "table_albedo": bounce}
    world = World(CAMERA, [white], LIGHTS, gain * POWERS / 4, flash_radius=1.0, ambient=ambient, **table)
    if not near:
        distant(world, LIGHTS - CENTER, gain * POWERS)
    images, _ = radiance(world)
    if shadow is not None:
        images[shadow, :, round(CAMERA.project(CENTER)[0]) :] *= 0.02
    if lamp is not None:
        images[lamp:] += radiance(distant(replace(world, ambient=0.0), LAMP[None], [[0.3 * gain] * 3]))[0]
    return Frames.from_linear(tuple(NAMES), images + 1e-3 * np.random.default_rng(0).normal(size=images.shape))


BALL = Sphere("white", CAMERA.project(CENTER), 900 * RADIUS / 800, 2 * RADIUS)
DIRECTIONS = (LIGHTS - CENTER) / np.linalg.norm(LIGHTS - CENTER, axis=1, keepdims=True)
AT_REFERENCE = 0.35 * POWERS * (500**2 / np.sum((LIGHTS - REFERENCE) ** 2, 1))[:, None]


def _lights(positions):
    return Lights(tuple(NAMES), DIRECTIONS, np.ones((7, 3)), positions, REFERENCE)


@pytest.mark.parametrize(
    ("effects", "table", "tolerance"),
    [
        ({}, TOWARD_CAMERA, 0.002),
        ({"ambient": 0.02}, TOWARD_CAMERA, 0.003),
        ({"gloss": 0.5}, TOWARD_CAMERA, 0.003),
        # The table is taken to face the camera; this one is tilted by 10 degrees.
        ({"bounce": 0.3}, TOWARD_CAMERA, 0.013),
        ({"bounce": 0.3, "ambient": 0.01, "gloss": 0.3}, TOWARD_CAMERA, 0.013),
        ({"bounce": 0.3, "ambient": 0.01, "gloss": 0.3}, UP, 0.002),
    ],
    ids=["plain", "ambient", "gloss", "bounce", "all", "slanted table"],
)
def test_near_lights_are_measured(effects, table, tolerance):
    light = measure(read_surface(_frames(**effects), CAMERA, BALL, table), _lights(LIGHTS))
    ratio = light.intensities / AT_REFERENCE
    np.testing.assert_allclose(ratio, 1, atol=0.025)
    # Only what varies between frames bends normals.
    np.testing.assert_allclose(ratio / ratio.mean(0), 1, atol=tolerance)
    # Half a percent of the flash's peak is what is asked for.
    np.testing.assert_allclose(light.ambient, effects.get("ambient", 0.0), atol=0.001)
    assert (light.sigma < 0.01).all()
    albedo = float(re.search(r"a table of albedo (\d\.\d\d)", light.evidence)[1])
    np.testing.assert_allclose(albedo, effects.get("bounce", 0.0), atol=0.1)


def test_a_shadow_on_half_of_the_ball_bends_no_other_frame():
    light = measure(read_surface(_frames(shadow=2, ambient=0.01), CAMERA, BALL), _lights(LIGHTS))
    others = [0, 1, 3, 4, 5, 6]
    np.testing.assert_allclose((light.intensities / AT_REFERENCE)[others], 1, atol=0.004)
    assert light.misfit[2] > 10 * np.median(light.misfit)
    assert light.sigma[2] > 0.05


@pytest.mark.parametrize("first", [None, 3, 4])
def test_a_lamp_that_was_switched_on_is_named_by_its_frame(first):
    notes, surface = Notes(), read_surface(_frames(lamp=first), CAMERA, BALL)
    light = intensities_from_white(_frames(lamp=first), [surface], _lights(LIGHTS), notes)
    ratio = light.intensities / AT_REFERENCE
    np.testing.assert_allclose(ratio / ratio.mean(0), 1, atol=0.002 if first is None else 0.03)
    said = [warning for warning in notes.warnings if "a lamp was switched" in warning]
    assert [warning[0] for warning in said] == ([] if first is None else [NAMES[first]])


def test_sigma_covers_what_wrong_positions_do():
    """Lights that err by 0.3 degrees and 2 % of their range: the intensities err by what is said."""
    surface = read_surface(_frames(), CAMERA, BALL)
    rng = np.random.default_rng(10000)
    axis = (LIGHTS - REFERENCE) / np.linalg.norm(LIGHTS - REFERENCE, axis=1, keepdims=True)
    distance = np.linalg.norm(LIGHTS - REFERENCE, axis=1)[:, None, None]
    along = axis[:, :, None] * axis[:, None, :]
    covariance = distance**2 * (0.02**2 * along + np.deg2rad(0.3) ** 2 * (np.eye(3) - along))
    inside = []
    for _ in range(12):
        wrong = np.stack([rng.multivariate_normal(q, c) for q, c in zip(LIGHTS, covariance, strict=True)])
        light = measure(surface, _lights(wrong), covariance)
        ratio = (light.intensities / AT_REFERENCE).mean(1)
        inside.append(np.abs(ratio / ratio.mean() - 1) < 1.96 * light.sigma)
    assert 0.85 < np.mean(inside) <= 1
    assert np.median(light.sigma) < 0.03


def test_clipped_skin_is_not_believed():
    """One channel clips on the side that faces the light: the rest of the ball must carry the measurement."""
    frames = _frames(gain=2.8)
    surface = read_surface(frames, CAMERA, BALL)
    assert surface.clipped.mean(1).max() > 0.2
    light = measure(surface, _lights(LIGHTS))
    np.testing.assert_allclose(light.intensities / (AT_REFERENCE / 0.35 * 2.8), 1, atol=0.01)


def test_shading_alone_gives_the_direction():
    directions, sigma = shading_directions(read_surface(_frames(near=False, ambient=0.02), CAMERA, BALL))
    assert angular_error_deg(directions, DIRECTIONS).max() < 0.3
    assert (sigma < 1).all()


@pytest.mark.parametrize("up", [UP, np.array([0.0, 0.6, 0.8])])
def test_balls_tell_how_the_table_lies(up):
    """Three of unequal size, seen to 0.2 %; what two do not tell is taken to face the camera."""
    side = np.cross(up, [1.0, 0.0, 0.0])
    along = np.array([1.0, 0.0, 0.0]) - up[0] * up
    feet = np.array([0.0, 0.0, -900.0]) + np.array([-150 * along - 60 * side, 140 * along, 20 * along + 120 * side])
    radii = np.array([40.0, 25.0, 12.0])
    balls = [_ball_at(foot + r * up, r) for foot, r in zip(feet, radii, strict=True)]
    noisy = [replace(b, radius_px=1.002 * b.radius_px, sigma_px=0.002 * b.radius_px) for b in balls[:1]] + balls[1:]
    assert angular_error_deg(table_normal(CAMERA, balls), up) < 3
    assert angular_error_deg(table_normal(CAMERA, noisy), up) < 4
    assert angular_error_deg(table_normal(CAMERA, balls[:2]), up) < angular_error_deg(TOWARD_CAMERA, up) + 0.1
    np.testing.assert_array_equal(table_normal(CAMERA, balls[:1]), TOWARD_CAMERA)
    np.testing.assert_array_equal(table_normal(CAMERA, [replace(b, diameter_mm=None) for b in balls]), TOWARD_CAMERA)


def _ball_at(center, radius):
    return Sphere("white", CAMERA.project(center), 900 * radius / -center[2], 2 * radius)

"""The white ball as photometer, on shading that is computed here pixel by pixel."""

import numpy as np
import pytest

from calibrate.intensity import measure
from calibrate.skin import read_skin, shading_directions
from scene.camera import Camera
from scene.frames import Frames
from scene.normals import angular_error_deg
from scene.spheres import Sphere

CAMERA = Camera(200, 160, 900.0, 900.0, 96.0, 82.0)
CENTER, RADIUS = np.array([20.0, -10.0, -800.0]), 45.0
REFERENCE = np.array([0.0, 0.0, -800.0])
LIGHTS = np.array([[300.0, 200, -100], [-400, 100, 0], [100, -500, -50], [-150, 350, 50], [50, 50, 200]])
POWERS = np.array([[1.0, 0.9, 1.1], [0.7, 0.75, 0.7], [1.3, 1.2, 1.3], [0.9, 0.9, 0.95], [0.6, 0.62, 0.6]])


def _frames(*, near=True, ambient=0.0, gloss=0.0, bounce=0.0, gain=0.35):
    """March each pixel's ray to the sphere by hand and shade it."""
    v, u = np.mgrid[0:160, 0:200]
    ray = np.stack([(u - 96.0) / 900, -(v - 82.0) / 900, 0 * u - 1.0], -1)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    b = ray @ CENTER
    disc = b * b - CENTER @ CENTER + RADIUS**2
    hit = disc > 0
    point = (b - np.sqrt(np.where(hit, disc, 0)))[..., None] * ray
    normal = (point - CENTER) / RADIUS
    rng = np.random.default_rng(0)
    images = []
    for light, power in zip(LIGHTS, POWERS, strict=True):
        toward = light - point if near else np.broadcast_to(light - CENTER, point.shape)
        distance = np.linalg.norm(toward, axis=-1)
        cosine = np.sum(normal * toward, -1) / distance
        fall = (500 / distance) ** 2 if near else 1.0
        mirrored = 2 * np.sum(-ray * normal, -1)[..., None] * normal + ray
        shine = gloss * np.maximum(np.sum(mirrored * toward, -1) / distance, 0) ** 200
        value = fall * (np.maximum(cosine, 0) + shine * (cosine > 0)) + bounce * (1 - normal[..., 2]) / 2
        image = np.where(hit, gain * value, 0.02)[..., None] * power + ambient * hit[..., None]
        images.append(image + 1e-3 * rng.normal(size=image.shape))
    return Frames.from_linear(tuple("abcde"), np.stack(images))


BALL = Sphere("white", CAMERA.project(CENTER), 900 * RADIUS / 800, 2 * RADIUS)
DIRECTIONS = (LIGHTS - CENTER) / np.linalg.norm(LIGHTS - CENTER, axis=1, keepdims=True)
AT_REFERENCE = 0.35 * POWERS * (500**2 / np.sum((LIGHTS - REFERENCE) ** 2, 1))[:, None]


@pytest.mark.parametrize(
    ("effects", "tolerance"),
    [({}, 0.002), ({"ambient": 0.02}, 0.004), ({"gloss": 0.5}, 0.006), ({"bounce": 0.05}, 0.01)],
    ids=["plain", "ambient", "gloss", "bounce"],
)
def test_near_lights_are_measured(effects, tolerance):
    light = measure(read_skin(_frames(**effects), CAMERA, BALL), DIRECTIONS, LIGHTS, REFERENCE)
    np.testing.assert_allclose(light.intensities / AT_REFERENCE, 1, atol=tolerance)
    np.testing.assert_allclose(light.ambient, effects.get("ambient", 0.0), atol=0.002)
    assert (light.sigma < 0.01).all()


def test_distant_lights_are_measured():
    light = measure(read_skin(_frames(near=False), CAMERA, BALL), DIRECTIONS, None, REFERENCE)
    np.testing.assert_allclose(light.intensities / (0.35 * POWERS), 1, atol=0.002)


def test_clipped_skin_is_not_believed():
    """One channel clips on the side that faces the light: the rest of the ball must carry the measurement."""
    frames = _frames(gain=2.8)
    skin = read_skin(frames, CAMERA, BALL)
    assert skin.clipped.mean(1).max() > 0.2
    light = measure(skin, DIRECTIONS, LIGHTS, REFERENCE)
    np.testing.assert_allclose(light.intensities / (AT_REFERENCE / 0.35 * 2.8), 1, atol=0.01)


def test_wholly_clipped_ball_gives_no_number():
    light = measure(read_skin(_frames(gain=40.0), CAMERA, BALL), DIRECTIONS, LIGHTS, REFERENCE)
    assert np.isnan(light.intensities).all()


def test_shading_alone_gives_the_direction():
    directions, sigma = shading_directions(read_skin(_frames(near=False, ambient=0.02), CAMERA, BALL))
    assert angular_error_deg(directions, DIRECTIONS).max() < 0.3
    assert (sigma < 1).all()

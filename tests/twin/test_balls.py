"""Rendered balls: the mirror's law, the matte sphere's, and a sensor as noisy as the session's."""

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from scene.camera import Camera
from scene.errors import RenderError
from scene.frames import Frames
from scene.lights import Lights
from scene.spheres import Sphere
from scene.store import Store
from twin.camera.grain import sensor_like
from twin.camera.virtual_camera import Sensor, expose, write_dng
from twin.virtual_balls import place_balls, render_balls

STRAIGHT = Camera(300, 220, 420.0, 420.0, 161.3, 104.8)
BENT = Camera(300, 220, 420.0, 431.0, 161.3, 104.8, (-0.12, 0.05, 0.002, -0.001, 0.0))
BALLS = [
    Sphere("chrome", np.array([75.0, 70.0]), 50.0, 80.0),
    Sphere("white", np.array([220.0, 120.0]), 55.0, 90.0),
]
POSITIONS = np.array([[250.0, 300.0, 150.0], [-350.0, 120.0, 60.0]])
REFERENCE = np.array([0.0, 0.0, -340.0])
POWER = np.array([[1.2, 1.0, 0.8], [0.7, 0.9, 1.1]])


def near():
    offset = POSITIONS - REFERENCE
    return Lights(
        ("a", "b"), offset / np.linalg.norm(offset, axis=1, keepdims=True), POWER, POSITIONS, REFERENCE
    )  # fmt: skip


def distant():
    directions = np.array([[0.5, 0.4, 0.8], [-0.6, 0.1, 0.7]])
    return Lights(("a", "b"), directions / np.linalg.norm(directions, axis=1, keepdims=True), POWER)


def hit(camera, ball, pixel):
    """Return where a pixel's ray meets a ball, by a way of its own: bisection along the ray."""
    origin, ray = (v[0] for v in camera.rays(np.array([pixel])))
    nearest = (ball.center - origin) @ ray
    low, high = nearest - ball.radius, nearest
    for _ in range(60):
        middle = (low + high) / 2
        inside = np.linalg.norm(origin + middle * ray - ball.center) < ball.radius
        low, high = (low, middle) if inside else (middle, high)
    return origin + low * ray, ray


@pytest.mark.full
@pytest.mark.render
@pytest.mark.parametrize(
    ("camera", "lights"),
    [(STRAIGHT, near()), (BENT, near()), (STRAIGHT, distant()), (Camera.orthographic(300, 220), distant())],
    ids=["near", "bent", "distant", "orthographic"],
)
def test_mirror_and_matte_obey_their_laws(camera, lights):
    chrome, white = place_balls(BALLS, camera)
    images = list(render_balls(BALLS, camera, lights, peak=0.6, samples_per_pixel=64))
    assert len(images) == 2
    for index, image in enumerate(images):
        assert image.shape == (220, 300, 3)
        # The flash in the mirror: the reflected ray goes to it.
        bright = np.where(BALLS[0].mask(camera), image.mean(-1), 0)
        rows, columns = np.nonzero(bright > 5)
        weight = bright[rows, columns]
        pixel = [np.average(columns, weights=weight), np.average(rows, weights=weight)]
        point, ray = hit(camera, chrome, pixel)
        normal = (point - chrome.center) / chrome.radius
        reflected = ray - 2 * (ray @ normal) * normal
        target = lights.directions[index]
        if lights.positions_mm is not None:
            target = lights.positions_mm[index] - point
        assert np.degrees(np.arccos(reflected @ target / np.linalg.norm(target))) < 0.12
        # The matte ball, where the light stands high: the wall adds a few per cent at most.
        for offset in ([0, 0], [12, -9], [-15, -10]):
            pixel = BALLS[1].center_px + offset
            u, v = np.round(pixel).astype(int)
            point, _ = hit(camera, white, [u, v])
            normal = (point - white.center) / white.radius
            vectors = lights.at(point[None])[index, 0]
            expected = 0.6 / lights.intensities.max() * np.maximum(vectors @ normal, 0)
            np.testing.assert_allclose(image[v, u], expected, rtol=0.05, atol=0.004)


def test_balls_of_unknown_size_stand_with_the_others():
    known, unknown = BALLS[0], Sphere("white", np.array([220.0, 120.0]), 55.0)
    one, two = place_balls([known, unknown], STRAIGHT)
    np.testing.assert_allclose(one.center[2], two.center[2])
    for ball in place_balls([unknown, unknown], STRAIGHT):
        assert ball.center[2] == pytest.approx(-1000)
        assert STRAIGHT.fx * ball.radius / 1000 == pytest.approx(55)


@pytest.mark.render
def test_nothing_to_render():
    with pytest.raises(RenderError, match="no ball"):
        next(iter(render_balls([], STRAIGHT, near())))


@pytest.mark.parametrize(("full_well_e", "read_noise_e"), [(45000, 5), (2000, 2), (20000, 30)])
@pytest.mark.parametrize("mosaic", [True, False])
def test_the_sensors_noise_is_found_again(tmp_path, full_well_e, read_noise_e, mosaic):
    from capture.photographs.decode import decode
    from capture.session.session_types import Session

    sensor = Sensor(full_well_e=full_well_e, read_noise_e=read_noise_e, blur_px=0.6, neutral=(1.0, 1.0, 1.0))
    rng = np.random.default_rng(10001)
    v, u = np.mgrid[:240, :320]
    image = np.repeat((0.02 + 0.6 * (u / 320) ** 2 * (1 + 0.2 * np.sin(v / 17)))[..., None], 3, -1)
    if mosaic:
        path = tmp_path / "a.dng"
        mosaic_ = expose(image, sensor, rng)
        write_dng(path, mosaic_, sensor, exposure_s=0.01, iso=100, aperture=8, focal_mm=50, time=datetime(2000, 1, 1))
        frames, _ = decode(Session("x", tmp_path, (path,), ("a",), (0,)), Store(tmp_path / "out"))
    else:
        plain = replace(sensor, cfa="none", black_level=0, white_level=65535)
        frames = Frames.from_linear(("a",), expose(image, plain, rng)[None] / np.float32(65535))
    found = sensor_like(frames)
    assert found.full_well_e == pytest.approx(full_well_e, rel=0.15)
    dark = np.sqrt((found.read_noise_e / found.full_well_e) ** 2 + 0.02 / found.full_well_e)
    assert dark == pytest.approx(np.sqrt((read_noise_e / full_well_e) ** 2 + 0.02 / full_well_e), rel=0.15)


def test_frames_without_noise_are_no_fault():
    ramp = np.linspace(0.05, 0.8, 160 * 180 * 3, dtype=np.float32).reshape(1, 160, 180, 3)
    assert sensor_like(Frames.from_linear(("a",), ramp)).full_well_e > 1e5
    # Nothing to measure: a usual sensor.
    dark = Frames.from_linear(("a",), np.zeros((1, 40, 50, 3), np.float32))
    assert sensor_like(dark).full_well_e == Sensor().full_well_e

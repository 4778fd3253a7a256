"""The law of the mirror, exact by geometry alone; what balls will tell of lights, against Monte Carlo of the fit."""

import numpy as np
import pytest

from calibrate.lights.adjustment import ObservedSpots
from calibrate.lights.directions import mirrored_at, mirrored_rays, unknown_view_deg
from calibrate.lights.from_chrome import SAMPLED_PX2
from calibrate.lights.positions import fit_lights
from calibrate.lights.predicted_lights import USUAL_BLUR_PX, predict_lights
from calibrate.lights.reflected_disc import FLOOR_PX
from calibrate.silhouette.ball_silhouette import table_floor_px
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.light_layouts import cap
from scene.normals import angular_error_deg, unit
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


CAMERA = Camera(1200, 800, 1900.0, 1900.0, 611.0, 390.0)
REFERENCE = np.array([0.0, 0.0, -1000.0])
POSITIONS = REFERENCE + 900 * cap(10, 55.0)


def toward(points):
    """Return the ways (N, 3) from points to the lights."""
    return unit(POSITIONS - points)


def ball(x, y, diameter=60.0, kind="chrome"):
    center = np.array([x, y, -1020.0])
    return Sphere(kind, CAMERA.project(center), CAMERA.fx * diameter / 2 / 1020, diameter)


BALLS = [ball(-220, 130), ball(220, 120), ball(-210, -130)]


def test_more_and_larger_balls_tell_more_and_one_tells_no_range():
    def sigma(balls):
        return predict_lights(CAMERA, balls, POSITIONS, REFERENCE)

    one, two, three = (sigma(BALLS[:count]) for count in (1, 2, 3))
    assert (one.range_sigma > 0.5).all()
    assert (two.range_sigma < 0.03).all()
    assert (three.direction_sigma_deg < two.direction_sigma_deg).all()
    assert (two.direction_sigma_deg < one.direction_sigma_deg).all()
    large = sigma([ball(-220, 130, 120.0), ball(220, 120, 120.0), ball(-210, -130, 120.0)])
    # Outlines tell twice as well on balls twice as large, and highlights four times: their place errs by 1 / r besides.
    gain = three.direction_sigma_deg / large.direction_sigma_deg
    assert ((gain > 1.8) & (gain < 4)).all()
    assert three.intensity_sigma > 10 * sigma([*BALLS, ball(210, -130, kind="white")]).intensity_sigma
    with pytest.raises(CalibrationError, match="none of chrome"):
        sigma([ball(0, 0, kind="white")])


@pytest.mark.full
def test_the_sigma_is_that_of_the_fit_to_noisy_highlights_and_outlines():
    predicted = predict_lights(CAMERA, BALLS, POSITIONS, REFERENCE)
    rng, turns, moves = np.random.default_rng(0), [], []
    exact = np.stack([mirrored_at(CAMERA, sphere, toward) for sphere in BALLS])
    floor = np.array([table_floor_px(sphere.radius_px, USUAL_BLUR_PX) for sphere in BALLS])
    noise = np.array([[np.hypot(FLOOR_PX, SAMPLED_PX2 / sphere.radius_px)] * 10 for sphere in BALLS])
    for _ in range(30):
        outlines = floor[:, None] * rng.standard_normal((3, 3))
        drawn = [
            Sphere("chrome", s.center_px + d[:2], s.radius_px + d[2], s.diameter_mm)
            for s, d in zip(BALLS, outlines, strict=True)
        ]
        noisy = exact + noise[..., None] * rng.standard_normal(exact.shape)
        covariances = [px**2 * np.eye(3) for px in floor]
        fit = fit_lights(ObservedSpots(CAMERA, drawn, covariances, noisy, noise, REFERENCE), near=True)
        turns.append(angular_error_deg(fit.directions, unit(POSITIONS - REFERENCE)))
        moves.append(fit.positions_mm - POSITIONS)
    found = np.sqrt(np.mean(np.square(turns)) / 2)
    assert found == pytest.approx(np.sqrt(np.mean(predicted.direction_sigma_deg**2)), rel=0.2)
    own = np.einsum("fifi->f", predicted.position_covariance_mm2)
    assert np.sqrt(np.mean(np.square(moves))) == pytest.approx(np.sqrt(own / 3).mean(), rel=0.25)
    # What all lights share: the mean position of all is far from averaged out.
    mean = np.sqrt(np.mean(np.square(np.mean(moves, 1))))
    joint = predicted.position_covariance_mm2.mean((0, 2))
    assert mean == pytest.approx(np.sqrt(np.trace(joint) / 3), rel=0.3)

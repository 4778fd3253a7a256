"""What balls will tell of lights: the mirror's law, Monte Carlo of the fit itself, what more and larger balls do."""

import numpy as np
import pytest

from calibrate.lights.adjustment import ObservedSpots
from calibrate.lights.directions import mirrored_at
from calibrate.lights.positions import fit_lights
from calibrate.lights.predicted_lights import USUAL_BLUR_PX, predict_lights
from calibrate.lights.reflected_disc import FLOOR_PX
from calibrate.silhouette.ball_silhouette import table_floor_px
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.light_layouts import cap
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere

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
    assert large.direction_sigma_deg == pytest.approx(three.direction_sigma_deg / 2, rel=0.2)
    assert three.intensity_sigma > 10 * sigma([*BALLS, ball(210, -130, kind="white")]).intensity_sigma
    with pytest.raises(CalibrationError, match="none of chrome"):
        sigma([ball(0, 0, kind="white")])


@pytest.mark.full
def test_the_sigma_is_that_of_the_fit_to_noisy_highlights_and_outlines():
    predicted = predict_lights(CAMERA, BALLS, POSITIONS, REFERENCE)
    rng, turns, moves = np.random.default_rng(0), [], []
    exact = np.stack([mirrored_at(CAMERA, sphere, toward) for sphere in BALLS])
    floor = np.array([table_floor_px(sphere.radius_px, USUAL_BLUR_PX) for sphere in BALLS])
    for _ in range(30):
        outlines = floor[:, None] * rng.standard_normal((3, 3))
        drawn = [
            Sphere("chrome", s.center_px + d[:2], s.radius_px + d[2], s.diameter_mm)
            for s, d in zip(BALLS, outlines, strict=True)
        ]
        noisy = exact + FLOOR_PX * rng.standard_normal(exact.shape)
        covariances = [px**2 * np.eye(3) for px in floor]
        fit = fit_lights(
            ObservedSpots(CAMERA, drawn, covariances, noisy, np.full((3, 10), FLOOR_PX), REFERENCE), near=True
        )
        turns.append(angular_error_deg(fit.directions, unit(POSITIONS - REFERENCE)))
        moves.append(fit.positions_mm - POSITIONS)
    found = np.sqrt(np.mean(np.square(turns)) / 2)
    assert found == pytest.approx(np.sqrt(np.mean(predicted.direction_sigma_deg**2)), rel=0.2)
    assert np.sqrt(np.mean(np.square(moves))) == pytest.approx(np.mean(predicted.position_sigma_mm), rel=0.25)
    # What all lights share: the mean position of all is far from averaged out.
    mean = np.sqrt(np.mean(np.square(np.mean(moves, 1))))
    joint = predicted.position_covariance_mm2.mean((0, 2))
    assert mean == pytest.approx(np.sqrt(np.trace(joint) / 3), rel=0.3)

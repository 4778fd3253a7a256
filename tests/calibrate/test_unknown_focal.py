"""A focal length that nothing but the balls tells."""

from dataclasses import replace

import numpy as np
import pytest

from calibrate.calibration import Calibration
from calibrate.unknown_focal import KNOWN, ROUNDS, with_unknown_focal
from scene.camera import Camera
from scene.lights import Lights

GUESS = Camera(960, 640, 1700.0, 1700.0, 479.5, 319.5, source="assumed", focal_sigma=0.4)
LIGHTS = Lights(("a",), np.array([[0, 0, 1.0]]), np.ones((1, 3)))


def answering(law, sigma=0.03):
    """Return a calibration that answers a focal length by a law, and the cameras that it was asked under."""
    asked = []

    def run(camera):
        asked.append(camera)
        known = (
            None if camera.is_orthographic else replace(camera, fx=law(camera.fx), fy=law(camera.fx), focal_sigma=sigma)
        )
        return Calibration([], LIGHTS, np.zeros((0, 1, 2)), camera=known)

    return run, asked


@pytest.mark.parametrize("slope", [0.0, 0.4, -0.6, -1.2])
@pytest.mark.parametrize("truth", [900.0, 1333.0, 2600.0])
def test_the_focal_length_that_agrees_with_itself_is_found(slope, truth):
    """Answers that overshoot (a slope below 0) are met half way; none is ever the answer to another guess."""
    run, asked = answering(lambda focal: truth * (focal / truth) ** slope, sigma=0.001)
    found = with_unknown_focal(run, GUESS)
    assert found.camera.fx == pytest.approx(truth, rel=0.025)
    assert found.camera.source == "balls"
    assert len(asked) <= ROUNDS
    assert f"{found.camera.fx:.0f} px, good to 0.1 %" in found.warnings[0]


def test_balls_that_do_not_tell_leave_the_camera_orthographic():
    run, asked = answering(lambda focal: focal, sigma=1.1 * KNOWN)
    found = with_unknown_focal(run, GUESS)
    assert found.camera.is_orthographic
    assert [camera.is_orthographic for camera in asked] == [False, True]
    assert "5 to 15 degrees" in found.warnings[0]

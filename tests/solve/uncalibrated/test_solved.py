"""Uncalibrated methods through the common door: a session's frames, and lights of which only the strength is read."""

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, dome, lights_along, matte, spiral
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from solve.methods import UNCALIBRATED
from solve.solve import solve


def ball(count=24):
    """Return frames of a ball, with mask, lights, normals and color."""
    size = 64
    directions = spiral(1 - 0.4 * (np.arange(count) + 0.5) / count, first=0.5)
    rng = np.random.default_rng(20_020)
    intensities = rng.uniform(0.5, 1.5, (count, 3))
    truth = lights_along(directions, intensities).normalised()
    normals, mask = dome(size, radius=0.44, rim=0.26)
    color = np.array([0.5, 0.3, 0.2])
    return as_floats(truth, matte(truth, normals, normals, color)), mask, truth, normals, color


def solved(method, frames, mask, truth):
    """Solve with the directions of other lights."""
    rng = np.random.default_rng(20_021)
    wrong = Lights(truth.names, unit(rng.normal(size=(len(truth), 3)) + [0, 0, 1]), truth.intensities)
    size = len(mask)
    return solve(method, frames, wrong, Camera(size, size, 100.0, 100.0, size / 2, size / 2), mask)


@pytest.mark.parametrize("method", UNCALIBRATED)
def test_normals_albedo_and_lights_whatever_the_directions_that_are_given(method):
    frames, mask, truth, normals, color = ball()
    found = solved(method, frames, mask, truth)
    assert angular_error_deg(found.normals, normals)[mask].mean() < 0.5
    np.testing.assert_allclose(np.median(found.albedo[mask], 0), color, rtol=0.02)
    assert found.lights is not None
    assert angular_error_deg(found.lights.directions, truth.directions).max() < 1
    np.testing.assert_allclose(found.lights.intensities, truth.intensities, rtol=0.03)
    assert np.nanmedian(found.sigma_deg) < 0.5

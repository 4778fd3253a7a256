"""Lights from highlights whose truth comes from Fermat's principle, and sigmas that must be honest."""

import numpy as np
import pytest
from scipy.optimize import minimize

from calibrate.adjustment import ray_meeting
from calibrate.positions import fit_lights
from scene.camera import Camera
from scene.normals import angular_error_deg
from scene.spheres import Sphere

CAMERA = Camera(1200, 800, 1666.7, 1666.7, 606.8, 394.9)
CENTERS = np.array([[-260.0, -150.0, -985.0], [255.0, 140.0, -1004.0], [-240.0, 150.0, -1010.0]])
RADIUS = 38.0


def fermat(center, light):
    """Return the pixel at which the ball mirrors the light: the path light - ball - camera is the shortest there."""
    start = -center / np.linalg.norm(center) + (light - center) / np.linalg.norm(light - center)
    start /= np.linalg.norm(start)
    helper = np.cross(start, [0.3, 0.8, 0.5])
    side = helper / np.linalg.norm(helper)
    up = np.cross(start, side)

    def path(x):
        normal = start + x[0] * side + x[1] * up
        point = center + RADIUS * normal / np.linalg.norm(normal)
        return np.linalg.norm(point) + np.linalg.norm(light - point)

    x = minimize(path, [0.0, 0.0], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-13}).x
    normal = start + x[0] * side + x[1] * up
    return CAMERA.project(center + RADIUS * normal / np.linalg.norm(normal))


def _spheres(count, rng=None, sigma=0.0):
    out = []
    for center in CENTERS[:count]:
        values = np.array([*CAMERA.project(center), CAMERA.fx * RADIUS / -center[2]])
        values += sigma * rng.normal(size=3) if rng is not None else 0
        out.append(Sphere("chrome", values[:2], float(values[2]), 2 * RADIUS))
    return out


@pytest.fixture(scope="module")
def scene(tracer):
    lights = tracer.flashes(8, seed=3)
    return lights, np.array([[fermat(center, light) for light in lights] for center in CENTERS])


REFERENCE = CENTERS.mean(0)


def test_exact_highlights_give_exact_lights(scene):
    lights, highlights = scene
    fit = fit_lights(
        CAMERA, _spheres(3), [0.05**2 * np.eye(3)] * 3, highlights, np.full((3, 8), 0.1), REFERENCE, near=True
    )
    np.testing.assert_allclose(fit.positions_mm, lights, atol=0.5)
    assert np.nanmax(fit.residual_px) < 1e-3


@pytest.mark.parametrize("count", [2, 3])
def test_stated_sigmas_are_honest(scene, count):
    """Truth lies in the 95 % region of direction and range in a sane share of noisy repetitions."""
    lights, highlights = scene
    rng = np.random.default_rng(count)
    truth = lights - REFERENCE
    distance = np.linalg.norm(truth, axis=1)
    inside_direction, inside_range = [], []
    for _ in range(25):
        noisy = highlights[:count] + 0.15 * rng.normal(size=highlights[:count].shape)
        fit = fit_lights(
            CAMERA,
            _spheres(count, rng, 0.08),
            [0.08**2 * np.eye(3)] * count,
            noisy,
            np.full((count, 8), 0.15),
            REFERENCE,
            near=True,
        )
        angle = angular_error_deg(fit.directions, truth / distance[:, None])
        # Two tangent axes of one sigma each: chi2 with 2 degrees of freedom.
        inside_direction.append(angle < 2.448 * fit.direction_sigma_deg)
        off = np.log(np.linalg.norm(fit.positions_mm - REFERENCE, axis=1) / distance)
        inside_range.append(np.abs(off) < 1.96 * fit.range_sigma)
    assert 0.88 < np.mean(inside_direction) < 0.995
    assert 0.88 < np.mean(inside_range) < 0.995


def test_one_wrong_highlight_is_left_out(scene):
    lights, highlights = scene
    spoiled = highlights.copy()
    spoiled[1, 4] += [9.0, -6.0]
    fit = fit_lights(
        CAMERA, _spheres(3), [0.05**2 * np.eye(3)] * 3, spoiled, np.full((3, 8), 0.1), REFERENCE, near=True
    )
    assert not fit.used[1, 4]
    assert fit.used.sum() == 23
    np.testing.assert_allclose(fit.positions_mm, lights, rtol=0.02, atol=3)


def test_distant_lights_need_no_ranges(scene):
    rng = np.random.default_rng(0)
    directions = np.array([[0.3, 0.2, 0.9], [-0.4, 0.3, 0.8], [0.1, -0.5, 0.8], [0.0, 0.1, 1.0]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    highlights = np.array([[fermat(c, c + 1e7 * d) for d in directions] for c in CENTERS[:2]])
    highlights += 0.1 * rng.normal(size=highlights.shape)
    args = (CAMERA, _spheres(2), [0.05**2 * np.eye(3)] * 2, highlights, np.full((2, 4), 0.1), REFERENCE)
    distant, near = fit_lights(*args, near=False), fit_lights(*args, near=True)
    assert angular_error_deg(distant.directions, directions).max() < 0.6
    # The smaller model must win by BIC.
    assert distant.chi2_all - near.chi2_all < (near.unknowns - distant.unknowns) * np.log(near.observations) + 10


def test_rays_meet():
    target = np.array([100.0, -50.0, 200.0])
    points = np.array([[0.0, 0, 0], [50, 0, 0], [0, 80, 10]])
    directions = (target - points) / np.linalg.norm(target - points, axis=1, keepdims=True)
    np.testing.assert_allclose(ray_meeting(points, directions), target, atol=1e-9)
    assert np.isnan(ray_meeting(points[:2], directions[[0, 0]])).all()

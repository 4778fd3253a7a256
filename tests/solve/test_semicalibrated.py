"""Intensities from the object itself: exact where Lambert's law holds, robust where it does not, and doubted."""

from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, gloss, lights_along, matte, spiral
from scene.camera import Camera
from scene.frames import Frames
from scene.normals import angular_error_deg, unit
from solve.assess import shared_sigma_deg
from solve.pixelwise.iterative import IterativeSettings
from solve.problem import Problem
from solve.solve import solve
from solve.whole import semicalibrated

SIZE = 48
CAMERA = Camera(SIZE, SIZE, 110.0, 110.0, 23.0, 24.5)
V, U = (np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2) / (0.46 * SIZE)
MASK = U**2 + V**2 < 0.95
NORMALS = unit(np.stack([U + 0.1 * np.sin(9 * V), -V, np.sqrt(np.maximum(1 - U**2 - V**2, 0.01))], -1))
"""Of a bumpy ball."""
ALBEDO = 0.3 + 0.12 * np.sin(np.stack([7 * U, 5 * V, 6 * (U + V)], -1))


def find_lights(frames, lights):
    """The lights that `semicalibrated` finds, and its cautions."""
    problem = Problem.of(frames, lights, CAMERA, MASK)
    found = semicalibrated.find_lights(problem, IterativeSettings())
    return found.lights, found.cautions


def lights_around(count, *, seed, near=False):
    """Lights whose intensities differ threefold, channel by channel."""
    rng = np.random.default_rng(seed)
    zenith = np.radians(np.linspace(12, 50, count))
    directions = spiral(np.cos(zenith), first=rng.uniform(0, 6) / 2.4)
    center = np.array([0.0, 0.0, -600.0])
    positions = center + directions * rng.uniform(400, 900, (count, 1)) if near else None
    intensities = rng.uniform(0.5, 1.5, (count, 3))
    return lights_along(directions, intensities, positions_mm=positions, reference_point_mm=center).normalised()


def wrong(lights, share, seed=0):
    """The same lights with each intensity off by a share, at random."""
    factor = np.exp(share * np.random.default_rng(seed).standard_normal((len(lights), 3)))
    return replace(lights, intensities=lights.intensities * factor).normalised()


def photographs(lights, normals=NORMALS, depth=-600.0):
    return matte(lights, CAMERA.points_at_depth(CAMERA.grid(), depth), normals, ALBEDO)


@pytest.mark.parametrize("near", [False, True])
@pytest.mark.parametrize("count", [5, 16])
def test_exact_on_noiseless_lambertian_pixels_whatever_the_intensities(count, near):
    lights = lights_around(count, seed=10000 + count, near=near)
    images = photographs(lights)
    frames = as_floats(lights, images)
    found, doubts = find_lights(frames, wrong(lights, 0.5))
    assert not doubts
    relative = found.intensities / found.intensities.mean(0)
    np.testing.assert_allclose(relative, lights.intensities, rtol=1e-6)
    lit = MASK & (images > 0.05 * images.max((0, 3), keepdims=True)).all((0, 3))
    estimate = solve("semicalibrated", frames, wrong(lights, 0.5), CAMERA, MASK)
    assert angular_error_deg(estimate.normals, NORMALS)[lit].max() < 1e-4
    np.testing.assert_allclose(estimate.lights.intensities, found.intensities)


def error(method, given, frames):
    """The median error of a method's normals, degrees."""
    return float(np.median(angular_error_deg(solve(method, frames, given, CAMERA, MASK).normals, NORMALS)[MASK]))


def glossy(lights, seed):
    """Photographs with gloss, a cast shadow that moves over the object, and noise."""
    rng = np.random.default_rng(seed)
    shine = np.where(MASK, gloss(NORMALS, lights.directions, 60), 0)[..., None]
    images = photographs(lights) + 0.3 * lights.intensities[:, None, None] * shine
    for k in range(len(lights)):
        row, column = rng.integers(6, SIZE - 18, 2)
        images[k, row : row + 14, column : column + 12] *= 0.05
    return np.maximum(images + 0.002 * rng.standard_normal(images.shape), 0)


@pytest.mark.parametrize("seed", [10031, 10032, 10033])
def test_it_does_not_care_what_is_given_and_loses_little_where_that_is_right(seed):
    lights = lights_around(14, seed=seed)
    frames = Frames.from_linear(lights.names, 0.5 * glossy(lights, seed))
    mine = error("semicalibrated", lights, frames)
    assert mine < 1.15 * error("iterative", lights, frames)
    assert mine < 0.6 * error("iterative", wrong(lights, 0.1, seed), frames)
    assert error("semicalibrated", wrong(lights, 0.3, seed), frames) == pytest.approx(mine, abs=0.06)
    found, _ = find_lights(frames, wrong(lights, 0.3, seed))
    relative = found.intensities / found.intensities.mean(0) / lights.intensities
    assert np.abs(relative - 1).max() < 0.03
    assert np.nanmax(found.intensity_sigma) < 0.03


def test_a_trend_that_the_object_only_pretends_is_not_followed_and_a_real_one_is():
    """A surface that is brighter when lit from its own side looks like lights stronger on one side."""
    lights = lights_along(spiral(np.cos(np.radians(np.linspace(8, 40, 20))), first=1.5))
    x = lights.directions[:, 0]
    images = photographs(lights)
    images *= 1 + 0.2 * np.maximum(NORMALS[..., 0], 0)[..., None] * np.maximum(x, 0)[:, None, None, None]
    frames = as_floats(lights, images + 0.002 * np.random.default_rng(10081).standard_normal(images.shape))
    trend = replace(lights, intensities=lights.intensities / (1 + 0.2 * x[:, None])).normalised()
    assert error("semicalibrated", lights, frames) < 1.2 * error("iterative", lights, frames)
    assert error("semicalibrated", trend, frames) < 0.25 * error("iterative", trend, frames)


def test_sigma_of_the_normals_knows_the_covariance_of_the_intensities():
    rng, lights = np.random.default_rng(10091), lights_around(9, seed=10091)
    root = 0.01 * rng.normal(size=(9, 9))
    normals = spiral(np.linspace(0.5, 0.9, 7))
    stated = shared_sigma_deg(normals[None], lights.directions, root @ root.T)[0]
    factor = 1 + rng.normal(size=(20_000, 9)) @ root.T
    values = factor[:, None] * (normals @ lights.directions.T)
    moved = unit(values @ np.linalg.pinv(lights.directions).T)
    scatter = np.sqrt(np.mean(angular_error_deg(moved, normals) ** 2, 0) / 2)
    np.testing.assert_allclose(stated, scatter, rtol=0.03)


def test_near_lights_over_a_surface_before_the_reference_depth():
    """Fall-off and intensity would be confounded: the depth is found too, and beats right intensities without it."""
    lights = lights_around(12, seed=10061, near=True)
    frames = Frames.from_linear(lights.names, 0.5 * photographs(lights, depth=-550.0))
    found, _ = find_lights(frames, wrong(lights, 0.2))
    assert found.reference_point_mm[2] == pytest.approx(-550, abs=5)
    relative = found.seen_from([0, 0, -600]).intensities / lights.intensities
    assert np.abs(relative - 1).max() < 0.01
    assert error("semicalibrated", wrong(lights, 0.2), frames) < 0.2 * error("iterative", lights, frames)


def test_a_plane_and_three_lights_tell_nothing():
    plane = np.broadcast_to([0.2, -0.1, np.sqrt(0.95)], NORMALS.shape)
    for lights, shape in ((lights_around(6, seed=10041), plane), (lights_around(3, seed=10042), NORMALS)):
        images = photographs(lights, shape)
        for noise in (0, 0.002):
            images = images + noise * np.random.default_rng(10041).standard_normal(images.shape)
            given = wrong(lights, 0.1)
            found, doubts = find_lights(as_floats(lights, images), given)
            assert "cannot be told" in doubts[0]
            np.testing.assert_array_equal(found.intensities, given.intensities)

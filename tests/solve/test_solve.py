"""Solvers against scenes whose normals the test made."""

import contextlib
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, ball_seen, gloss, lights_along, matte, spiral
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.method_names import METHODS, UNCALIBRATED
from scene.normals import angular_error_deg
from solve.solve import solve

SIZE = 48
CALIBRATED = [method for method in METHODS if method not in UNCALIBRATED]
# `metal` supposes another law: see test_metal.
MATTE = [method for method in CALIBRATED if method != "metal"]

CAMERA = Camera(SIZE, SIZE, 110.0, 110.0, 23.0, 24.5)
POINTS, NORMALS, MASK = ball_seen(CAMERA, (0.0, 0.0, -600.0), 110.0, rim=0.35)
V, U = np.mgrid[:SIZE, :SIZE]
ALBEDO = 0.25 + 0.1 * np.sin(np.stack([U / 5, V / 7, (U + V) / 6], -1))


def lights_around(count=12, *, elevation_deg=55.0, near=False, seed=0):
    rng = np.random.default_rng(seed)
    directions = spiral(np.sin(np.radians(elevation_deg + 20 * np.sin(np.arange(count)))))
    intensities = rng.uniform(0.6, 1.4, (count, 3))
    reference = np.array([0.0, 0.0, -600.0])
    positions = reference + directions * rng.uniform(700, 1000, (count, 1)) if near else None
    return lights_along(
        directions, intensities / intensities.mean(0), positions_mm=positions, reference_point_mm=reference
    )


def shade(lights, points=POINTS, normals=NORMALS, mask=MASK):
    """Lambert with attached shadows, linear float64 (F, H, W, 3)."""
    return np.where(mask[..., None], matte(lights, points, normals, ALBEDO), 0)


def apart_deg(one, other):
    """Return by how much two estimates' normals, or an estimate's and given ones, differ (H, W)."""
    return angular_error_deg(one.normals, getattr(other, "normals", other))


@pytest.mark.parametrize("method", MATTE)
def test_exact_on_noiseless_lambertian_pixels_that_every_light_reaches(method):
    lights = lights_around(elevation_deg=65)
    mask = MASK & (np.einsum("hwi,fi->fhw", NORMALS, lights.directions) > 0.1).all(0)
    estimate = solve(method, as_floats(lights, shade(lights, mask=mask)), lights, CAMERA, mask)
    assert apart_deg(estimate, NORMALS)[mask].max() < 1e-4
    np.testing.assert_allclose(estimate.albedo[mask], ALBEDO[mask], rtol=1e-5)
    assert np.isnan(estimate.normals[~mask]).all()
    assert (estimate.samples[~mask] == 0).all()


# `near` and `reflectance` would integrate these normals, which are not the plane's.
@pytest.mark.parametrize("method", [method for method in MATTE if method not in ("near", "reflectance")])
def test_near_lights_are_exact_on_the_reference_plane_and_distant_ones_are_not(method):
    mask, points = np.ones((SIZE, SIZE), bool), CAMERA.points_at_depth(CAMERA.grid(), -600.0)
    normals = np.broadcast_to([0.1, -0.2, np.sqrt(0.95)], points.shape)
    lights = lights_around(near=True)
    frames = as_floats(lights, shade(lights, points, normals, mask))
    near, far = (solve(method, frames, one, CAMERA, mask) for one in (lights, replace(lights, positions_mm=None)))
    assert apart_deg(near, normals).max() < 1e-4
    assert np.median(apart_deg(far, normals)) > 1


@pytest.mark.parametrize("method", [*MATTE, pytest.param("metal", marks=pytest.mark.full)])
def test_laws_permutation_and_intensity(method):
    lights = lights_around(near=True)
    images = shade(lights)
    plain = solve(method, as_floats(lights, images), lights, CAMERA, MASK)

    order = np.random.default_rng(1).permutation(len(lights))
    mixed = lights.only(order)
    permuted = solve(method, as_floats(mixed, images[order]), mixed, CAMERA, MASK)
    # Rounding may end an iteration one step sooner: then the two differ by its tolerance.
    tolerance = 1e-3 if method in ("l1", "sbl", "reflectance") else 1e-4
    assert np.nanmax(apart_deg(permuted, plain)) < tolerance

    factor = np.linspace(0.5, 2, len(lights))[:, None]
    stronger = replace(lights, intensities=lights.intensities * factor)
    scaled = solve(method, as_floats(lights, images * factor[..., None, None]), stronger, CAMERA, MASK)
    assert np.nanmax(apart_deg(scaled, plain)) < tolerance
    np.testing.assert_allclose(scaled.albedo[MASK], plain.albedo[MASK], rtol=1e-4)


@pytest.mark.parametrize("method", MATTE)
def test_rotating_scene_lights_and_camera_together_rotates_the_normals(method):
    """A quarter turn of the picture: (x, y) -> (-y, x)."""
    lights = lights_around(elevation_deg=50)
    images = shade(lights)
    plain = solve(method, as_floats(lights, images), lights, CAMERA, MASK)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turned_lights = Lights(lights.names, lights.directions @ turn.T, lights.intensities)
    frames = as_floats(lights, np.rot90(images, axes=(1, 2)).copy())
    turned = solve(method, frames, turned_lights, CAMERA, np.rot90(MASK))
    assert np.nanmax(apart_deg(turned, np.rot90(plain.normals) @ turn.T)) < 1e-3


def test_iterative_beats_least_squares_under_gloss_and_cast_shadow():
    lights = lights_around(24)
    images = shade(lights) + 0.4 * np.where(MASK, gloss(NORMALS, lights.directions, 80), 0)[..., None]
    images[np.arange(24) % 6 == 0, 20:30] = 0
    frames = Frames.from_linear(lights.names, images)
    error = {
        m: np.mean(apart_deg(solve(m, frames, lights, CAMERA, MASK), NORMALS)[MASK])
        for m in ("ls", "iterative", "position", "l1", "sbl")
    }
    for robust in ("position", "l1", "sbl"):
        assert error[robust] < 0.6 * error["ls"]
    assert error["iterative"] < 1.0
    assert error["iterative"] < 0.25 * error["ls"]


# `hsh` has no defence against the shadows that are in every pixel here; for its clipped samples see its own tests.
@pytest.mark.parametrize("method", [method for method in MATTE if method != "hsh"])
def test_clipped_samples_do_not_enter(method):
    lights = lights_around(16)
    images = shade(lights)
    clean = solve(method, Frames.from_linear(lights.names, images), lights, CAMERA, MASK)
    images[3, 15:35, 15:35] = 5.0
    spoilt = solve(method, Frames.from_linear(lights.names, images), lights, CAMERA, MASK)
    inner = MASK & (clean.samples > 8)
    assert np.max(apart_deg(spoilt, NORMALS)[inner]) < 0.2


@pytest.mark.parametrize("elsewhere", [False, True], ids=["here", "in other processes"])
def test_bands_wherever_they_are_solved_and_garbage_outside_the_mask_change_nothing(elsewhere, monkeypatch):
    lights = lights_around(near=True)
    images = shade(lights)
    whole = solve("iterative", as_floats(lights, images), lights, CAMERA, MASK)
    monkeypatch.setattr("solve.samples._BAND_BYTES", 12 * SIZE * 3 * 4 * 5)
    images[:, ~MASK] = np.nan
    with contextlib.ExitStack() as stack:
        spawn = multiprocessing.get_context("spawn")
        executor = stack.enter_context(ProcessPoolExecutor(2, mp_context=spawn)) if elsewhere else None
        pieces = solve("iterative", as_floats(lights, images), lights, CAMERA, MASK, executor=executor)
    np.testing.assert_array_equal(pieces.normals, whole.normals)
    np.testing.assert_array_equal(pieces.albedo, whole.albedo)


def test_pixels_that_cannot_be_solved_are_unknown_and_counted():
    """A third of the ball is dark in all frames but two: no normal, and the estimate says so."""
    lights = lights_around()
    images = shade(lights)
    images[:, :20] = 5.0
    images[:2, :20] = 0.2
    estimate = solve("ls", Frames.from_linear(lights.names, images), lights, CAMERA, MASK)
    assert np.isnan(estimate.normals[:20]).all()
    assert any("no normal" in text for text in estimate.warnings)


GOOD = lights_along(np.eye(3))
FLAT = lights_along(np.array([[0, 0, 1.0], [0.6, 0, 0.8], [-0.6, 0, 0.8]]))
EVERYWHERE = np.ones((SIZE, SIZE), bool)


@pytest.mark.parametrize(
    ("method", "lights", "mask", "fault", "words"),
    [
        ("ls", FLAT, EVERYWHERE, CalibrationError, "one plane"),
        ("ls", GOOD.only(slice(2)), EVERYWHERE, CalibrationError, "at least 3"),
        ("tv", GOOD, EVERYWHERE, CalibrationError, "found 3 frames"),
        ("ls", GOOD, ~EVERYWHERE, SceneError, "mask is empty"),
        ("magic", GOOD, EVERYWHERE, SceneError, "unknown method"),
        ("ls", GOOD, EVERYWHERE[:10, :10], SceneError, "10 x 10"),
    ],
)
def test_faults_are_named(method, lights, mask, fault, words):
    frames = Frames.from_linear(GOOD.names, np.full((3, SIZE, SIZE, 3), 0.5))
    with pytest.raises(fault, match=words):
        solve(method, frames, lights, CAMERA, mask)

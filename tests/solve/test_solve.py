"""Solvers against scenes whose normals the test made."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, ball_seen, lights_along, matte, spiral
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from solve.methods import METHODS, UNCALIBRATED
from solve.solve import solve

SIZE = 48
CALIBRATED = [method for method in METHODS if method not in UNCALIBRATED]


def sphere(camera):
    """Points, normals and mask of an analytic ball seen by a perspective camera."""
    return ball_seen(camera, (0.0, 0.0, -600.0), 110.0, rim=0.35)


def lights_around(count=12, *, elevation_deg=55.0, near=False, seed=0):
    rng = np.random.default_rng(seed)
    directions = spiral(np.sin(np.radians(elevation_deg + 20 * np.sin(np.arange(count)))))
    intensities = rng.uniform(0.6, 1.4, (count, 3))
    reference = np.array([0.0, 0.0, -600.0])
    positions = reference + directions * rng.uniform(700, 1000, (count, 1)) if near else None
    return lights_along(
        directions, intensities / intensities.mean(0), positions_mm=positions, reference_point_mm=reference
    )


def shade(points, normals, mask, lights, albedo):
    """Lambert with attached shadows, linear float64 (F, H, W, 3)."""
    return np.where(mask[..., None], matte(lights, points, normals, albedo), 0)


@pytest.fixture
def camera():
    return Camera(SIZE, SIZE, 110.0, 110.0, 23.0, 24.5)


@pytest.fixture
def albedo():
    v, u = np.mgrid[:SIZE, :SIZE]
    return 0.25 + 0.1 * np.sin(np.stack([u / 5, v / 7, (u + v) / 6], -1))


@pytest.mark.parametrize("method", CALIBRATED)
def test_exact_on_noiseless_lambertian_pixels_that_every_light_reaches(method, camera, albedo):
    _, normals, mask = sphere(camera)
    lights = lights_around(elevation_deg=65)
    mask = mask & (np.einsum("hwi,fi->fhw", normals, lights.directions) > 0.1).all(0)
    images = shade(normals, normals, mask, lights, albedo)
    estimate = solve(method, as_floats(lights, images), lights, camera, mask)
    assert angular_error_deg(estimate.normals, normals)[mask].max() < 1e-4
    np.testing.assert_allclose(estimate.albedo[mask], albedo[mask], rtol=1e-5)
    assert np.isnan(estimate.normals[~mask]).all()
    assert (estimate.samples[~mask] == 0).all()


# `near` and `reflectance` would integrate these normals, which are not the plane's.
@pytest.mark.parametrize("method", [method for method in CALIBRATED if method not in ("near", "reflectance")])
def test_near_lights_are_exact_on_the_reference_plane_and_distant_ones_are_not(method, camera, albedo):
    mask = np.ones((SIZE, SIZE), bool)
    points = camera.points_at_depth(camera.grid(), -600.0)
    normals = np.broadcast_to([0.1, -0.2, np.sqrt(0.95)], points.shape)
    lights = lights_around(near=True)
    frames = as_floats(lights, shade(points, normals, mask, lights, albedo))
    near = angular_error_deg(solve(method, frames, lights, camera, mask).normals, normals)
    far = Lights(lights.names, lights.directions, lights.intensities, None, lights.reference_point_mm)
    assert near.max() < 1e-4
    assert np.median(angular_error_deg(solve(method, frames, far, camera, mask).normals, normals)) > 1


@pytest.mark.parametrize("method", CALIBRATED)
def test_axes_a_pixel_lit_from_above_left_faces_above_left(method, camera, albedo):
    points, normals, mask = sphere(camera)
    lights = lights_around()
    found = solve(
        method, Frames.from_linear(lights.names, shade(points, normals, mask, lights, albedo)), lights, camera, mask
    )
    rows, columns = np.nonzero(mask)
    top_left = (rows < rows.mean() - 8) & (columns < columns.mean() - 8)
    mean = found.normals[rows[top_left], columns[top_left]].mean(0)
    assert mean[0] < -0.2
    assert mean[1] > 0.2
    assert mean[2] > 0.3


@pytest.mark.parametrize("method", CALIBRATED)
def test_laws_permutation_and_intensity(method, camera, albedo):
    points, normals, mask = sphere(camera)
    lights = lights_around(near=True)
    images = shade(points, normals, mask, lights, albedo)
    plain = solve(method, as_floats(lights, images), lights, camera, mask)

    order = np.random.default_rng(1).permutation(len(lights))
    mixed = Lights(
        tuple(lights.names[i] for i in order),
        lights.directions[order],
        lights.intensities[order],
        lights.positions_mm[order],
        lights.reference_point_mm,
    )
    permuted = solve(method, as_floats(mixed, images[order]), mixed, camera, mask)
    # Rounding may end an iteration one step sooner: then the two differ by its tolerance.
    tolerance = 1e-3 if method in ("l1", "sbl", "reflectance") else 1e-4
    assert np.nanmax(angular_error_deg(permuted.normals, plain.normals)) < tolerance

    factor = np.linspace(0.5, 2, len(lights))[:, None]
    stronger = Lights(
        lights.names, lights.directions, lights.intensities * factor, lights.positions_mm, lights.reference_point_mm
    )
    scaled = solve(method, as_floats(lights, images * factor[..., None, None]), stronger, camera, mask)
    assert np.nanmax(angular_error_deg(scaled.normals, plain.normals)) < tolerance
    np.testing.assert_allclose(scaled.albedo[mask], plain.albedo[mask], rtol=1e-4)


@pytest.mark.parametrize("method", CALIBRATED)
def test_rotating_scene_lights_and_camera_together_rotates_the_normals(method, camera, albedo):
    """A quarter turn of the picture: (x, y) -> (-y, x)."""
    _, normals, mask = sphere(camera)
    lights = lights_around(elevation_deg=50)
    images = shade(normals, normals, mask, lights, albedo)
    plain = solve(method, as_floats(lights, images), lights, camera, mask)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    turned_lights = Lights(lights.names, lights.directions @ turn.T, lights.intensities)
    turned = solve(
        method, as_floats(lights, np.rot90(images, axes=(1, 2)).copy()), turned_lights, camera, np.rot90(mask)
    )
    assert np.nanmax(angular_error_deg(turned.normals, np.rot90(plain.normals) @ turn.T)) < 1e-3


def test_iterative_beats_least_squares_under_gloss_and_cast_shadow(camera, albedo):
    points, normals, mask = sphere(camera)
    lights = lights_around(24)
    images = shade(points, normals, mask, lights, albedo)
    half = lights.directions + [0.0, 0.0, 1.0]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    gloss = np.maximum(np.einsum("hwi,fi->fhw", normals, half), 0) ** 80
    images += 0.4 * np.where(mask, gloss, 0)[..., None]
    images[np.arange(24) % 6 == 0, 20:30] = 0
    frames = Frames.from_linear(lights.names, images)
    error = {
        m: np.mean(angular_error_deg(solve(m, frames, lights, camera, mask).normals, normals)[mask])
        for m in ("ls", "iterative", "position", "l1", "sbl")
    }
    for robust in ("position", "l1", "sbl"):
        assert error[robust] < 0.6 * error["ls"]
    assert error["iterative"] < 1.0
    assert error["iterative"] < 0.25 * error["ls"]


# `hsh` has no defence against the shadows that are in every pixel here; for its clipped samples see its own tests.
@pytest.mark.parametrize("method", [method for method in CALIBRATED if method != "hsh"])
def test_clipped_samples_do_not_enter(method, camera, albedo):
    points, normals, mask = sphere(camera)
    lights = lights_around(16)
    images = shade(points, normals, mask, lights, albedo)
    clean = solve(method, Frames.from_linear(lights.names, images), lights, camera, mask)
    images[3, 15:35, 15:35] = 5.0
    spoilt = solve(method, Frames.from_linear(lights.names, images), lights, camera, mask)
    inner = mask & (clean.samples > 8)
    assert np.max(angular_error_deg(spoilt.normals, normals)[inner]) < 0.2


def test_bands_and_garbage_outside_the_mask_change_nothing(camera, albedo, monkeypatch):
    points, normals, mask = sphere(camera)
    lights = lights_around(near=True)
    images = shade(points, normals, mask, lights, albedo)
    whole = solve("iterative", as_floats(lights, images), lights, camera, mask)
    monkeypatch.setattr("solve.samples._BAND_BYTES", 12 * SIZE * 3 * 4 * 5)
    images[:, ~mask] = np.nan
    pieces = solve("iterative", as_floats(lights, images), lights, camera, mask)
    np.testing.assert_array_equal(pieces.normals, whole.normals)
    np.testing.assert_array_equal(pieces.albedo, whole.albedo)


@pytest.mark.parametrize("method", ["ls", "iterative", "position", "l1", "sbl", "hsh", "rpca"])
def test_sixteen_bits_give_what_the_same_values_as_floats_give(method, camera, albedo):
    points, normals, mask = sphere(camera)
    lights = lights_around()
    images = shade(points, normals, mask, lights, albedo)
    images += 0.002 * np.random.default_rng(10_020).standard_normal(images.shape)
    frames = Frames.from_linear(lights.names, images)
    assert frames.codes.dtype == np.uint16
    coded = solve(method, frames, lights, camera, mask)
    floats = solve(method, as_floats(lights, frames.read()), lights, camera, mask)
    both = mask & np.isfinite(coded.normals).all(-1) & np.isfinite(floats.normals).all(-1)
    assert both.sum() == (mask & np.isfinite(coded.normals).all(-1)).sum()
    # A sample at a threshold's edge may fall on the other side of it by rounding: a handful of pixels.
    apart = angular_error_deg(coded.normals, floats.normals)[both]
    assert np.percentile(apart, 99) < 2e-3
    assert apart.max() < 0.5


def test_other_processes_give_what_this_one_gives(camera, albedo, monkeypatch):
    points, normals, mask = sphere(camera)
    lights = lights_around(near=True)
    frames = Frames.from_linear(lights.names, shade(points, normals, mask, lights, albedo))
    here = solve("iterative", frames, lights, camera, mask)
    monkeypatch.setattr("solve.samples._BAND_BYTES", 12 * SIZE * 3 * 2 * 9)
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        there = solve("iterative", frames, lights, camera, mask, executor=pool)
    np.testing.assert_array_equal(there.normals, here.normals)
    np.testing.assert_array_equal(there.albedo, here.albedo)


def test_pixels_that_cannot_be_solved_are_unknown_and_counted(camera, albedo):
    """A third of the ball is dark in all frames but two: no normal, and the estimate says so."""
    points, normals, mask = sphere(camera)
    lights = lights_around()
    images = shade(points, normals, mask, lights, albedo)
    images[:, :20] = 5.0
    images[:2, :20] = 0.2
    estimate = solve("ls", Frames.from_linear(lights.names, images), lights, camera, mask)
    assert np.isnan(estimate.normals[:20]).all()
    assert any("no normal" in text for text in estimate.warnings)


def test_faults_are_named(camera):
    frames = Frames.from_linear(("a", "b", "c"), np.full((3, SIZE, SIZE, 3), 0.5))
    mask = np.ones((SIZE, SIZE), bool)
    flat = np.array([[0, 0, 1.0], [0.6, 0, 0.8], [-0.6, 0, 0.8]])
    lights = Lights(("a", "b", "c"), flat, np.ones((3, 3)))
    with pytest.raises(CalibrationError, match="one plane"):
        solve("ls", frames, lights, camera, mask)
    with pytest.raises(CalibrationError, match="at least 3"):
        solve("ls", frames, Lights(("a", "b"), flat[:2], np.ones((2, 3))), camera, mask)
    good = Lights(("a", "b", "c"), np.eye(3), np.ones((3, 3)))
    with pytest.raises(SceneError, match="mask is empty"):
        solve("ls", frames, good, camera, ~mask)
    with pytest.raises(SceneError, match="unknown method"):
        solve("magic", frames, good, camera, mask)
    with pytest.raises(SceneError, match="10 x 10"):
        solve("ls", frames, good, camera, mask[:10, :10])

"""How far an estimate is to be believed: sigma and albedo against numpy and Monte Carlo; the photographs as judge."""

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, dome, even_cap, gloss, lights_along, matte, spiral
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from solve.codes import read_gray
from solve.problem import Problem
from solve.samples import GRAY, read_band
from solve.solve import solve
from solve.trust import LIMIT, trust

COUNT, HEIGHT, WIDTH = 24, 40, 50


def lights(low=0.5, high=0.95):
    return lights_along(spiral(np.linspace(low, high, COUNT)), np.linspace(0.7, 1.3, 3 * COUNT).reshape(-1, 3))


def plane(lights):
    """Linear images of a plane (F, H, W, 3), and its unit normal."""
    normal = unit(np.array([0.1, -0.2, 0.97]))
    normals = np.broadcast_to(normal, (HEIGHT, WIDTH, 3))
    return matte(lights, normals, normals, 0.4), normal


def run(method, frames, lights):
    return solve(method, frames, lights, Camera.orthographic(WIDTH, HEIGHT), np.ones((HEIGHT, WIDTH), bool))


@pytest.mark.parametrize("narrow", [[1, 0, 1], [0, 0, 1]], ids=["one plane", "one line"])
@pytest.mark.parametrize(("condition", "told"), [(40, True), (12, False)])
def test_lights_from_nearly_one_plane_or_line_are_told(narrow, condition, told):
    toward = spiral(np.linspace(0.5, 0.95, COUNT))
    squeezed = {share: unit(toward * np.maximum(narrow, share)) for share in np.geomspace(0.01, 1, 200)}
    seen = lights_along(min(squeezed.values(), key=lambda one: abs(np.linalg.cond(one) - condition)))
    images, _ = plane(seen)
    found = run("ls", as_floats(seen, images), seen)
    assert any("nearly one plane" in text for text in found.warnings) == told


@pytest.mark.parametrize("method", ["ls", "iterative", "l1", "sbl", "hsh"])
@pytest.mark.parametrize("heights", [(0.5, 0.95), (0.9, 0.98)])
def test_sigma_is_what_noise_does_to_the_normals(method, heights):
    """Two thousand pixels of a plane: the errors' scatter along a tangent is sigma, under wide and narrow lights."""
    seen = lights(*heights)
    # Of one intensity: weak flashes would be noisier than strong ones.
    seen = Lights(seen.names, seen.directions, np.ones((COUNT, 3)))
    images, normal = plane(seen)
    images += np.random.default_rng(1).normal(0, 0.004, images.shape)
    found = run(method, Frames.from_linear(seen.names, images), seen)
    error = angular_error_deg(found.normals, normal)
    scatter = np.sqrt(np.mean(error**2) / 2)
    stated = np.sqrt(np.mean(found.sigma_deg**2))
    assert 0.9 < stated / scatter < 1.1


@pytest.mark.parametrize("count", [12, 32])
@pytest.mark.parametrize("method", ["iterative", "l1", "sbl"])
def test_sigma_holds_for_methods_that_choose_their_samples_among_gloss_and_shadows(method, count):
    """A ball with attached shadows, and one sample in ten too bright: two errors in three are within sigma."""
    size, rng = 44, np.random.default_rng(count)
    normals, mask = dome(size, radius=0.5, rim=0.15**0.5)
    seen = lights_along(even_cap(count, 50.0))
    shade = matte(seen, normals, normals, 0.5)[..., :1]
    shade += np.where(rng.random(shade.shape) < 0.1, rng.uniform(0.1, 0.4, shade.shape), 0)
    images = (shade + rng.normal(0, 0.006, shade.shape)).repeat(3, -1)
    found = solve(method, as_floats(seen, images), seen, Camera.orthographic(size, size), mask)
    aside = unit(np.cross(normals, [0.0, 1.0, 0.0]))
    error = np.degrees(np.abs(np.einsum("hwi,hwi->hw", found.normals, aside)))
    within = np.nanquantile((error / found.sigma_deg)[mask], 0.683)
    # With few samples sigma itself scatters, as Student's distribution has it.
    assert 0.9 < within < (1.4 if count == 12 else 1.15)


def test_sigma_needs_a_fourth_sample_and_vanishes_without_noise():
    seen = lights()
    images, _ = plane(seen)
    three = Lights(seen.names[::8], seen.directions[::8], seen.intensities[::8])
    found = run("ls", Frames.from_linear(three.names, images[::8]), three)
    assert np.isnan(found.sigma_deg).all()
    assert any("three samples" in text for text in found.warnings)
    exact = run("ls", as_floats(seen, images), seen)
    assert exact.sigma_deg.max() < 0.01


@pytest.mark.parametrize("is_mosaic", [False, True])
@pytest.mark.parametrize("coded", [True, False])
def test_samples_are_what_frames_reads(is_mosaic, coded):
    """Gain, ambient light, clipped samples and their neighbours, a mask in crumbs, a band in the middle."""
    rng = np.random.default_rng(3)
    seen = lights()
    images, _ = plane(seen)
    images += rng.normal(0, 0.01, images.shape)
    images[rng.random(images.shape) < 0.002] = 1.0
    made = Frames.from_linear(seen.names, images, ambient=rng.uniform(0.01, 0.05, (HEIGHT, WIDTH, 3)))
    frames = Frames(
        seen.names,
        made.codes if coded else images.astype(np.float16),
        rng.uniform(0.8, 1.25, COUNT),
        made.ambient if coded else None,
        is_mosaic=is_mosaic,
    )
    mask, rows = rng.random((HEIGHT, WIDTH)) < 0.7, slice(7, 29)
    weights = (GRAY / seen.intensities).astype(np.float32)
    part = Problem.of(frames, seen, Camera.orthographic(WIDTH, HEIGHT), mask).part(rows)
    gray, valid = read_gray(read_band(part), weights)
    inside = mask[rows]
    expected = np.einsum("fpc,fc->pf", frames.read(rows)[:, inside], weights)
    np.testing.assert_allclose(gray, expected, atol=2e-7)
    np.testing.assert_array_equal(valid, ~frames.saturated(rows)[:, inside].T)
    assert 0.001 < (~valid).mean() < 0.2


SIZE, FLASHES = 40, 14
CAMERA = Camera.orthographic(SIZE, SIZE)


@pytest.fixture(scope="module")
def glossy():
    """Frames, lights, mask and true normals (H, W, 3) of a dome with gloss, shadowed at its foot."""
    normals, mask = dome(SIZE, radius=0.5, rim=0.45)
    lights = lights_along(even_cap(FLASHES, 45.0))
    images = matte(lights, normals, normals, 0.5) + 0.3 * gloss(normals, lights.directions, 40)[..., None]
    images += np.random.default_rng(3).normal(0, 0.002, (FLASHES, SIZE, SIZE, 1))
    return as_floats(lights, images), lights, mask, normals


@pytest.fixture(scope="module")
def answers(glossy):
    """Each method's normals, and those of another program, which are flat."""
    frames, lights, mask, _ = glossy
    found = {name: solve(name, frames, lights, CAMERA, mask).normals for name in ("ls", "iterative", "hsh")}
    return {**found, "Flat": np.where(mask[..., None], [0.0, 0.0, 1.0], np.nan)}


def test_the_method_that_errs_least_is_recommended_and_the_others_follow(glossy, answers):
    frames, lights, mask, normals = glossy
    true = {name: np.nanmean(angular_error_deg(found, normals)[mask]) for name, found in answers.items()}
    judged = trust(frames, lights, CAMERA, mask, answers)
    assert list(judged.methods) == sorted(true, key=lambda name: true[name])
    assert judged.recommended == "iterative"
    assert judged.methods["iterative"].apart_deg < 1e-3
    assert judged.methods["Flat"].unexplained is None
    assert judged.relative_rmse < LIMIT
    assert not judged.doubts
    error = angular_error_deg(answers["iterative"], normals)[mask]
    assert np.mean(error < 2 * judged.sigma_deg[mask]) > 0.9
    farther = angular_error_deg(answers["hsh"], answers["iterative"])[mask]
    assert np.median(judged.sigma_deg[mask]) < 1.5 * np.median(farther), "not by being large"
    assert np.isnan(judged.sigma_deg[~mask]).all()
    assert np.isfinite(judged.sigma_deg[mask]).all(), "as the nearest judged pixel has it"


@pytest.mark.full
def test_lights_that_are_anothers_are_doubted(glossy, answers):
    frames, lights, mask, _ = glossy
    rolled = Lights(lights.names, np.roll(lights.directions, 3, axis=0), lights.intensities)
    judged = trust(frames, rolled, CAMERA, mask, {"iterative": answers["iterative"]})
    assert judged.relative_rmse > LIMIT
    assert "not to be believed" in judged.doubts[0]


def test_without_lights_methods_of_ours_or_frames_nothing_is_judged(glossy, answers):
    frames, lights, mask, _ = glossy
    with pytest.raises(SceneError, match=r"calibrated lights; found none"):
        trust(frames, Lights.unknown(lights.names), CAMERA, mask, answers)
    with pytest.raises(SceneError, match="found none"):
        trust(frames, lights, CAMERA, mask, {"Flat": answers["Flat"]})
    with pytest.raises(SceneError, match="found 5 frames"):
        trust(frames.only(slice(5)), lights.only(slice(5)), CAMERA, mask, answers)

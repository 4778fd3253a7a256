"""Normals of metals, whose lobes the test computes by a law written apart from the product's."""

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, ball_seen, gloss, lights_along, matte, spiral
from scene.camera import Camera
from scene.frames import Frames
from scene.normals import angular_error_deg
from solve.frames_at_odds import at_odds
from solve.samples import Geometry, Samples
from solve.solve import solve
from solve.trust import trust
from solve.whole.metal import found

SIZE = 48
CAMERA = Camera(SIZE, SIZE, 110.0, 110.0, 23.0, 24.5)
CENTRE = np.array([0.0, 0.0, -600.0])
POINTS, NORMALS, MASK = ball_seen(CAMERA, tuple(CENTRE), 110.0, rim=0.35)
COLOUR = np.array([0.9, 0.6, 0.3])


def lights_over(count=24, *, distance_mm=None):
    directions = spiral(np.sin(np.radians(np.linspace(88, 25, count))))
    positions = None if distance_mm is None else CENTRE + distance_mm * directions
    return lights_along(directions, np.full((count, 3), 1.0), positions_mm=positions, reference_point_mm=CENTRE)


def bronze(lights, alpha, *, colour=COLOUR, normals=NORMALS):
    """Return (F, H, W, 3) of facets whose heights correlate, G as Heitz wrote it in 2014: a law near the product's."""
    view = -POINTS / np.linalg.norm(POINTS, axis=-1, keepdims=True)
    vectors = lights.at(POINTS.reshape(-1, 3)).reshape(len(lights), SIZE, SIZE, 3, 3)
    power = np.linalg.norm(vectors, axis=-1)
    light = vectors[..., 1, :] / power[..., 1:2]
    half = (light + view) / np.linalg.norm(light + view, axis=-1, keepdims=True)
    nl, nv, nh = (np.clip((normals * other).sum(-1), 1e-6, 1) for other in (light, view, half))
    hidden = sum((np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1) / 2 for cosine in (nl, nv))
    slopes = alpha**2 / (np.pi * (1 + nh**2 * (alpha**2 - 1)) ** 2)
    value = np.where((normals * light).sum(-1) > 0, np.pi * slopes / (4 * nv) / (1 + hidden), 0)
    images = value[..., None] * power * colour
    return np.where(MASK[..., None], images, 0)


def off(estimate):
    return angular_error_deg(estimate.normals, NORMALS)[MASK]


@pytest.mark.parametrize("alpha", [0.1, 0.2, 0.35])
def test_where_a_flash_is_mirrored_the_normal_is_right_and_elsewhere_its_sigma_says_so(alpha):
    lights = lights_over(distance_mm=2500.0)
    frames = as_floats(lights, 0.2 * bronze(lights, alpha))
    found, matte_too = (solve(method, frames, lights, CAMERA, MASK) for method in ("metal", "iterative"))
    one, _ = at_odds(frames, lights, CAMERA, MASK)
    assert one.alpha == pytest.approx(alpha, rel=0.1)
    sigma, error = found.sigma_deg[MASK], off(found)
    sure = sigma < 10
    assert sure.mean() > 0.15
    assert np.median(error[sure]) < 1 < 8 < np.nanmedian(off(matte_too))
    assert np.mean(error < 2.45 * sigma) > 0.95, "Rayleigh's 95 %"
    known = sure & np.isfinite(found.albedo[MASK]).all(1)
    np.testing.assert_allclose(np.median(found.albedo[MASK][known], 0), 0.2 * COLOUR, rtol=0.15)


def test_light_by_way_of_other_surfaces_widens_sigma():
    """A wall that steep parts mirror, as bright as a tenth of the highlights: what is wrong is said to be unsure."""
    lights = lights_over()
    clean, wall = 0.2 * bronze(lights, 0.2), np.abs(NORMALS[..., :1]) * np.linspace(0, 1, 24)[:, None, None, None]
    found = solve("metal", as_floats(lights, clean + 0.1 * clean.max() * wall), lights, CAMERA, MASK)
    assert np.percentile(off(found), 90) > 10
    assert np.mean(off(found) < 2.45 * found.sigma_deg[MASK]) > 0.95


def test_clipped_samples_do_not_enter():
    lights = lights_over()
    images = 0.2 * bronze(lights, 0.2)
    images *= 0.9 / images.max()
    clean = solve("metal", Frames.from_linear(lights.names, images), lights, CAMERA, MASK)
    images[3, 15:35, 15:35] = 5.0
    spoilt = solve("metal", Frames.from_linear(lights.names, images), lights, CAMERA, MASK)
    assert np.median(off(spoilt)) < np.median(off(clean)) + 0.5
    assert spoilt.samples[MASK].min() == clean.samples[MASK].min() - 1


@pytest.mark.full
def test_matte_and_glossy_objects_are_no_metals_and_that_is_said():
    lights = lights_over(distance_mm=2500.0)
    body = matte(lights, POINTS, NORMALS, 0.4 * np.ones((SIZE, SIZE, 3)))
    for images in (body, body + 0.3 * gloss(NORMALS, lights.directions, 40.0)[..., None]):
        frames = as_floats(lights, np.where(MASK[..., None], images, 0))
        assert at_odds(frames, lights, CAMERA, MASK)[0] is None
        (said,) = [text for text in solve("metal", frames, lights, CAMERA, MASK).warnings if "metal does" in text]
        assert "not to be believed" in said


ROW, COLUMN = np.mgrid[:SIZE, :SIZE]
PAINTS = {
    "plain": np.full((SIZE, SIZE), 0.4),
    "white band": np.where((ROW > 20) & (ROW < 26), 0.9, 0.08),
    "white patches": np.where((ROW // 5 + COLUMN // 5) % 5 == 0, 0.9, 0.05),
}


def reversed_frames(images, albedo):
    return images[::-1].copy()


def lamp(images, albedo):
    return images + np.where(np.arange(24) < 12, 0, 0.3)[:, None, None, None] * np.where(MASK, albedo, 0)[..., None]


def shadows(images, albedo):
    hidden = np.random.default_rng(0).random((24, 1, SIZE, 1)) < 0.4
    return np.where(hidden & (abs(COLUMN - 25) < 15)[..., None], 0.05, 1) * images


def painted(paint):
    """Lights, and images of a ball in this paint."""
    lights = lights_over()
    return lights, np.where(MASK[..., None], matte(lights, POINTS, NORMALS, PAINTS[paint][..., None] * np.ones(3)), 0)


@pytest.mark.parametrize("fault", [None, reversed_frames, lamp, shadows])
@pytest.mark.parametrize("paint", PAINTS)
def test_paint_is_no_metal_under_whatever_fault(paint, fault):
    """In bright and dark it looks like narrow lobes to what takes the object for of one value."""
    lights, images = painted(paint)
    frames = as_floats(lights, fault(images, PAINTS[paint]) if fault else images)
    assert at_odds(frames, lights, CAMERA, MASK)[0] is None


def test_the_method_says_so_of_paint():
    lights, images = painted("white band")
    (said,) = solve("metal", as_floats(lights, images), lights, CAMERA, MASK).warnings
    assert "not to be believed" in said


@pytest.mark.parametrize("times", [2, 4, 8, 1e6])
def test_what_is_clipped_is_no_metal_and_has_no_normal(times):
    lights = lights_over()
    images = np.where(MASK[..., None], matte(lights, POINTS, NORMALS, 0.8 * np.ones((SIZE, SIZE, 3))), 0)
    frames = Frames.from_linear(lights.names, times * images)
    assert at_odds(frames, lights, CAMERA, MASK)[0] is None
    found = solve("metal", frames, lights, CAMERA, MASK)
    lit = found.samples >= 3
    assert np.isnan(found.normals[~lit]).all()
    assert np.isnan(found.sigma_deg[~lit]).all()
    assert np.isfinite(found.normals[MASK & lit]).all()


@pytest.mark.parametrize("pixels", [0, 5])
def test_nothing_is_learnt_of_too_few_pixels(pixels):
    lights = lights_over(6)
    samples = Samples(
        np.ones((pixels, 6), np.float32), np.ones((pixels, 6), bool), np.zeros((pixels, 3)),
        Geometry.distant(lights.directions),
    )  # fmt: skip
    assert found(samples, np.tile([0.0, 0.0, 1.0], (pixels, 1))) is None


def test_a_light_straight_behind_and_a_mask_that_thins_to_nothing_are_met():
    lights = lights_over()
    camera, behind = Camera.orthographic(SIZE, SIZE), lights_along(np.vstack([lights.directions, [0, 0, -1.0]]))
    images = np.concatenate([0.2 * bronze(lights, 0.2), np.zeros((1, SIZE, SIZE, 3))])
    frames = as_floats(behind, images)
    assert at_odds(frames, behind, camera, MASK)[0] is not None
    assert np.isfinite(solve("metal", frames, behind, camera, MASK).normals[MASK]).all()
    row = np.zeros((3, 5000), bool)
    row[1] = True
    empty = as_floats(lights, np.zeros((24, 3, 5000, 3)))
    assert at_odds(empty, lights, Camera.orthographic(5000, 3), row) == (None, [])


@pytest.mark.full
def test_the_photographs_recommend_it_for_a_metal():
    lights = lights_over()
    frames = as_floats(lights, 0.2 * bronze(lights, 0.25))
    answers = {name: solve(name, frames, lights, CAMERA, MASK).normals for name in ("ls", "iterative", "sbl", "metal")}
    told = trust(frames, lights, CAMERA, MASK, answers)
    assert told.recommended == "metal"
    assert all("mirror no flash" in doubt for doubt in told.doubts)


@pytest.mark.full
def test_the_photographs_do_not_recommend_it_for_paint():
    lights, images = painted("white band")
    frames = as_floats(lights, images)
    answers = {name: solve(name, frames, lights, CAMERA, MASK).normals for name in ("iterative", "metal")}
    told = trust(frames, lights, CAMERA, MASK, answers)
    assert told.recommended == "iterative"
    assert told.methods["metal"].unexplained is None, "it is not judged"

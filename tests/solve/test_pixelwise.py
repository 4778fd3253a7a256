"""One pixel at a time: each method against the definition that it computes, and where it must fail and say so."""

import numpy as np
import pytest
from scipy.optimize import linprog

from fixtures.lit_surfaces import as_samples, lights_along, spiral
from scene.errors import SceneError
from scene.method_names import METHODS
from scene.normals import angular_error_deg, unit
from solve.methods import method_of
from solve.pixelwise import hsh, l1, sbl
from solve.problem import Problem

COUNT = 16


def cap(low=0.6, high=0.95, count=COUNT):
    """Lights (F, 3) around a cap between two heights, z."""
    return spiral(np.linspace(low, high, count))


def facing(pixels, seed=0):
    """B (P, 3) of pixels that all lights of a cap reach."""
    rng = np.random.default_rng(seed)
    b = np.stack([*rng.uniform(-0.2, 0.2, (2, pixels)), np.ones(pixels)], -1)
    return b * rng.uniform(0.3, 0.6, (pixels, 1))


def fitted(name, gray, directions, settings="default", valid=None):
    method = method_of(name)
    settings = method.settings(settings) if isinstance(settings, str) else settings
    return method.fit(as_samples(gray, directions, valid), 1.0, settings)


def away_deg(b, truth):
    return angular_error_deg(unit(b), unit(truth))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_has_the_seeds_profile_with_the_same_names(method):
    found = method_of(method)
    assert found.name == method
    assert type(found.settings("seed")) is type(found.settings("default"))
    with pytest.raises(SceneError, match=r"no profile 'x'; there are default, .*seed"):
        found.settings("x")


def test_the_seeds_least_squares_keeps_what_is_clipped():
    directions, front = cap(), np.array([[0, 0, 1.0]])
    samples = 1.5 * front @ directions.T
    valid, samples = samples <= 1, np.minimum(samples, 1.0)
    assert away_deg(fitted("ls", samples, directions, valid=valid)[0], front)[0] < 1e-3
    b, used = fitted("ls", samples, directions, "seed", valid)
    assert used.all()
    assert away_deg(b, front)[0] > 1


@pytest.mark.parametrize("profile", ["default", "seed"])
def test_position_outside_the_band_any_value_is_as_good_inside_it_is_not(profile):
    """Four highlights of twenty above the band: exact. A fifth stands inside: wrong."""
    directions, b = cap(0.7, count=20), facing(200)
    samples = b @ directions.T
    glossy, order = samples.copy(), np.argsort(samples, 1)
    np.put_along_axis(glossy, order[:, -4:], 3.0, 1)
    found, used = fitted("position", glossy, directions, profile)
    np.testing.assert_allclose(found, b, atol=1e-6)
    assert (used.sum(1) == 12).all()
    assert not (used & (glossy == 3.0)).any()
    np.put_along_axis(glossy, order[:, -5:], 3.0, 1)
    assert np.abs(fitted("position", glossy, directions, profile)[0] - b).max() > 0.1
    found, used = fitted("position", samples, directions, profile, np.zeros(samples.shape, bool))
    assert not found.any(), "a pixel whose samples are all clipped is unknown"
    assert not used.any()


def test_hsh_lambertian_samples_are_exact_by_default_and_nearly_so_by_three_lights_and_clipped_ones_do_not_enter():
    directions, b = cap(0.5, 0.98, 48), facing(100)
    samples = b @ directions.T
    assert (samples > 0).all()
    assert away_deg(fitted("hsh", samples, directions)[0], b).max() < 1e-4
    assert 0.01 < away_deg(fitted("hsh", samples, directions, "seed")[0], b).max() < 0.5
    valid = np.random.default_rng(0).random(samples.shape) > 0.2
    found, used = fitted("hsh", np.where(valid, samples, 9.0), directions, valid=valid)
    assert away_deg(found, b).max() < 1e-4
    np.testing.assert_array_equal(used, valid)


def under(directions):
    """Return a problem of which the lights alone are known."""
    return Problem(None, lights_along(directions), None, None, slice(0))


@pytest.mark.parametrize("directions", [cap(0.7, 0.7, 24), cap(0.96, 0.99, 24), cap(0.4, 0.98, 8)])
def test_hsh_a_ring_a_narrow_set_and_too_few_lights_are_said_to_be_singular(directions):
    (said,) = hsh.warned(under(directions), hsh.SEED).cautions
    assert "order 2 has 9 terms" in said
    assert "not to be believed" in said
    assert hsh.warned(under(cap(0.3, 0.98, 48)), hsh.SEED).cautions == ()


def spoilt(outliers, *, noise=0.0, seed=0):
    """Lights, b (P, 3), samples (P, F) of which some are too bright."""
    rng, directions, b = np.random.default_rng(seed), cap(), facing(40, seed)
    samples = b @ directions.T + noise * rng.standard_normal((40, COUNT))
    for row in samples:
        row[rng.choice(COUNT, outliers, replace=False)] += rng.uniform(0.1, 0.4, outliers)
    return directions, b, samples


@pytest.mark.parametrize("method", ["l1", "sbl"])
@pytest.mark.parametrize("profile", ["default", "seed"])
def test_a_quarter_of_outliers_leaves_the_rest_exact_and_they_are_not_counted(method, profile):
    directions, b, samples = spoilt(4)
    found, used = fitted(method, samples, directions, profile)
    error = np.linalg.norm(found - b, axis=1)
    assert np.median(error) < 1e-4
    good = error < 1e-3
    assert good.mean() > 0.9
    np.testing.assert_array_equal(used[good], np.isclose(samples, b @ directions.T)[good])


def test_l1_reaches_the_least_sum_that_linear_programming_finds():
    directions, _, samples = spoilt(7, noise=0.01, seed=1)
    found, _ = fitted("l1", samples, directions, l1.SEED)
    one = np.eye(COUNT)
    limits = np.block([[directions, -one], [-directions, -one]])
    goal, bounds = np.r_[np.zeros(3), np.ones(COUNT)], [(None, None)] * 3 + [(0, None)] * COUNT
    for m, b in zip(samples, found, strict=True):
        least = linprog(goal, limits, np.r_[m, -m], bounds=bounds).fun
        assert np.abs(m - directions @ b).sum() == pytest.approx(least, rel=1e-4)


def test_sbl_is_the_loop_over_matrices_written_out():
    directions, _, samples = spoilt(5, noise=0.01, seed=3)
    found, _ = fitted("sbl", samples, directions, sbl.SEED._replace(iterations=12, tolerance=0.0))
    for m, b in zip(samples, found, strict=True):
        inverse = np.ones(COUNT)
        x = np.linalg.lstsq(directions, m, rcond=None)[0]
        for _ in range(12):
            covariance = np.linalg.inv(directions.T @ np.diag(inverse) @ directions + np.eye(3))
            spread = np.einsum("fi,ij,fj->f", directions, covariance, directions)
            inverse = 1 / np.maximum((m - directions @ x) ** 2 + spread, 1e-8)
            weights = np.diag(inverse)
            x = np.linalg.solve(directions.T @ weights @ directions, directions.T @ weights @ m)
        np.testing.assert_allclose(b, x, rtol=1e-4)

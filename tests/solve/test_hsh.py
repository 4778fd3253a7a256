"""Hemispherical harmonics: orthonormal, exact on Lambertian samples by default, singular on a ring."""

import numpy as np
import pytest

from fixtures.lit_surfaces import spiral
from solve.pixelwise import hsh
from solve.samples import Geometry, Samples


def lights(count, low, high):
    """Lights on a golden spiral between two heights, z."""
    return spiral(np.linspace(low, high, count), turn=2.39996)


def fitted(gray, directions, settings, valid=None):
    valid = np.ones(gray.shape, bool) if valid is None else valid
    points = np.zeros((len(gray), 3))
    return hsh.fit(Samples(gray.astype(np.float32), valid, points, Geometry.distant(directions)), 1.0, settings)


def away_deg(b, truth):
    b = b / np.linalg.norm(b, axis=1, keepdims=True)
    return np.degrees(np.arccos(np.clip(np.sum(b * truth, 1), -1, 1)))


def normals_near_the_axis(count, seed=0):
    n = np.stack([*np.random.default_rng(seed).uniform(-0.25, 0.25, (2, count)), np.ones(count)], -1)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def test_lambertian_samples_are_exact_by_default_and_nearly_so_by_three_lights():
    directions, normals = lights(48, 0.5, 0.98), normals_near_the_axis(100)
    samples = 0.4 * normals @ directions.T
    assert (samples > 0).all()
    assert away_deg(fitted(samples, directions, hsh.HshSettings())[0], normals).max() < 1e-4
    plain = away_deg(fitted(samples, directions, hsh.SEED)[0], normals)
    assert 0.01 < plain.max() < 0.5


def test_clipped_samples_do_not_enter():
    directions, normals = lights(48, 0.5, 0.98), normals_near_the_axis(20, 2)
    samples = 0.4 * normals @ directions.T
    valid = np.random.default_rng(0).random(samples.shape) > 0.2
    b, used = fitted(np.where(valid, samples, 9.0), directions, hsh.HshSettings(), valid)
    assert away_deg(b, normals).max() < 1e-4
    np.testing.assert_array_equal(used, valid)


@pytest.mark.parametrize("directions", [lights(24, 0.7, 0.7), lights(24, 0.96, 0.99), lights(8, 0.4, 0.98)])
def test_a_ring_a_narrow_set_and_too_few_lights_are_said_to_be_singular(directions):
    (said,) = hsh.cautions_of(directions, hsh.SEED)
    assert "order 2 has 9 terms" in said
    assert "not to be believed" in said
    assert hsh.cautions_of(lights(48, 0.3, 0.98), hsh.SEED) == ()

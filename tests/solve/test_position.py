"""Rank bands: what lies outside of the band cannot matter, what lies inside does."""

import numpy as np

from solve.pixelwise.position import METHOD, fit
from solve.samples import Geometry, Samples

DEFAULT, SEED = METHOD.settings("default"), METHOD.settings("seed")

LIGHTS = 20


def scene(seed=0, pixels=200):
    """Lights around a cap, normals that all of them reach, samples (P, F)."""
    rng = np.random.default_rng(seed)
    azimuth, z = np.arange(LIGHTS) * 2.4, np.linspace(0.7, 0.95, LIGHTS)
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)
    normals = np.stack([*rng.uniform(-0.2, 0.2, (2, pixels)), np.ones(pixels)], -1)
    normals *= rng.uniform(0.2, 0.6, (pixels, 1)) / np.linalg.norm(normals, axis=1, keepdims=True)
    return directions, normals, normals @ directions.T


def fitted(gray, directions, settings, valid=None):
    valid = np.ones(gray.shape, bool) if valid is None else valid
    points = np.zeros((len(gray), 3))
    return fit(Samples(gray.astype(np.float32), valid, points, Geometry.distant(directions)), 1.0, settings)


def test_outside_the_band_any_value_is_as_good_inside_it_is_not():
    """Four highlights of twenty above the band: exact. A fifth stands inside: wrong."""
    directions, b, samples = scene()
    for settings in (DEFAULT, SEED):
        glossy = samples.copy()
        np.put_along_axis(glossy, np.argsort(samples, 1)[:, -4:], 3.0, 1)
        found, used = fitted(glossy, directions, settings)
        np.testing.assert_allclose(found, b, atol=1e-6)
        assert (used.sum(1) == 12).all()
        assert not (used & (glossy == 3.0)).any()
        np.put_along_axis(glossy, np.argsort(samples, 1)[:, -5:], 3.0, 1)
        assert np.abs(fitted(glossy, directions, settings)[0] - b).max() > 0.1


def test_a_pixel_whose_samples_are_all_clipped_is_unknown():
    directions, _, samples = scene(2, 1)
    found, used = fitted(samples, directions, DEFAULT, np.zeros(samples.shape, bool))
    assert not found.any()
    assert not used.any()

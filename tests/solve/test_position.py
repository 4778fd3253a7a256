"""Rank bands: what lies outside of the band cannot matter, what lies inside does."""

import numpy as np

from solve.pixelwise import position

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


def fitted(samples, directions, settings):
    zero = np.zeros_like(directions)
    return position.fit(
        samples.astype(np.float32),
        np.ones(samples.shape, bool),
        np.zeros((len(samples), 3)),
        directions,
        zero,
        zero[:, 0],
        False,
        1.0,
        **settings,
    )


def test_outside_the_band_any_value_is_as_good_inside_it_is_not():
    """Four highlights of twenty above the band: exact. A fifth stands inside: wrong."""
    directions, b, samples = scene()
    for settings in (position.SETTINGS, position.SEED_SETTINGS):
        glossy = samples.copy()
        np.put_along_axis(glossy, np.argsort(samples, 1)[:, -4:], 3.0, 1)
        found, used = fitted(glossy, directions, settings)
        np.testing.assert_allclose(found, b, atol=1e-6)
        assert (used.sum(1) == 12).all()
        assert not (used & (glossy == 3.0)).any()
        np.put_along_axis(glossy, np.argsort(samples, 1)[:, -5:], 3.0, 1)
        assert np.abs(fitted(glossy, directions, settings)[0] - b).max() > 0.1


def test_shadows_take_no_rank_by_default_and_do_in_the_plain_reading():
    """Eight of twenty are dark: the plain band reaches into them."""
    directions, b, samples = scene(1)
    np.put_along_axis(samples, np.argsort(samples, 1)[:, :8], 0.001, 1)
    np.testing.assert_allclose(fitted(samples, directions, position.SETTINGS)[0], b, atol=1e-6)
    assert np.abs(fitted(samples, directions, position.SEED_SETTINGS)[0] - b).max() > 0.05


def test_a_pixel_whose_samples_are_all_clipped_is_unknown():
    directions, _, samples = scene(2, 1)
    zero = np.zeros_like(directions)
    values, none = samples.astype(np.float32), np.zeros(samples.shape, bool)
    found, used = position.fit(
        values, none, np.zeros((1, 3)), directions, zero, zero[:, 0], False, 1.0, **position.SETTINGS
    )
    assert not found.any()
    assert not used.any()

"""`l1` and `sbl` against the definitions they compute: a linear programme, and a loop written out with numpy.linalg."""

import numpy as np
import pytest
from scipy.optimize import linprog

from solve.pixelwise import l1, sbl
from solve.samples import Geometry, Samples

LIGHTS = 16


def scene(outliers, *, pixels=40, seed=0):
    """Lights around a cap, b (P, 3), samples (P, F) of which some are too bright or dark."""
    rng = np.random.default_rng(seed)
    azimuth, z = np.arange(LIGHTS) * 2.4, np.linspace(0.6, 0.95, LIGHTS)
    across = np.sqrt(1 - z**2)
    directions = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), z], -1)
    b = np.stack([*rng.uniform(-0.2, 0.2, (2, pixels)), np.ones(pixels)], -1) * rng.uniform(0.3, 0.6, (pixels, 1))
    samples = b @ directions.T
    for row in samples:
        row[rng.choice(LIGHTS, outliers, replace=False)] += rng.uniform(0.1, 0.4, outliers)
    return directions, b, samples


def fitted(module, gray, directions, settings, scale=1.0):
    valid, points = np.ones(gray.shape, bool), np.zeros((len(gray), 3))
    return module.fit(Samples(gray.astype(np.float32), valid, points, Geometry.distant(directions)), scale, settings)


@pytest.mark.parametrize("module", [l1, sbl])
@pytest.mark.parametrize("profile", ["default", "seed"])
def test_a_quarter_of_outliers_leaves_the_rest_exact_and_they_are_not_counted(module, profile):
    directions, b, samples = scene(4)
    found, used = fitted(module, samples, directions, module.METHOD.settings(profile))
    error = np.linalg.norm(found - b, axis=1)
    assert np.median(error) < 1e-4
    good = error < 1e-3
    assert good.mean() > 0.9
    np.testing.assert_array_equal(used[good], np.isclose(samples, b @ directions.T)[good])


def test_l1_reaches_the_least_sum_that_linear_programming_finds():
    directions, _, samples = scene(7, seed=1)
    samples += np.random.default_rng(2).normal(0, 0.01, samples.shape)
    found, _ = fitted(l1, samples, directions, l1.SEED)
    one = np.eye(LIGHTS)
    for m, b in zip(samples, found, strict=True):
        limits = np.block([[directions, -one], [-directions, -one]])
        least = linprog(
            np.r_[np.zeros(3), np.ones(LIGHTS)],
            limits,
            np.r_[m, -m],
            bounds=[(None, None)] * 3 + [(0, None)] * LIGHTS,
        ).fun
        assert np.abs(m - directions @ b).sum() == pytest.approx(least, rel=1e-4)


def test_sbl_is_the_loop_over_matrices_written_out():
    directions, _, samples = scene(5, seed=3)
    samples += np.random.default_rng(4).normal(0, 0.01, samples.shape)
    settings = sbl.SEED._replace(iterations=12, tolerance=0.0)
    found, _ = fitted(sbl, samples, directions, settings)
    for m, b in zip(samples, found, strict=True):
        inverse = np.ones(LIGHTS)
        x = np.linalg.lstsq(directions, m, rcond=None)[0]
        for _ in range(12):
            covariance = np.linalg.inv(directions.T @ np.diag(inverse) @ directions + np.eye(3))
            spread = np.einsum("fi,ij,fj->f", directions, covariance, directions)
            inverse = 1 / np.maximum((m - directions @ x) ** 2 + spread, 1e-8)
            weights = np.diag(inverse)
            x = np.linalg.solve(directions.T @ weights @ directions, directions.T @ weights @ m)
        np.testing.assert_allclose(b, x, rtol=1e-4)

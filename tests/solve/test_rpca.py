"""Robust principal components: a matrix, and normals, that the test made."""

import numpy as np

from fixtures.lit_surfaces import as_samples, dome, even_cap, gloss, lights_along
from scene.normals import angular_error_deg, unit
from solve.problem import Problem
from solve.whole import rpca
from solve.whole.low_rank import low_rank

DEFAULT = rpca.RpcaSettings()


def ball(size=32, count=24, *, shine=0.0, seed=20_000):
    """Gray samples (P, F), normals (P, 3), directions (F, 3) and mask of a ball with attached shadows."""
    normals, mask = dome(size, rim=0.22)
    normals, directions = normals[mask], even_cap(count, 55.0)
    albedo = np.random.default_rng(seed).uniform(0.2, 0.6, len(normals))
    gray = albedo[:, None] * np.maximum(normals @ directions.T, 0) + shine * gloss(normals, directions, 120).T
    return gray.astype(np.float32), normals, directions, mask


def run(gray, directions, mask, settings=DEFAULT):
    problem = Problem(None, lights_along(directions), None, mask, slice(0, len(mask)))
    return rpca.fit_whole(problem, as_samples(gray, directions), settings)


def error(b, normals):
    return angular_error_deg(unit(b), normals)


def test_a_low_rank_matrix_with_gross_corruptions_and_gaps_comes_back():
    rng = np.random.default_rng(20_001)
    truth = rng.normal(size=(600, 3)) @ rng.normal(size=(3, 120))
    data = truth + np.where(rng.random(truth.shape) < 0.05, rng.normal(0, 20, truth.shape), 0)
    there = rng.random(truth.shape) > 0.15
    data[~there] = 1e6
    low, _ = low_rank(data, there, 1 / np.sqrt(600), tolerance=1e-8)
    assert np.linalg.matrix_rank(low, rtol=1e-9) == 3
    assert np.linalg.norm(low - truth) < 1e-5 * np.linalg.norm(truth)


def test_gloss_and_cast_shadow_leave_and_the_textbook_keeps_its_floor():
    gray, normals, directions, mask = ball(count=32, shine=0.8)
    gray[200:300, ::9] = 0
    good, seed = run(gray, directions, mask), run(gray, directions, mask, settings=rpca.SEED)
    plain = np.linalg.lstsq(directions, gray.T, rcond=None)[0].T
    assert error(good.b, normals).mean() < 0.3
    assert error(seed.b, normals).mean() > 5 * error(good.b, normals).mean()
    assert error(plain, normals).mean() > 10 * error(good.b, normals).mean()
    assert not good.used[200:300, ::9].any()


def test_it_says_when_it_cannot_tell_low_rank_from_sparse():
    gray, _, directions, mask = ball(count=6)
    assert any("6 lights" in doubt for doubt in run(gray, directions, mask).cautions)
    gray, _, directions, mask = ball(count=24)
    noise = np.random.default_rng(20_005).uniform(0.1, 1, gray.shape).astype(np.float32)
    assert any("corrupted" in doubt for doubt in run(noise, directions, mask).cautions)

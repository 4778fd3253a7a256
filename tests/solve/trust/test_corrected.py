"""Answers joined, each less its predicted error; and maps of every n-th pixel brought to all."""

import numpy as np
import pytest

from scene.normals import angular_error_deg, unit
from solve.thinning import at_pixels
from solve.trust.corrected import joined

TRUE = unit(np.random.default_rng(1).normal(size=(50, 3)) * [0.5, 0.5, 0.1] + [0, 0, 1])


def test_answers_less_their_errors_are_the_truth():
    errors = 0.1 * np.random.default_rng(2).normal(size=(4, 50, 3))
    found, spread = joined(TRUE + errors, errors, np.zeros((4, 50)))
    assert angular_error_deg(found, TRUE).max() < 1e-6
    assert spread.max() < 1e-6


def test_a_method_counts_the_less_the_more_it_errs():
    # Two methods whose predicted errors are wrong by the same vector: the joined answer is nearer to the better one.
    small, large = np.full_like(TRUE, 0.01), np.full_like(TRUE, 1.0)
    off = np.array([0.1, 0.0, 0.0])
    answers = np.stack([TRUE + small, unit(TRUE + off) + large])
    found, spread = joined(answers, np.stack([small, large]), np.zeros((2, 50)))
    assert np.median(angular_error_deg(found, TRUE)) < 0.1
    # Nor does what it disagrees by count.
    assert np.degrees(np.median(spread)) < 0.1


def test_a_noisy_answer_counts_less():
    off = np.array([0.0, 0.1, 0.0])
    answers, none = np.stack([TRUE, unit(TRUE + off)]), np.zeros((2, 50, 3))
    found, _ = joined(answers, none, np.stack([np.full(50, 0.001), np.full(50, 0.1)]))
    assert np.median(angular_error_deg(found, TRUE)) < 0.2


def test_unknown_answers_are_left_out():
    answers = np.stack([TRUE, np.full_like(TRUE, np.nan)])
    found, _ = joined(answers, np.zeros_like(answers), np.full((2, 50), np.nan))
    assert angular_error_deg(found, TRUE).max() < 1e-6
    nothing, spread = joined(np.full_like(answers, np.nan), np.zeros_like(answers), np.zeros((2, 50)))
    assert np.isnan(nothing).all()
    assert np.isnan(spread).all()


@pytest.mark.parametrize("step", [1, 3])
def test_a_linear_map_comes_back(step):
    row, column = np.mgrid[:13, :10]
    whole = np.stack([2.0 * row - column, 0.5 * column], -1)
    place = row.ravel() <= 12 - 12 % step, column.ravel() <= 9 - 9 % step
    inner = place[0] & place[1]
    found = at_pixels(whole[::step, ::step], step, row.ravel(), column.ravel())
    np.testing.assert_allclose(found[inner], whole.reshape(-1, 2)[inner], atol=1e-4)


def test_unknown_neighbours_are_left_out():
    maps = np.full((2, 2, 1), np.nan)
    maps[0, 1] = 7.0
    found = at_pixels(maps, 2, np.array([0, 1, 1]), np.array([0, 1, 2]))
    np.testing.assert_allclose(found[:, 0], 7.0)
    assert np.isnan(at_pixels(np.full((2, 2, 1), np.nan), 2, np.array([1]), np.array([1]))).all()

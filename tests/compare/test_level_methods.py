"""Methods are level when, and only when, their medians differ by less than that difference's uncertainty."""

import numpy as np
import pytest

from compare.statistics.level_methods import level_methods, thinned


@pytest.fixture
def noise():
    return np.random.default_rng(4).gamma(4.0, 0.5, (90, 90))


def test_a_difference_that_the_truth_does_not_resolve_is_level(noise):
    errors = {"a": noise, "b": noise + 0.3, "c": noise + 0.9}
    # Squares of the medians, 1.84, 2.14 and 2.74 degrees, differ by 1.2 and 4.1; 2 sigma^2 is 1.6.
    found = level_methods(errors, 0.9)
    assert (found["best"], found["level"]) == ("a", ["b"])
    # A shift common to all pixels is certain by the draws, since both methods have the same blocks.
    assert level_methods(errors, None)["level"] == []


def test_the_same_source_is_level_and_another_is_not():
    rng = np.random.default_rng(5)
    level = [level_methods({k: rng.gamma(4, 0.5, (60, 60)) for k in "ab"}, None)["level"] != [] for _ in range(20)]
    assert sum(level) >= 17
    apart = {"a": rng.gamma(4, 0.5, (60, 60)), "b": rng.gamma(4, 0.6, (60, 60))}
    assert level_methods(apart, None)["level"] == []


def test_sigma_of_the_median_is_that_of_maps_drawn_anew():
    rng = np.random.default_rng(6)
    maps = rng.gamma(4.0, 0.5, (60, 50, 50))
    told = np.mean([level_methods({"a": each}, None)["median_sigma_deg"]["a"] for each in maps[:12]])
    assert told == pytest.approx(np.median(maps, axis=(1, 2)).std(), rel=0.3)


def test_a_large_map_is_thinned_and_an_empty_one_is_left_out():
    assert thinned(np.zeros((1200, 900))).size <= 200_000
    assert level_methods({"a": np.full((9, 9), np.nan)}, 1.0) == {"best": None, "median_sigma_deg": {}, "level": []}

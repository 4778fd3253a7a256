"""Selection by counting against sorting."""

import numpy as np
import pytest

from solve.pixelwise.kernels import NO_KEY, keys_of, median, smallest_key, value_of


@pytest.mark.parametrize("seed", range(5))
def test_every_rank_and_the_median_are_those_of_sorting(seed):
    rng = np.random.default_rng(seed)
    for count in (1, 2, 3, 8, 33, 96):
        values = (rng.normal(size=count) * 10.0 ** rng.integers(-6, 3, count)).astype(np.float32)
        values[rng.random(count) < 0.2] = values[0]
        values[rng.random(count) < 0.1] = 0.0
        keys, room = np.empty(count, np.int32), np.empty(1, np.float32)
        keys_of(values, keys)
        found = [value_of(smallest_key(keys, k), room) for k in range(count)]
        np.testing.assert_array_equal(found, np.sort(values))
        padded = np.r_[keys, [NO_KEY] * 7].astype(np.int32)
        assert median(padded, count, room) == np.median(values.astype(np.float64))

"""The k-th smallest of a few dozen numbers, by counting: no sorting, no branches, whole vectors at a time.

float32 numbers are ordered as their bits are, read as integers, once the negative ones are turned round. A search by
halves over these keys counts, some ten times, how many are no larger, until one is left: each count is a handful of
vector instructions, where sorting or partitioning waits for mispredicted branches.
"""

import numba
import numpy as np

NO_KEY = np.int32(2**31 - 1)
"""Larger than the key of any number: for what is left out."""


@numba.njit(nogil=True, cache=True)
def keys_of(values, keys):  # pragma: no cover
    """Write the keys of float32 `values` (n,) to `keys` (n,) int32: ordered as the values are."""
    bits = values.view(np.int32)
    for i in range(len(bits)):
        keys[i] = bits[i] ^ ((bits[i] >> np.int32(31)) & NO_KEY)


@numba.njit(nogil=True, cache=True)
def value_of(key, room):  # pragma: no cover
    """Return the float32 of a key; `room` (1,) float32 is to work in."""
    key = np.int32(key)
    room.view(np.int32)[0] = key ^ ((key >> np.int32(31)) & NO_KEY)
    return room[0]


@numba.njit(nogil=True, cache=True)
def _at_most(keys, limit):  # pragma: no cover
    count = np.int32(0)
    for i in range(len(keys)):
        count = np.int32(count + np.int32(keys[i] <= limit))
    return count


@numba.njit(nogil=True, cache=True)
def _largest_until(keys, limit):  # pragma: no cover
    largest = np.int32(-(2**31))
    for i in range(len(keys)):
        largest = max(largest, keys[i] if keys[i] <= limit else np.int32(-(2**31)))
    return largest


@numba.njit(nogil=True, cache=True)
def smallest_key(keys, k):  # pragma: no cover
    """Return the k-th smallest key, k from 0; keys that are `NO_KEY` come last."""
    low = high = keys[0]
    for i in range(len(keys)):
        low, high = min(low, keys[i]), max(high, keys[i])
    low, high = np.int64(low), np.int64(high)
    below, within = np.int64(0), np.int64(len(keys))
    while low < high and within > 1:
        middle = (low + high) >> 1
        count = np.int64(_at_most(keys, np.int32(middle)))
        if count > k:
            high, within = middle, count - below
        else:
            low, within, below = middle + 1, within + below - count, count
    return _largest_until(keys, np.int32(high))


@numba.njit(nogil=True, cache=True)
def median(keys, count, room):  # pragma: no cover
    """Return the median of the `count` values whose keys are not `NO_KEY`; the mean of the two in the middle."""
    lower = smallest_key(keys, (count - 1) // 2)
    low = np.float64(value_of(lower, room))
    if count % 2 or _at_most(keys, lower) > count // 2:
        return low
    upper = NO_KEY
    for i in range(len(keys)):
        upper = min(upper, keys[i] if keys[i] > lower else NO_KEY)
    return 0.5 * (low + np.float64(value_of(upper, room)))

"""Rows of an integer array that are the same, found by sorting one number a row: the mending's workhorse.

`numpy.unique(axis=0)` compares whole rows and takes ten times as long.
"""

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


def group_numbers(keys: Integers) -> tuple[Integers, Integers]:
    """Return the order (N,) that sorts `keys` (N,), and where in it each group of equal keys starts (G,)."""
    order = np.argsort(keys)
    ordered = keys[order]
    first = np.ones(len(keys), bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return order, np.flatnonzero(first)


def first_of_same(rows: NDArray) -> Integers:
    """Return for each row (N, k) of 8-byte numbers the lowest index of an equal row (N,).

    Rows are sorted by a hash; should two unlike rows share one, which none of a billion does, they are compared.
    """
    bits = np.ascontiguousarray(rows).view(np.uint64)
    keys = np.zeros(len(rows), np.uint64)
    for column in range(bits.shape[1]):
        # Multiply by an odd number and fold the high half down: each bit of the row moves the whole key.
        keys = (keys ^ bits[:, column]) * np.uint64(0x9E3779B97F4A7C15)
        keys ^= keys >> np.uint64(29)
        keys *= np.uint64(0xBF58476D1CE4E5B9)
        keys ^= keys >> np.uint64(32)
    order, starts = group_numbers(keys.view(np.int64))
    if len(starts) == len(rows):
        return np.arange(len(rows))
    lowest = np.minimum.reduceat(order, starts)
    first = np.zeros(len(rows), np.int64)
    first[order] = np.repeat(lowest, np.diff(starts, append=len(rows)))
    if any((bits[first, column] != bits[:, column]).any() for column in range(bits.shape[1])):
        _, index, inverse = np.unique(bits, axis=0, return_index=True, return_inverse=True)
        return index[inverse.ravel()]
    return first


def renumber(kept: NDArray[np.bool_]) -> Integers:
    """Return the new index (N,) of each old one when only `kept` (N,) stay."""
    return np.cumsum(kept) - 1

"""Rows of an array that are the same: the vertices and edges of large meshes."""

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
    """Return for each row (N, k) of 8-byte numbers the lowest index of an equal row (N,): equal bit for bit.

    On meshes of a million faces `numpy.unique(axis=0)` takes ten times as long.
    """
    import pandas

    columns = [pandas.Series(column) for column in np.ascontiguousarray(rows).view(np.uint64).T]
    return pandas.Series(np.arange(len(rows))).groupby(columns, sort=False).transform("first").to_numpy(np.int64)

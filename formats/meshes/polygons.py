"""Polygons and triangle strips of any length, cut into triangles."""

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]


def fans(counts: Integers, flat: NDArray) -> Integers:
    """Cut polygons, given by their lengths (N,) and all their corners in a row, into triangles (T, 3)."""
    if len(counts) and (counts == 3).all():
        return flat.reshape(-1, 3).astype(np.int64)
    flat = flat.astype(np.int64)
    starts = np.cumsum(counts) - counts
    triangles = np.maximum(counts - 2, 0)
    first = np.repeat(starts, triangles)
    second = np.arange(triangles.sum()) - np.repeat(np.cumsum(triangles) - triangles, triangles) + 1
    return np.stack([flat[first], flat[first + second], flat[first + second + 1]], -1)


def strips(counts: Integers, flat: NDArray) -> Integers:
    """Cut strips into triangles (T, 3): -1 ends a strip, every second triangle of a strip is turned over."""
    ends = np.cumsum(counts)
    flat = np.insert(flat.astype(np.int64), ends, -1)
    index = np.arange(len(flat))
    last_break = np.maximum.accumulate(np.where(flat < 0, index, -1))
    corners = np.stack([flat[:-2], flat[1:-1], flat[2:]], -1)
    odd = (index[:-2] - last_break[:-2] - 1) % 2 == 1
    corners[odd] = corners[odd][:, [1, 0, 2]]
    return corners[(corners >= 0).all(1)]


def ragged(flat: NDArray, starts: Integers, counts: Integers) -> NDArray:
    """Return the numbers of lists that lie in `flat` at `starts` (N,), `counts` (N,) long, one after the other."""
    offset = np.cumsum(counts) - counts
    return flat[np.repeat(starts - offset, counts) + np.arange(counts.sum())]

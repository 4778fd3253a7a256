"""Cells by their keys, and sums over them: the compiled loops of twin/engines/radiance_cells.py."""

import numba
import numpy as np

EMPTY = np.int64(-1)
NOWHERE = np.int64(-2)
"""Key of a sample that meets nothing."""


@numba.njit(nogil=True, cache=True, inline="always")
def _slot(table, key):
    """Return where a key stands, or the free place where it would stand."""
    mask = len(table) - 1
    mixed = np.uint64(key) * np.uint64(0x9E3779B97F4A7C15)
    slot = np.int64(mixed >> np.uint64(32)) & mask
    while table[slot] != key and table[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@numba.njit(nogil=True, cache=True)
def find(table, cell_of_slot, keys, found):
    """Fill `found` with each key's cell: -1 where unknown, -2 where the sample meets nothing."""
    for i in range(len(keys)):
        if keys[i] == NOWHERE:
            found[i] = -2
        else:
            slot = _slot(table, keys[i])
            found[i] = cell_of_slot[slot] if table[slot] == keys[i] else -1


@numba.njit(nogil=True, cache=True)
def put(table, cell_of_slot, keys, first):
    """Enter keys as the cells `first`, `first` + 1, ..."""
    for i in range(len(keys)):
        slot = _slot(table, keys[i])
        table[slot] = keys[i]
        cell_of_slot[slot] = first + i


@numba.njit(nogil=True, cache=True)
def add_weighted(radiance, cells, weights, owners, out):
    """Add weight times radiance of each sample's cell to what its owner has.

    radiance (C, 3, F).
    cells (S,): Negative: none.
    weights (S, 3); owners (S,); out (O, 3, F).
    """
    frames = radiance.shape[2]
    for i in range(len(cells)):
        if cells[i] >= 0:
            for c in range(3):
                weight, row, total = weights[i, c], radiance[cells[i], c], out[owners[i], c]
                for f in range(frames):
                    total[f] += weight * row[f]

"""Weighted Laplace equations on the pixels' grid, solved by conjugate gradients and multigrid.

The unknowns x minimise  sum over neighbours c_pq (x_q - x_p - t_pq)^2 + shift sum (x - x0)^2: an edge without
weight is a cut. A coarser grid merges 2 x 2 pixels and adds up the weights between them, which keeps the form; two
steps of conjugate gradients at every level make up for so plain a coarsening [Notay2008].
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_COARSEST = 250
"""Unknowns that are solved for directly."""
_WEIGHTS = (0.562, 1.390)
"""Of Jacobi's steps: one over the roots of Chebyshev's polynomial on the rough part, 0.5 to 2, of the spectrum."""


class _Level(NamedTuple):
    """All (H, W): edges, shift, diagonal and one over it (0 where there is no unknown)."""

    right: Array
    down: Array
    shift: Array
    diagonal: Array
    reciprocal: Array


def solve_grid(
    right: Array, down: Array, shift: Array, rhs: Array, start: Array, *, tolerance: float, iterations: int = 200
) -> Array:
    """Solve (Laplacian + shift) x = rhs.

    `right` and `down` are the weights of the edge from each pixel to the next column, to the next row (the last column,
    row is 0); `shift` is above 0 on every pixel that is solved for, 0 elsewhere; all (H, W). The tolerance is that of
    the residual's length, as a share of the right side's.
    """
    levels = [_level(right, down, shift)]
    while levels[-1].shift.size > _COARSEST:
        levels.append(_coarser(levels[-1]))
    last = levels[-1]
    every = np.eye(last.shift.size).reshape(-1, *last.shift.shape)
    matrix = -np.stack([_left(last, 0 * one, one).ravel() for one in every])
    matrix += np.diag(last.diagonal.ravel() == 0)
    # Its least eigenvalue is the shift's, tiny beside the largest: what is below is rounding.
    least = max(float(last.shift.sum()) / max(int((last.shift > 0).sum()), 1), 1e-15 * float(last.diagonal.max()))
    values, vectors = np.linalg.eigh(matrix)
    inverse = (vectors / np.maximum(values, least)) @ vectors.T
    goal = tolerance * float(np.linalg.norm(rhs))
    return start + _conjugate(levels, inverse, _left(levels[0], rhs, start), goal, iterations)


def _conjugate(levels: list[_Level], inverse: Array, rhs: Array, goal: float, iterations: int) -> Array:
    """Return x of the first of the levels, finest first: conjugate gradients, preconditioned by a cycle.

    `inverse` is that of the last one's matrix.
    """
    if len(levels) == 1:
        return (inverse @ rhs.ravel()).reshape(rhs.shape)
    x, residual, nothing = np.zeros_like(rhs), rhs, np.zeros_like(rhs)
    step, before, slope = x, residual, 1.0
    for count in range(iterations):
        if np.linalg.norm(residual) <= goal:
            break
        z = _cycle(levels, inverse, residual)
        # Flexible conjugate gradients: a cycle is not the same linear map twice.
        step = z + (np.vdot(z, residual - before) / slope) * step if count else z
        slope = np.vdot(z, residual)
        image = -_left(levels[0], nothing, step)
        bend = np.vdot(step, image)
        if not bend > 0.0:
            break
        length = np.vdot(step, residual) / bend
        x += length * step
        before, residual = residual, residual - length * image
    return x


def _cycle(levels: list[_Level], inverse: Array, rhs: Array) -> Array:
    """Return an approximate solution: smooth, correct by two steps on the coarser grid [Notay2008], smooth."""
    level = levels[0]
    # The first step is from zero, and needs no product.
    x = _smoothed(level, rhs, _WEIGHTS[0] * level.reciprocal * rhs, _WEIGHTS[1])
    solved = level.reciprocal > 0
    coarse = _merged(_left(level, rhs, x) * solved)
    found = _conjugate(levels[1:], inverse, coarse, 0.25 * float(np.linalg.norm(coarse)), 2)
    x += solved * found.repeat(2, 0).repeat(2, 1)[: x.shape[0], : x.shape[1]]
    for weight in _WEIGHTS:
        x = _smoothed(level, rhs, x, weight)
    return x


def _level(right: Array, down: Array, shift: Array) -> _Level:
    diagonal = shift + right + down
    diagonal[:, 1:] += right[:, :-1]
    diagonal[1:] += down[:-1]
    reciprocal = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
    return _Level(right, down, shift, diagonal, reciprocal)


def _coarser(level: _Level) -> _Level:
    """Merge 2 x 2 pixels: weights between two of them add up, those inside one fall away."""
    across, along = level.right.copy(), level.down.copy()
    across[:, 0::2], along[0::2] = 0, 0
    return _level(_merged(across), _merged(along), _merged(level.shift))


def _merged(values: Array) -> Array:
    """Return the sums over 2 x 2 pixels."""
    height, width = values.shape
    values = np.pad(values, ((0, height % 2), (0, width % 2)))
    return values[0::2, 0::2] + values[0::2, 1::2] + values[1::2, 0::2] + values[1::2, 1::2]


def _smoothed(level: _Level, rhs: Array, x: Array, weight: float) -> Array:
    """Return x after a step of Jacobi's method: no pixel waits for its neighbour."""
    left = _left(level, rhs, x)
    left *= level.reciprocal
    left *= weight
    left += x
    return left


@numba.njit(nogil=True, cache=True)
def _left(level, rhs, x):  # pragma: no cover
    """Return rhs - A x; several times faster than by a sparse matrix."""
    right, down, diagonal = level.right, level.down, level.diagonal
    height, width = x.shape
    out = np.empty_like(x)
    for i in range(height):
        for j in range(width):
            total = rhs[i, j] - diagonal[i, j] * x[i, j]
            if j + 1 < width:
                total += right[i, j] * x[i, j + 1]
            if j > 0:
                total += right[i, j - 1] * x[i, j - 1]
            if i + 1 < height:
                total += down[i, j] * x[i + 1, j]
            if i > 0:
                total += down[i - 1, j] * x[i - 1, j]
            out[i, j] = total
    return out

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

_COARSEST = 300
"""Unknowns that are solved for directly."""
_WEIGHTS = (0.562, 1.390)
"""Of Jacobi's steps: one over the roots of Chebyshev's polynomial on the rough part, 0.5 to 2, of the spectrum. What
row-by-row sweeps would need one of takes two, but no pixel waits for its neighbour: seven times faster."""


class _Level(NamedTuple):
    """All (H, W): edges, shift, diagonal and one over it (0 where there is no unknown)."""

    right: Array
    down: Array
    shift: Array
    diagonal: Array
    reciprocal: Array


class _Grids(NamedTuple):
    """The levels, finest first, and Cholesky's factor of the last one's matrix."""

    levels: list[_Level]
    factor: Array


def solve_grid(
    right: Array, down: Array, shift: Array, rhs: Array, start: Array, *, tolerance: float, iterations: int = 200
) -> tuple[Array, bool]:
    """Solve (Laplacian + shift) x = rhs.

    `right` and `down` are the weights of the edge from each pixel to the next column, to the next row (the last column,
    row is 0); `shift` is above 0 on every pixel that is solved for, 0 elsewhere; all (H, W). The tolerance is that of
    the residual's length, as a share of the right side's. Returns x, and whether the tolerance was reached.
    """
    grids = _grids(right, down, shift)
    top = grids.levels[0]
    x = start.copy()
    residual = rhs - _apply(top, x)
    goal = tolerance * _length(rhs)
    step, before, slope = np.zeros_like(x), residual, 1.0
    for count in range(iterations):
        if _length(residual) <= goal:
            return x, True
        z = _cycle(grids, 0, residual)
        # Flexible conjugate gradients: a cycle is not the same linear map twice.
        beta = _dot(z, residual - before) / slope if count else 0.0
        step = z + beta * step
        slope = _dot(z, residual)
        image = _apply(top, step)
        bend = _dot(step, image)
        if not bend > 0.0:
            break
        length = _dot(step, residual) / bend
        x += length * step
        before = residual
        residual = residual - length * image
    return x, _length(residual) <= goal


def _grids(right: Array, down: Array, shift: Array) -> _Grids:
    levels = [_level(right, down, shift)]
    while np.prod(levels[-1].shift.shape) > _COARSEST:
        levels.append(_level(*_coarser(levels[-1].right, levels[-1].down, levels[-1].shift)))
    last = levels[-1]
    height, width = last.shift.shape
    matrix = np.diag(np.where(last.diagonal > 0, last.diagonal, 1.0).ravel())
    at = np.arange(height * width).reshape(height, width)
    for weight, a, b in ((last.right, at[:, :-1], at[:, 1:]), (last.down, at[:-1], at[1:])):
        matrix[a, b] = matrix[b, a] = -weight[: a.shape[0], : a.shape[1]]
    # Its least eigenvalue is the shift's, tiny beside the largest: what is below is rounding.
    least = max(float(last.shift.sum()) / max(int((last.shift > 0).sum()), 1), 1e-15 * float(last.diagonal.max()))
    return _Grids(levels, _factorised(matrix, least))


def _cycle(grids: _Grids, depth: int, rhs: Array) -> Array:
    """Return an approximate solution: smooth, correct from the coarser grid, smooth."""
    if depth == len(grids.levels) - 1:
        return _substituted(grids.factor, rhs.ravel()).reshape(rhs.shape)
    level = grids.levels[depth]
    # Two steps of Jacobi's method from zero; the first needs no product.
    x = _smoothed(level, rhs, (_WEIGHTS[0] * rhs) * level.reciprocal, _WEIGHTS[1:])
    coarse = np.zeros_like(grids.levels[depth + 1].shift)
    _restrict(level, rhs, x, coarse)
    _prolong(_coarse_solution(grids, depth + 1, coarse), level.diagonal, x)
    return _smoothed(level, rhs, x, _WEIGHTS)


def _smoothed(level: _Level, rhs: Array, x: Array, weights: tuple[float, ...]) -> Array:
    for weight in weights:
        x = _jacobi(level, rhs, x, weight)
    return x


def _coarse_solution(grids: _Grids, depth: int, rhs: Array) -> Array:
    """Return one or two steps of conjugate gradients, each preconditioned by a cycle [Notay2008]."""
    level = grids.levels[depth]
    first = _cycle(grids, depth, rhs)
    if depth == len(grids.levels) - 1:
        return first
    image = _apply(level, first)
    bend, slope = _dot(first, image), _dot(first, rhs)
    if not bend > 0.0:
        return first
    left = rhs - (slope / bend) * image
    if _length(left) <= 0.25 * _length(rhs):
        return (slope / bend) * first
    second = _cycle(grids, depth, left)
    shared, slope_2 = _dot(second, image), _dot(second, left)
    bend_2 = _dot(second, _apply(level, second)) - shared * shared / bend
    if not bend_2 > 0.0:
        return (slope / bend) * first
    return (slope / bend - shared * slope_2 / (bend * bend_2)) * first + (slope_2 / bend_2) * second


# Not the linear algebra library's, here and in `_dot`: waking its threads costs more than the work.
@numba.njit(nogil=True, cache=True)
def _factorised(matrix, least):  # pragma: no cover
    """Return Cholesky's lower factor, no pivot below `least`."""
    count = len(matrix)
    factor = np.zeros((count, count))
    for i in range(count):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i == j:
                factor[i, i] = np.sqrt(max(total, least))
            else:
                factor[i, j] = total / factor[j, j]
    return factor


@numba.njit(nogil=True, cache=True)
def _substituted(factor, rhs):  # pragma: no cover
    count = len(rhs)
    x = rhs.copy()
    for i in range(count):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(count - 1, -1, -1):
        x[i] /= factor[i, i]
        for k in range(i):
            x[k] -= factor[i, k] * x[i]
    return x


@numba.njit(nogil=True, cache=True)
def _dot(a, b):  # pragma: no cover
    total = 0.0
    for row in range(len(a)):
        some = 0.0
        for column in range(a.shape[1]):
            some += a[row, column] * b[row, column]
        total += some
    return total


def _length(a: Array) -> float:
    return float(np.sqrt(_dot(a, a)))


def _level(right: Array, down: Array, shift: Array) -> _Level:
    diagonal = shift + right + down
    diagonal[:, 1:] += right[:, :-1]
    diagonal[1:] += down[:-1]
    reciprocal = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
    return _Level(right, down, shift, diagonal, reciprocal)


def _coarser(right: Array, down: Array, shift: Array) -> tuple[Array, Array, Array]:
    """Merge 2 x 2 pixels: weights between two of them add up, those inside one fall away."""
    height, width = shift.shape
    even = ((0, height % 2), (0, width % 2))
    right, down, shift = (np.pad(a, even) for a in (right, down, shift))
    across = right[0::2, 1::2] + right[1::2, 1::2]
    along = down[1::2, 0::2] + down[1::2, 1::2]
    total = shift[0::2, 0::2] + shift[0::2, 1::2] + shift[1::2, 0::2] + shift[1::2, 1::2]
    return np.ascontiguousarray(across), np.ascontiguousarray(along), np.ascontiguousarray(total)


@numba.njit(nogil=True, cache=True, inline="always")
def _neighbours(level, x, i, j):  # pragma: no cover
    """Return the weighted sum of a pixel's neighbours."""
    right, down = level.right, level.down
    height, width = x.shape
    total = 0.0
    if j + 1 < width:
        total += right[i, j] * x[i, j + 1]
    if j > 0:
        total += right[i, j - 1] * x[i, j - 1]
    if i + 1 < height:
        total += down[i, j] * x[i + 1, j]
    if i > 0:
        total += down[i - 1, j] * x[i - 1, j]
    return total


@numba.njit(nogil=True, cache=True)
def _apply(level, x):  # pragma: no cover
    out = np.zeros_like(x)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            out[i, j] = level.diagonal[i, j] * x[i, j] - _neighbours(level, x, i, j)
    return out


@numba.njit(nogil=True, cache=True)
def _jacobi(level, rhs, x, weight):  # pragma: no cover
    """Return x + weight (rhs - A x) / diagonal."""
    out = np.zeros_like(x)
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            gap = rhs[i, j] - level.diagonal[i, j] * x[i, j] + _neighbours(level, x, i, j)
            out[i, j] = x[i, j] + weight * level.reciprocal[i, j] * gap
    return out


@numba.njit(nogil=True, cache=True)
def _restrict(level, rhs, x, coarse):  # pragma: no cover
    for i in range(x.shape[0]):
        for j in range(x.shape[1]):
            if level.diagonal[i, j] > 0.0:
                gap = rhs[i, j] - level.diagonal[i, j] * x[i, j] + _neighbours(level, x, i, j)
                coarse[i // 2, j // 2] += gap


@numba.njit(nogil=True, cache=True)
def _prolong(coarse, diagonal, x):  # pragma: no cover
    height, width = x.shape
    for i in range(height):
        for j in range(width):
            if diagonal[i, j] > 0.0:
                x[i, j] += coarse[i // 2, j // 2]

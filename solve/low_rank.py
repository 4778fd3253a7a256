"""A matrix with gaps as the sum of a low-rank and a sparse one."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_GROWTH = 1.5
_CHUNK = 1 << 12
"""Pixels that a thread takes at a time: fixed, so that sums do not depend on how many threads there are."""
_SINGLE_THREAD = 1 << 18
"""Multiplications up to which a product runs on one thread in OpenBLAS."""


@dataclass(frozen=True)
class LowRank:
    """What `low_rank` found.

    Parameters
    ----------
    low : (P, F) float64
        The low-rank part A, the gaps filled in.
    corrupted : (P, F) bool
        Where the sparse part is not zero.
    right : (F, rank) float64
        The right singular vectors of A, orthonormal.
    rounds : int
    residual : float
        |D - A - E| / |D|, both over the samples that are there.
    """

    low: Array
    corrupted: NDArray[np.bool_]
    right: Array
    rounds: int
    residual: float


def low_rank(
    data: NDArray, there: NDArray[np.bool_], weight: float, *, rank: int = 0, tolerance: float = 1e-6, rounds: int = 100
) -> LowRank:
    """Split data (P, F), P >= F, known where `there` (P, F), into A of low rank and E of few entries.

    Parameters
    ----------
    data : (P, F) float
    there : (P, F) bool
    weight : float
        lambda.
    rank : int
        0: the nuclear norm of A is small. Above: A has this rank, and its singular values are not shrunk.
    tolerance : float
        Stops at |D - A - E| <= tolerance |D|.
    rounds : int
        At most.

    Notes
    -----
    min |A|_* + lambda |E|_1, D = A + E where known, by the inexact augmented Lagrangian [Lin2010]: E is soft
    thresholding of D - A + Y / mu at lambda / mu, where there is a sample; A is singular value thresholding of
    X = D - E + Y / mu at 1 / mu; Y += mu (D - A - E); mu grows by 1.5.

    With A = X W, W (F, F) from the eigenvectors of X' X, no singular vector of P entries is needed. Two identities
    leave X as the only state and one pass a round: Y = mu (X - A), and, g being the argument of the soft
    threshold and c its clip to +- lambda / mu, the next X is A + c, or A where there is no sample.
    """
    pixels, frames = data.shape
    known = np.where(there, data, 0).astype(np.float64)
    length = float(np.linalg.norm(known))
    if length == 0:
        empty = np.zeros((pixels, frames))
        return LowRank(empty, np.zeros_like(there), np.zeros((frames, 0)), 0, 0.0)
    largest = float(np.sqrt(np.linalg.eigvalsh(known.T @ known)[-1]))
    strength = 1.25 / largest
    limit = strength * 1e7
    state = known / (max(largest, float(np.abs(known).max()) / weight) * strength)
    corrupted = np.zeros((pixels, frames), bool)
    right, factor = np.zeros((frames, 0)), np.zeros(0)
    before = strength
    residual = np.inf
    turn = 0
    chunks = [slice(start, start + _CHUNK) for start in range(0, pixels, _CHUNK)]
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:

        def each(part: slice) -> tuple[Array, float]:
            return _pass(known[part], there[part], state[part], corrupted[part], first, second, *levels)

        for turn in range(1, rounds + 1):  # noqa: B007
            first, second = _factors(right, factor)
            levels = before / strength, weight / strength
            grams, squares = zip(*pool.map(each, chunks), strict=True)
            right, factor = _threshold(np.sum(grams, axis=0), strength, rank)
            residual = float(np.sqrt(np.sum(squares))) / length
            if residual < tolerance:
                break
            before, strength = strength, min(_GROWTH * strength, limit)
        first, second = _factors(right, factor)

        def finish(part: slice) -> None:
            _project(state[part], first, second)

        list(pool.map(finish, chunks))
    return LowRank(state, corrupted, right, turn, residual)


def _threshold(gram: Array, strength: float, rank: int) -> tuple[Array, Array]:
    """Return the right singular vectors (F, k) that are kept of X, X' X being given, and their factors (k,)."""
    square, vectors = np.linalg.eigh(gram)
    singular = np.sqrt(np.maximum(square, 0))
    if rank:
        return vectors[:, -rank:], np.ones(rank)
    kept = singular * strength > 1
    return vectors[:, kept], 1 - 1 / (singular[kept] * strength)


def _factors(right: Array, factor: Array) -> tuple[Array, Array]:
    """Return V diag(factor) (F, k) and V' (k, F), each contiguous."""
    return np.ascontiguousarray(right * factor), np.ascontiguousarray(right.T)


@numba.njit(nogil=True, cache=True)
def _pass(known, there, state, corrupted, first, second, ratio, limit):  # pragma: no cover
    """Write the next X over the last one; return X' X, and the sum of (D - A - E)^2 over what is known.

    In blocks so small that the linear algebra library starts no threads of its own: ours are enough.
    """
    pixels, frames = known.shape
    gram = np.zeros((frames, frames))
    part = np.empty((frames, frames))
    square = 0.0
    step = max(1, _SINGLE_THREAD // (frames * frames))
    for start in range(0, pixels, step):
        stop = min(start + step, pixels)
        x = state[start:stop]
        low = np.dot(np.dot(x, first), second)
        for i in range(start, stop):
            for k in range(frames):
                a = low[i - start, k]
                dual = ratio * (state[i, k] - a) if there[i, k] else 0.0
                argument = known[i, k] - a + dual if there[i, k] else 0.0
                clipped = min(max(argument, -limit), limit)
                corrupted[i, k] = clipped != argument
                state[i, k] = a + clipped
                square += (clipped - dual) ** 2
        np.dot(x.T, x, part)
        gram += part
    return gram, square


@numba.njit(nogil=True, cache=True)
def _project(state, first, second):  # pragma: no cover
    """Write A = X V diag(factor) V' over X."""
    step = max(1, _SINGLE_THREAD // state.shape[1] ** 2)
    for start in range(0, len(state), step):
        x = state[start : start + step]
        x[:] = np.dot(np.dot(x, first), second)

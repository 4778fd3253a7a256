"""A matrix with gaps as the sum of a low-rank and a sparse one."""

import os
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_CHUNK = 1 << 12
"""Pixels that a thread takes at a time: fixed, so that sums do not depend on how many threads there are."""


def low_rank(
    data: NDArray, there: NDArray[np.bool_], weight: float, *, tolerance: float = 1e-6, rounds: int = 100
) -> tuple[Array, float]:
    """Split data (P, F), P >= F, known where `there` (P, F), into A of low rank and E of few entries.

    `weight` is lambda. The nuclear norm of A is small. It stops at |D - A - E| <= tolerance |D|. Returns A (P, F), the
    gaps filled in, and |D - A - E| / |D|, both over the samples that are there.

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
    known = np.where(there, data, data.dtype.type(0))
    state = known.astype(np.float64)
    gram = state.T @ state
    length = float(np.sqrt(np.trace(gram)))
    if length == 0:
        return state, 0.0
    largest = float(np.sqrt(np.linalg.eigvalsh(gram)[-1]))
    strength = 1.25 / largest
    limit = strength * 1e7
    state /= max(largest, max(float(known.max()), -float(known.min())) / weight) * strength
    first, second = np.zeros((frames, 0)), np.zeros((0, frames))
    before = strength
    residual = np.inf
    chunks = [slice(start, start + _CHUNK) for start in range(0, pixels, _CHUNK)]
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:

        def each(part: slice) -> tuple[Array, float]:
            return _pass(known[part], there[part], state[part], first, second, *levels)

        for _ in range(rounds):
            levels = before / strength, weight / strength
            grams, squares = zip(*pool.map(each, chunks), strict=True)
            first, second = _threshold(np.sum(grams, axis=0), strength)
            residual = float(np.sqrt(np.sum(squares))) / length
            if residual < tolerance:
                break
            before, strength = strength, min(1.5 * strength, limit)
    for part in chunks:
        state[part] = state[part] @ first @ second
    return state, residual


def _threshold(gram: Array, strength: float) -> tuple[Array, Array]:
    """Return V diag(factor) (F, k) and V' (k, F), contiguous: right singular vectors that are kept of X, by X' X."""
    square, vectors = np.linalg.eigh(gram)
    singular = np.sqrt(np.maximum(square, 0))
    kept = singular * strength > 1
    right = vectors[:, kept]
    return np.ascontiguousarray(right * (1 - 1 / (singular[kept] * strength))), np.ascontiguousarray(right.T)


@numba.njit(nogil=True, cache=True)
def _pass(known, there, state, first, second, ratio, limit):  # pragma: no cover
    """Write the next X over the last one; return X' X, and the sum of (D - A - E)^2 over what is known."""
    low = np.dot(np.dot(state, first), second)
    square = _shrink(known.ravel(), there.ravel(), low.ravel(), state.ravel(), ratio, limit)
    return np.dot(state.T, state), square


@numba.njit(nogil=True, cache=True, fastmath={"reassoc", "contract", "nnan", "nsz"})
def _shrink(known, there, low, state, ratio, limit):  # pragma: no cover
    """Write the next X; sums in any order and no branches, so that the loop becomes vector instructions."""
    square = 0.0
    for k in range(len(known)):
        a, present = low[k], np.float64(there[k])
        dual = ratio * (state[k] - a) * present
        # What is not there is 0 in `known`, and must be 0 in the argument.
        clipped = min(max(known[k] - a * present + dual, -limit), limit)
        state[k] = a + clipped
        square += (clipped - dual) ** 2
    return square

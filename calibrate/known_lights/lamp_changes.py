"""One quantity of each lamp, measured in several sessions: its mean, and how it changed."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FALSE = 0.03
"""Chance that anything at all is named of a sound rig, by each of the things that are looked at."""


def squares(offsets: Array, covariance: Array) -> Array:
    """Return the squares (...,) of offsets (..., D) over their sigmas."""
    return np.sum(offsets * np.linalg.solve(covariance, offsets[..., None])[..., 0], -1)


def pooled(values: Array, covariance: Array, shape: NDArray | None = None) -> tuple[Array, Array, float]:
    """Fit S values (S, D) by a mean, or by a mean and a change of known shape (S,), all weighted by the covariances.

    Returns the mean (D,), or mean and change (2 D,), its covariance, and the chi-square that is left.
    """
    here = np.ones((len(values), 1)) if shape is None else np.stack([np.ones(len(values)), shape], 1)
    slopes = np.kron(here[:, None], np.eye(values.shape[1])[None])
    weight = np.linalg.inv(covariance)
    own = np.linalg.pinv(np.einsum("sij,sik,skl->jl", slopes, weight, slopes), hermitian=True)
    found = own @ np.einsum("sij,sik,sk->j", slopes, weight, values)
    return found, own, float(squares(values - slopes @ found, covariance).sum())


def change_of(values: Array, covariance: Array, names: Sequence[str], limit: float) -> tuple[str, Array, NDArray]:
    """Return how S values (S, D) of one lamp changed: in words, by how much (D,), and in which (S,) it is as it is now.

    Of a step, one odd session and a drift the one that explains the most, if that is more than `limit` of chi-square.
    """
    count, here = len(values), np.arange(len(values))
    trials = [(f"since {names[k]}", 1.0 * (here >= k), here >= k) for k in range(1, count - 1)]
    trials += [(f"in {names[k]}", 1.0 * (here == k), (here == k) == (k == count - 1)) for k in range(1, count)]
    trials += [(f"in {names[-1]}, by a drift", here / (count - 1), here >= 0)] if count > 2 else []
    left = [pooled(values, covariance, shape)[2] for _, shape, _ in trials]
    before, best = pooled(values, covariance)[2], int(np.argmin(left))
    if before - left[best] <= limit:
        return "", np.zeros(values.shape[1]), here >= 0
    words, shape, kept = trials[best]
    return words, pooled(values, covariance, shape)[0][values.shape[1] :], kept


def pooled_lamps(
    values: Array, covariance: Array, free: int, names: Sequence[str], said: Callable[[Array], str]
) -> tuple[Array, Array, NDArray[np.bool_], Array, list[tuple[str, ...]]]:
    """Pool what S sessions say of N lamps, (S, N, D), NaN where one says nothing: each lamp as it is now.

    Parameters
    ----------
    values, covariance : (S, N, D), (S, N, D, D) float64
    free : int
        How many of the D numbers tell something: 2 of a direction.
    names : sequence of S str
    said : callable
        Takes a change (D,), returns it in words.

    Returns
    -------
    mean, covariance : (N, D), (N, D, D) float64
    kept : (S, N) bool
        Which sessions a lamp's mean is of.
    wider : (N,) float64
        The factor in the sigmas: the Birge ratio sqrt(chi2 / freedom), 1 at least [Birge1932].
    flags : list of N tuples of str
        How each lamp changed, where that is more than the sessions disagree on the usual lamp.
    """
    from scipy.stats import chi2

    there, lamps = np.isfinite(values[..., 0]), range(values.shape[1])
    rows = [np.flatnonzero(own) for own in there.T]
    ratio = [0.0] + [pooled(values[r, i], covariance[r, i])[2] / (len(r) - 1) for i, r in enumerate(rows) if len(r) > 1]
    usual = max(1.0, float(np.median(ratio)) / free)
    limit = usual * float(chi2.isf(FALSE / (2 * len(names) * len(lamps)), free))
    found, flags = [], []
    for i, row in zip(lamps, rows, strict=True):
        words, amount, kept = "", np.zeros(0), np.ones(len(row), bool)
        if len(row) > 1:
            words, amount, kept = change_of(values[row, i], covariance[row, i], [names[s] for s in row.tolist()], limit)
        flags.append((f"{said(amount)} {words}",) if words else ())
        there[row, i] = kept
        mean, own, square = pooled(values[row[kept], i], covariance[row[kept], i])
        wider = max(1.0, square / (free * (kept.sum() - 1))) if kept.sum() > 1 else usual
        found.append((mean, wider * own, np.sqrt(wider)))
    mean, own, wider = map(np.array, zip(*found, strict=True))
    return mean, own, there, wider, flags

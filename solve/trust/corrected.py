"""One answer from many, each with the error that its own world shows it to make taken off."""

import numpy as np
from numpy.typing import NDArray

from scene.normals import unit

FLOOR = np.radians(0.3)
"""Least sigma of a corrected normal."""
DISTRUST = 0.3
"""Standard deviation of a predicted error, as a share of it."""
ROUNDS = 5


def joined(answers: NDArray, errors: NDArray, sigma: NDArray) -> tuple[NDArray, NDArray]:
    """Return the normals (P, 3) that M answers give together, and how far they disagree (P,), radians.

    Parameters
    ----------
    answers, errors : (M, P, 3)
        What each method found; and what it finds in the predicted photographs less the normals that these show. NaN
        where unknown.
    sigma : (M, P)
        Radians, of each answer's noise; NaN where unknown.

    Notes
    -----
    n = unit(sum_m w_m (n_m - e_m)), w_m = 1 / (sigma_m^2 + floor^2 + (distrust |e_m|)^2): a method counts the less, the
    more it errs. Answers that lie beyond their sigma count less again (Huber's weights, in turn with n). What they
    disagree by is the weighted mean of their distance from n, times 1.25 as for a normal one's sigma: not divided by
    their number, since they look at the same photographs; not of the squares, which answers of no weight would decide.
    """
    corrected = unit(answers - errors)
    size = np.linalg.norm(errors, axis=-1)
    known = np.asarray(np.isfinite(corrected).all(-1))
    variance = np.nan_to_num(sigma) ** 2 + FLOOR**2 + (DISTRUST * size) ** 2
    weight = np.where(known, 1 / np.where(known, variance, 1), 0)
    corrected = np.where(known[..., None], corrected, 0)
    together = np.einsum("mp,mpi->pi", weight, corrected)
    for _ in range(ROUNDS):
        apart = np.linalg.norm(corrected - unit(together), axis=-1)
        robust = weight / np.sqrt(1 + np.nan_to_num(apart) ** 2 * weight)
        together = np.einsum("mp,mpi->pi", robust, corrected)
    found, total = unit(together), weight.sum(0)
    apart = np.linalg.norm(corrected - found, axis=-1)
    spread = 1.25 * np.divide((weight * apart).sum(0), total, out=np.full(len(total), np.nan), where=total > 0)
    return found, spread

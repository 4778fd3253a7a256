"""Robust statistics that fits share."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
MAD = 1.4826  # standard deviation of normal errors over the median of their sizes
TUKEY = 4.685  # spreads at which Tukey's weight reaches 0: 95 % efficient for normal errors


def spread(residual: NDArray) -> float:
    """Return the robust standard deviation of residuals about 0; inf of none."""
    return MAD * float(np.median(np.abs(residual))) if residual.size else np.inf


def tukey(residual: NDArray, reach: float | NDArray) -> NDArray:
    """Return Tukey's biweights (1 - (r / reach)^2)^2, 0 beyond the reach."""
    return np.maximum(1 - (residual / reach) ** 2, 0) ** 2


def cluster_sums(scores: Array, cluster: NDArray[np.intp]) -> Array:
    """Return (C, k), the scores (N, k) of a fit summed over each cluster that occurs: errors agree inside of one.

    With H the fit's normal matrix, H^-1 (sum over the clusters of s s^T) H^-1 is its covariance.
    """
    labels, number = np.unique(cluster, return_inverse=True)
    out = np.zeros((len(labels), scores.shape[1]))
    np.add.at(out, number, scores)
    return out

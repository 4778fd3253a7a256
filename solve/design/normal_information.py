"""How well flashes tell the normals, before any photograph is solved: Fisher information, pixel by pixel.

P pixels, F flashes. A Lambertian pixel shows v . b + noise, v = intensity x direction of the light there (its
fall-off included), b = albedo x normal.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LEAST = 1e-9
"""Least share of the largest eigenvalue of an information that counts: under it the lit lights lie in a plane."""


def information(vectors: Array, noise: Array | float, seen: NDArray[np.bool_] | bool = True) -> Array:
    """Return the Fisher information of b.

    Parameters
    ----------
    vectors : (F, P, 3) float
        Light vectors, as `Lights.at` gives them for one channel; (F, 1, 3) for distant lights.
    noise : (F, P) float
        Standard deviation of each sample, in the units of albedo x vectors; what broadcasts to it.
    seen : (F, P) bool, optional
        False in shadow, in a highlight, where clipped. Default: all samples count.

    Returns
    -------
    information : (P, 3, 3) float64

    Notes
    -----
    J = sum_f seen_f v_f v_f^T / noise_f^2, the inverse of the least covariance of b [Drbohlav2005]. For n unit vectors
    trace J^-1 >= 9 noise^2 / n, with equality where sum v v^T = n / 3: n >= 3 lights evenly on a ring 54.7 degrees from
    its axis.
    """
    weights = np.where(seen, 1 / np.square(noise), 0.0)
    return np.einsum("fpi,fpj->pij", vectors * weights[..., None], vectors)


def covariance_by_weights(vectors: Array, weights: NDArray, noise: Array) -> Array:
    """Return the covariance (P, 3, 3) of b by least squares on samples of any weights.

    Parameters
    ----------
    vectors, noise : as in `information`
    weights : (F, P) float
        At least 0; 0 for samples that the solver leaves out. 1 / noise^2 gives the inverse of `information`. NaN where
        the samples in use do not span space.
    """
    weighted = vectors * weights[..., None]
    inverse = inverted(np.einsum("fpi,fpj->pij", weighted, vectors))
    pulls = weights[..., None] * np.einsum("pij,fpj->fpi", inverse, vectors) * noise[..., None]
    return np.einsum("fpi,fpj->pij", pulls, pulls)


def sigma_of_normals(b: Array, covariance: Array) -> Array:
    """Return the standard deviation of the normals, degrees along one tangent axis.

    Parameters
    ----------
    b : (P, 3) float
        Albedo x normal.
    covariance : (P, 3, 3) float
        Of b.

    Returns
    -------
    sigma_deg : (P,) float64
        As `Estimate.sigma_deg`; at most 90, NaN where the covariance is unknown. The angle between the estimated and
        the true normal has the root mean square sqrt(2) sigma, and, where both axes are alike, the mean 1.25 sigma.

    Notes
    -----
    sigma^2 = (trace C - n^T C n) / (2 |b|^2): what of C lies across the normal.
    """
    return np.minimum(np.degrees(np.sqrt(variance_of_normals(b, covariance))), 90.0)


def variance_of_normals(b: Array, covariance: Array) -> Array:
    """Return the square of `sigma_of_normals`, radians squared, without an end."""
    square = np.sum(b * b, -1)
    along = np.einsum("pi,pij,pj->p", b, covariance, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.maximum(np.trace(covariance, axis1=1, axis2=2) - along / square, 0) / square / 2


def inverted(information: Array) -> Array:
    """Return the inverses (P, 3, 3); NaN where the lights in use do not span space."""
    values, axes = np.linalg.eigh(information)
    spans = values[:, 0] > LEAST * values[:, 2]
    with np.errstate(divide="ignore"):
        parts = np.where(spans[:, None], 1 / np.maximum(values, 1e-300), np.nan)
    return (axes * parts[:, None]) @ axes.swapaxes(1, 2)

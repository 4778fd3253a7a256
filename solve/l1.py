"""Least absolute deviations by reweighted least squares: robust without any threshold on the residual."""

import numba
import numpy as np

from solve.kernels import (
    SINGULAR,
    SINGULAR_WEIGHTED,
    agreeing_samples,
    light_vectors,
    lit_samples,
    solve_sums,
    weighted_sums,
)

SETTINGS = {
    "shadow_threshold": 0.05,
    "residual_floor": 1e-4,
    "tolerance": 1e-5,
    "iterations": 100,
    "outlier_sigmas": 2.5,
    "noise_floor": 0.004,
}

SEED_SETTINGS = {**SETTINGS, "shadow_threshold": -np.inf, "residual_floor": 1e-6, "tolerance": 1e-8, "iterations": 1000}
"""The plain reading: shadows are outliers like any other, and it is run to the end. (The seed has no such method.)"""


def fit(
    gray,
    valid,
    points,
    directions,
    positions,
    reach,
    is_near,
    scale,
    *,
    shadow_threshold,
    residual_floor,
    tolerance,
    iterations,
    outlier_sigmas,
    noise_floor,
):
    """Fit b = albedo x normal with the least sum of absolute residuals.

    Parameters
    ----------
    gray, valid, points, directions, positions, reach, is_near, scale
        See `solve.ls.fit`.
    shadow_threshold : float
        Shadowed, and not fitted, is what lies under this share of the pixel's own 75th percentile.
    residual_floor : float
        Residuals count as no smaller than this share of `scale`.
    tolerance : float
        A pixel is done when b moves less than this share of `scale`, summed over its three components.
    iterations : int
        At most.
    outlier_sigmas, noise_floor : float
        What counts as agreeing with the fit, for albedo and inlier count, as in `solve.iterative.fit`.

    Returns
    -------
    b : (P, 3) float64
    used : (P, F) bool
        The samples that agree.

    Notes
    -----
    b = argmin sum_f |m_f - l_f . b|, by b <- argmin sum w_f (m_f - l_f . b)^2, w_f = 1 / max(|m_f - l_f . b|, floor)
    [Schlossmacher1973], for photometric stereo in [Ikehata2012]. The start is least squares.

    Do not believe it where half of the lit samples or nearly so are not Lambertian, or where the outliers all
    pull one way and lie where the light vectors are extreme: absolute deviations bound an outlier's residual,
    not its leverage.
    """
    return _fit(
        gray,
        valid,
        points,
        directions,
        positions,
        reach,
        is_near,
        shadow_threshold,
        residual_floor * scale,
        tolerance * scale,
        iterations,
        outlier_sigmas,
        noise_floor * scale,
    )


@numba.njit(nogil=True, cache=True)
def _fit(
    gray, valid, points, directions, positions, reach, is_near, threshold, least, near, iterations, sigmas, floor
):  # pragma: no cover
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors = np.empty((lights, 3))
    columns = np.empty((3, lights))
    lit = np.empty(lights, np.bool_)
    counts, weights = np.empty(lights), np.empty(lights)
    residual = np.empty(lights, np.float32)
    sums = np.empty(9)
    for i in range(pixels):
        values = gray[i]
        light_vectors(points[i], directions, positions, reach, is_near, vectors)
        columns[:] = vectors.T
        lit_samples(values, valid[i], threshold, lit)
        for k in range(lights):
            counts[k] = 1.0 if lit[k] else 0.0
        weighted_sums(columns, values, counts, sums)
        x, y, z, well = solve_sums(sums, SINGULAR)
        if not well:
            continue
        for _ in range(iterations):
            _reweigh(columns, values, counts, x, y, z, least, weights)
            weighted_sums(columns, values, weights, sums)
            p, q, r, well = solve_sums(sums, SINGULAR_WEIGHTED)
            if not well:
                break
            moved = abs(p - x) + abs(q - y) + abs(r - z)
            x, y, z = p, q, r
            if moved < near:
                break
        agreeing_samples(vectors, values, lit, lit, x, y, z, sigmas, floor, residual, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


@numba.njit(nogil=True, cache=True, fastmath={"contract", "arcp", "nnan"})
def _reweigh(columns, values, counts, x, y, z, least, weights):  # pragma: no cover
    """Write 1 / |residual| of what counts."""
    u, v, w = columns[0], columns[1], columns[2]
    for k in range(len(values)):
        gap = abs(np.float64(values[k]) - (u[k] * x + v[k] * y + w[k] * z))
        weights[k] = counts[k] / max(gap, least)

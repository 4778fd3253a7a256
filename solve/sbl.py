"""Sparse Bayesian regression: every sample has a variance of its own, learned; outliers get a large one."""

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
    "prior": 0.01,
    "residual_floor": 3e-3,
    "tolerance": 1e-5,
    "iterations": 50,
    "outlier_sigmas": 2.5,
    "noise_floor": 0.004,
}

SEED_SETTINGS = {
    **SETTINGS,
    "shadow_threshold": -np.inf,
    "prior": 1.0,
    "residual_floor": 1e-4,
    "tolerance": 1e-8,
    "iterations": 1000,
}
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
    prior,
    residual_floor,
    tolerance,
    iterations,
    outlier_sigmas,
    noise_floor,
):
    """Fit b = albedo x normal with a sparse error beside the Lambertian part.

    Parameters
    ----------
    gray, valid, points, directions, positions, reach, is_near, scale
        See `solve.ls.fit`.
    shadow_threshold : float
        Shadowed, and not fitted, is what lies under this share of the pixel's own 75th percentile.
    prior : float
        Precision of b before any sample was seen, in units of 1 / scale^2.
    residual_floor : float
        Least standard deviation of a sample, as a share of `scale`.
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
    m = L b + e, e_f ~ N(0, g_f), b ~ N(0, I / prior) [Ikehata2012]. From g = 1 in turn

    - C = (prior I + sum l_f l_f^T / g_f)^-1, the covariance of b given the samples,
    - b = argmin sum (m_f - l_f . b)^2 / g_f; without the prior, which would shorten it,
    - g_f = max((m_f - l_f . b)^2 + l_f^T C l_f, floor^2).

    The variance l^T C l keeps a sample from being trusted because the fit happens to pass it, which is what
    reweighting by the residual alone does.

    Do not believe it where half of the lit samples are not Lambertian; and it is not convex: it may settle on
    the wrong half.
    """
    return _fit(
        gray,
        valid,
        points,
        directions,
        positions,
        reach,
        is_near,
        1.0 / scale,
        shadow_threshold,
        prior,
        residual_floor * residual_floor,
        tolerance,
        iterations,
        outlier_sigmas,
        noise_floor * scale,
    )


@numba.njit(nogil=True, cache=True)
def _fit(
    gray, valid, points, directions, positions, reach, is_near, unit, threshold, prior, least, near, iterations,
    sigmas, floor,
):  # pragma: no cover  # fmt: skip
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors = np.empty((lights, 3))
    columns = np.empty((3, lights))
    values = np.empty(lights)
    lit = np.empty(lights, np.bool_)
    counts, weights = np.empty(lights), np.empty(lights)
    residual = np.empty(lights, np.float32)
    sums = np.empty(9)
    for i in range(pixels):
        light_vectors(points[i], directions, positions, reach, is_near, vectors)
        columns[:] = vectors.T
        lit_samples(gray[i], valid[i], threshold, lit)
        for k in range(lights):
            values[k] = gray[i, k] * unit
            counts[k] = 1.0 if lit[k] else 0.0
        weighted_sums(columns, values, counts, sums)
        x, y, z, well = solve_sums(sums, SINGULAR)
        if not well:
            continue
        for _ in range(iterations):
            _reweigh(columns, values, counts, x, y, z, sums, prior, least, weights)
            weighted_sums(columns, values, weights, sums)
            p, q, r, well = solve_sums(sums, SINGULAR_WEIGHTED)
            if not well:
                break
            moved = abs(p - x) + abs(q - y) + abs(r - z)
            x, y, z = p, q, r
            if moved < near:
                break
        x, y, z = x / unit, y / unit, z / unit
        agreeing_samples(vectors, gray[i], lit, lit, x, y, z, sigmas, floor, residual, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


@numba.njit(nogil=True, cache=True, fastmath={"contract", "arcp", "nnan"})
def _reweigh(columns, values, counts, x, y, z, sums, prior, least, weights):  # pragma: no cover
    """Write 1 / g of every sample, from b and from the sums of the weights before."""
    a, d, f = sums[0] + prior, sums[3] + prior, sums[5] + prior
    b, c, e = sums[1], sums[2], sums[4]
    ia, ib, ic = d * f - e * e, c * e - b * f, b * e - c * d
    id_, ie, if_ = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * ia + b * ib + c * ic)
    first, second, third = columns[0], columns[1], columns[2]
    for k in range(len(values)):
        u, v, w = first[k], second[k], third[k]
        gap = values[k] - (u * x + v * y + w * z)
        spread = (u * (ia * u + 2.0 * (ib * v + ic * w)) + v * (id_ * v + 2.0 * ie * w) + w * w * if_) * scale
        weights[k] = counts[k] / max(gap * gap + spread, least)

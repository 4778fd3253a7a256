"""Sparse Bayesian regression: every sample has a variance of its own, learned; outliers get a large one."""

import numba
import numpy as np

from solve.pixelwise.kernels import (
    SINGULAR,
    SINGULAR_WEIGHTED,
    agreeing_samples,
    light_vectors,
    lit_samples,
    move_residual,
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
        See `solve.pixelwise.ls.fit`.
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
        What counts as agreeing with the fit, for albedo and inlier count, as in `solve.pixelwise.iterative.fit`.

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
    vectors, columns = np.empty((lights, 3)), np.empty((3, lights), np.float32)
    values = np.empty(lights, np.float32)
    lit = np.empty(lights, np.bool_)
    counts, residual = np.empty(lights, np.float32), np.empty(lights, np.float32)
    sums = np.empty(9)
    for i in range(pixels):
        if is_near or i == 0:
            light_vectors(points[i], directions, positions, reach, is_near, vectors)
            for k in range(lights):
                columns[0, k], columns[1, k], columns[2, k] = vectors[k, 0], vectors[k, 1], vectors[k, 2]
        values[:] = gray[i]
        lit_samples(values, valid[i], threshold, lit)
        for k in range(lights):
            counts[k], residual[k] = lit[k], values[k] * unit
        weighted_sums(columns, residual, counts, sums)
        x, y, z, well = solve_sums(sums, SINGULAR)
        if not well:
            continue
        move_residual(vectors, x, y, z, residual)
        p = q = r = 0.0
        for _ in range(iterations):
            _step(columns, counts, p, q, r, prior, least, residual, sums)
            p, q, r, well = solve_sums(sums, SINGULAR_WEIGHTED)
            if not well:
                break
            x, y, z = x + p, y + q, z + r
            if abs(p) + abs(q) + abs(r) < near:
                break
        x, y, z = x / unit, y / unit, z / unit
        agreeing_samples(columns, values, counts, x, y, z, sigmas, floor, residual, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nnan", "nsz"})
def _step(columns, counts, x, y, z, prior, least, residual, sums):  # pragma: no cover
    """Move the residuals by b's last step (x, y, z); from them and the sums before, write those of the next step.

    float32 does: an error in the matrix slows the steps down, it does not move the point where they end.
    """
    a, d, f = sums[0] + prior, sums[3] + prior, sums[5] + prior
    b, c, e = sums[1], sums[2], sums[4]
    ia, ib, ic = d * f - e * e, c * e - b * f, b * e - c * d
    id_, ie, if_ = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * ia + b * ib + c * ic)
    aa, bb, cc = np.float32(ia * scale), np.float32(2.0 * ib * scale), np.float32(2.0 * ic * scale)
    dd, ee, ff = np.float32(id_ * scale), np.float32(2.0 * ie * scale), np.float32(if_ * scale)
    x, y, z, least = np.float32(x), np.float32(y), np.float32(z), np.float32(least)
    xx = xy = xz = yy = yz = zz = mx = my = mz = np.float32(0)
    for k in range(len(residual)):
        u, v, w = columns[0, k], columns[1, k], columns[2, k]
        gap = residual[k] - (u * x + v * y + w * z)
        residual[k] = gap
        spread = u * (aa * u + bb * v + cc * w) + v * (dd * v + ee * w) + w * w * ff
        weight = counts[k] / max(gap * gap + spread, least)
        gu, gv, gw = weight * u, weight * v, weight * w
        xx += gu * u
        xy += gu * v
        xz += gu * w
        yy += gv * v
        yz += gv * w
        zz += gw * w
        mx += gu * gap
        my += gv * gap
        mz += gw * gap
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = xx, xy, xz, yy, yz, zz
    sums[6], sums[7], sums[8] = mx, my, mz

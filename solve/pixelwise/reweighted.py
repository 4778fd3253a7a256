"""Iteratively reweighted least squares, pixel by pixel: `l1` and `sbl` differ by their weights."""

from typing import NamedTuple

import numba
import numpy as np

from solve.pixelwise.kernels import (
    SINGULAR,
    SINGULAR_WEIGHTED,
    light_vectors,
    lit_samples,
    residuals_of,
    solve_sums,
    weighted_sums,
)
from solve.pixelwise.selection import median


class Weighting(NamedTuple):
    """How samples are weighted.

    Parameters
    ----------
    unit : float
        Samples are multiplied by it; the next three are in these units.
    prior : float
        Precision of b before any sample was seen, for the weights of `sbl`; 0: the weights of `l1`.
    least : float
        Least |residual| of `l1`; least variance of `sbl`.
    tolerance : float
        A pixel is done when b moves less, summed over its three components.
    iterations : int
        At most.
    shadow_threshold : float
        Share of the pixel's own 75th percentile.
    outlier_sigmas, noise_floor : float
        What counts as agreeing with the fit: within so many robust sigmas, the floor being the least of those.
    """

    unit: float
    prior: float
    least: float
    tolerance: float
    iterations: int
    shadow_threshold: float
    outlier_sigmas: float
    noise_floor: float


@numba.njit(nogil=True, cache=True)
def fit_reweighted(samples, how):  # pragma: no cover
    """Return b (P, 3), by steps from least squares, and the samples that agree with it (P, F)."""
    gray, valid, points, geometry = samples
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors, columns = np.empty((lights, 3)), np.empty((3, lights), np.float32)
    values = np.empty(lights, np.float32)
    lit = np.empty(lights, np.bool_)
    counts, residual = np.empty(lights, np.float32), np.empty(lights, np.float32)
    for i in range(pixels):
        if geometry.is_near or i == 0:
            light_vectors(points[i], geometry, vectors)
            for k in range(lights):
                columns[0, k], columns[1, k], columns[2, k] = vectors[k, 0], vectors[k, 1], vectors[k, 2]
        values[:] = gray[i]
        lit_samples(values, valid[i], how.shadow_threshold, lit)
        for k in range(lights):
            counts[k], residual[k] = lit[k], values[k] * how.unit
        sums = weighted_sums(columns, residual, counts)
        x, y, z, well = solve_sums(sums, SINGULAR)
        if not well:
            continue
        for k in range(lights):
            residual[k] -= vectors[k, 0] * x + vectors[k, 1] * y + vectors[k, 2] * z
        p = q = r = 0.0
        for _ in range(how.iterations):
            if how.prior > 0.0:
                sums = _sparse_step(columns, counts, (p, q, r), how, residual, sums)
            else:
                sums = _absolute_step(columns, counts, (p, q, r), how, residual)
            p, q, r, well = solve_sums(sums, SINGULAR_WEIGHTED)
            if not well:
                break
            x, y, z = x + p, y + q, z + r
            if abs(p) + abs(q) + abs(r) < how.tolerance:
                break
        x, y, z = x / how.unit, y / how.unit, z / how.unit
        _agreeing(columns, values, counts, (x, y, z), how, residual, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nnan", "nsz"})
def _absolute_step(columns, counts, move, how, residual):  # pragma: no cover
    """Move the residuals by b's last step; return the next one's normal equations, weighted by 1 / |residual|."""
    x, y, z, least = np.float32(move[0]), np.float32(move[1]), np.float32(move[2]), np.float32(how.least)
    a = b = c = d = e = f = p = q = r = np.float32(0)
    for k in range(len(residual)):
        u, v, w = columns[0, k], columns[1, k], columns[2, k]
        gap = residual[k] - (u * x + v * y + w * z)
        residual[k] = gap
        weight = counts[k] / max(abs(gap), least)
        gu, gv, gw = weight * u, weight * v, weight * w
        a += gu * u
        b += gu * v
        c += gu * w
        d += gv * v
        e += gv * w
        f += gw * w
        p += gu * gap
        q += gv * gap
        r += gw * gap
    # As float64, as `weighted_sums` returns them.
    return a + 0.0, b + 0.0, c + 0.0, d + 0.0, e + 0.0, f + 0.0, p + 0.0, q + 0.0, r + 0.0


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nnan", "nsz"})
def _sparse_step(columns, counts, move, how, residual, sums):  # pragma: no cover
    """The same, weighted by 1 / (residual^2 + l^T C l), C^-1 = the last normal matrix and the prior.

    float32 does: an error in the matrix slows the steps down, it does not move the point where they end.
    """
    a, d, f = sums[0] + how.prior, sums[3] + how.prior, sums[5] + how.prior
    b, c, e = sums[1], sums[2], sums[4]
    ia, ib, ic = d * f - e * e, c * e - b * f, b * e - c * d
    id_, ie, if_ = a * f - c * c, b * c - a * e, a * d - b * b
    scale = 1.0 / (a * ia + b * ib + c * ic)
    aa, bb, cc = np.float32(ia * scale), np.float32(2.0 * ib * scale), np.float32(2.0 * ic * scale)
    dd, ee, ff = np.float32(id_ * scale), np.float32(2.0 * ie * scale), np.float32(if_ * scale)
    x, y, z, least = np.float32(move[0]), np.float32(move[1]), np.float32(move[2]), np.float32(how.least)
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
    # As float64, as `weighted_sums` returns them.
    return xx + 0.0, xy + 0.0, xz + 0.0, yy + 0.0, yz + 0.0, zz + 0.0, mx + 0.0, my + 0.0, mz + 0.0


@numba.njit(nogil=True, cache=True)
def _agreeing(columns, values, lit, b, how, residual, out):  # pragma: no cover
    """Write to `out` (F,) the lit samples within some robust sigmas of b and facing it; `residual` is to work in.

    sigma = max(1.4826 x median |m - v . b| over the lit samples, floor).
    """
    size, limit = residuals_of(columns, values, lit, b, residual), 0.0
    if size:
        sigma = max(1.4826 * median(residual.view(np.int32), size, np.empty(1, np.float32)), how.noise_floor)
        limit = how.outlier_sigmas * sigma
    x, y, z, limit = np.float32(b[0]), np.float32(b[1]), np.float32(b[2]), np.float32(limit)
    for k in range(len(values)):
        shade = columns[0, k] * x + columns[1, k] * y + columns[2, k] * z
        out[k] = (lit[k] > 0) & (shade > 0) & (abs(values[k] - shade) <= limit)

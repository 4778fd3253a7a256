"""Least absolute deviations by reweighted least squares: robust without any threshold on the residual.

`sbl` takes the same steps with other weights.
"""

from typing import NamedTuple

import numba
import numpy as np

from solve.methods import Method
from solve.pixelwise.kernels import (
    SINGULAR,
    SINGULAR_WEIGHTED,
    adjugate,
    agreeing,
    light_vectors,
    limit_of,
    lit_samples,
    solve_sums,
    weighted_sums,
)


class L1Settings(NamedTuple):
    """Settings of `l1` and `sbl`.

    Parameters
    ----------
    shadow_threshold : float
        Shadowed, and not fitted, is what lies under this share of the pixel's own 75th percentile.
    residual_floor : float
        Residuals count as no smaller than this share of the stack's 99th percentile; of `sbl`, sigmas.
    tolerance : float
        A pixel is done when b moves less than this share of the same, summed over its three components.
    iterations : int
        At most.
    outlier_sigmas, noise_floor : float
        What counts as agreeing with the fit, for albedo and inlier count, as in `solve.pixelwise.iterative`.
    prior : float
        Precision of b before any sample was seen, in units of 1 / (the stack's 99th percentile)^2; 0: the weights of
        `l1`, above: those of `sbl`.
    """

    shadow_threshold: float = 0.05
    residual_floor: float = 1e-4
    tolerance: float = 1e-5
    iterations: int = 100
    outlier_sigmas: float = 2.5
    noise_floor: float = 0.004
    prior: float = 0.0


SEED = L1Settings(shadow_threshold=-np.inf, residual_floor=1e-6, tolerance=1e-8, iterations=1000)
"""The plain reading: shadows are outliers like any other, and it is run to the end. (The seed has no such method.)"""


@numba.njit(nogil=True, cache=True)
def fit(samples, scale, settings):  # pragma: no cover
    """Fit b = albedo x normal with the least sum of absolute residuals; see `solve.methods.Method`.

    Notes
    -----
    b = argmin sum_f |m_f - l_f . b|, by b <- argmin sum w_f (m_f - l_f . b)^2, w_f = 1 / max(|m_f - l_f . b|, floor)
    [Schlossmacher1973], for photometric stereo in [Ikehata2012]. The start is least squares.

    Do not believe it where half of the lit samples or nearly so are not Lambertian, or where the outliers all
    pull one way and lie where the light vectors are extreme: absolute deviations bound an outlier's residual,
    not its leverage.
    """
    gray, valid, points, geometry = samples
    prior = settings.prior
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors, columns = np.empty((3, lights)), np.empty((3, lights), np.float32)
    values, lit = np.empty(lights, np.float32), np.empty(lights, np.float32)
    residual, kept = np.empty(lights, np.float32), np.empty(lights, np.float32)
    keys, room = np.empty(lights, np.int32), np.empty(1, np.float32)
    for i in range(pixels):
        if geometry.is_near or i == 0:
            light_vectors(points[i], geometry, vectors, columns)
        for k in range(lights):
            values[k] = gray[i, k] / scale
        lit_samples(values, valid[i], settings.shadow_threshold, keys, room, lit)
        sums = weighted_sums(columns, values, lit)
        x, y, z, well = solve_sums(sums, SINGULAR)
        if not well:
            continue
        for k in range(lights):
            residual[k] = values[k] - (vectors[0, k] * x + vectors[1, k] * y + vectors[2, k] * z)
        p = q = r = 0.0
        for _ in range(settings.iterations):
            sums = _step(columns, lit, (p, q, r), prior, settings.residual_floor, residual, sums)
            p, q, r, well = solve_sums(sums, SINGULAR_WEIGHTED)
            if not well:
                break
            x, y, z = x + p, y + q, z + r
            if abs(p) + abs(q) + abs(r) < settings.tolerance:
                break
        limit = limit_of(columns, values, lit, (x, y, z), settings.outlier_sigmas, settings.noise_floor, residual, room)
        agreeing(columns, values, lit, lit, (x, y, z), limit, kept)
        for k in range(lights):
            used[i, k] = kept[k] > 0
        b[i, 0], b[i, 1], b[i, 2] = x * scale, y * scale, z * scale
    return b, used


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nnan", "nsz"})
def _step(columns, lit, move, prior, floor, residual, sums):  # pragma: no cover
    """Move the residuals by b's last step; return the next one's normal equations.

    Weights are 1 / max(|residual|, floor) without a prior, else 1 / max(residual^2 + l^T C l, floor^2), C^-1 = the last
    normal matrix and the prior. float32 does: an error in the matrix slows the steps down, it does not move the point
    where they end.
    """
    a, b, c, d, e, f, _, _, _ = sums
    det, (ia, ib, ic, id_, ie, if_) = adjugate(a + prior, b, c, d + prior, e, f + prior)
    scale = 1.0 / det
    aa, bb, cc = np.float32(ia * scale), np.float32(2.0 * ib * scale), np.float32(2.0 * ic * scale)
    dd, ee, ff = np.float32(id_ * scale), np.float32(2.0 * ie * scale), np.float32(if_ * scale)
    x, y, z = np.float32(move[0]), np.float32(move[1]), np.float32(move[2])
    least = np.float32(floor * floor if prior > 0.0 else floor)
    xx = xy = xz = yy = yz = zz = mx = my = mz = np.float32(0)
    for k in range(len(residual)):
        u, v, w = columns[0, k], columns[1, k], columns[2, k]
        gap = residual[k] - (u * x + v * y + w * z)
        residual[k] = gap
        if prior > 0.0:
            spread = u * (aa * u + bb * v + cc * w) + v * (dd * v + ee * w) + w * w * ff
            weight = lit[k] / max(gap * gap + spread, least)
        else:
            weight = lit[k] / max(abs(gap), least)
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


METHOD = Method("l1", {"default": L1Settings(), "seed": SEED}, fit=fit)

"""Least absolute deviations by reweighted least squares: robust without any threshold on the residual."""

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
        See `solve.pixelwise.ls.fit`.
    shadow_threshold : float
        Shadowed, and not fitted, is what lies under this share of the pixel's own 75th percentile.
    residual_floor : float
        Residuals count as no smaller than this share of `scale`.
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
    vectors, columns = np.empty((lights, 3)), np.empty((3, lights), np.float32)
    values = np.empty(lights, np.float32)
    lit = np.empty(lights, np.bool_)
    counts, residual = np.empty(lights, np.float32), np.empty(lights, np.float32)
    sums = np.empty(9)
    least = np.float32(least)
    for i in range(pixels):
        if is_near or i == 0:
            light_vectors(points[i], directions, positions, reach, is_near, vectors)
            for k in range(lights):
                columns[0, k], columns[1, k], columns[2, k] = vectors[k, 0], vectors[k, 1], vectors[k, 2]
        values[:] = gray[i]
        lit_samples(values, valid[i], threshold, lit)
        for k in range(lights):
            counts[k], residual[k] = lit[k], values[k]
        weighted_sums(columns, residual, counts, sums)
        x, y, z, well = solve_sums(sums, SINGULAR)
        if not well:
            continue
        move_residual(vectors, x, y, z, residual)
        p = q = r = 0.0
        for _ in range(iterations):
            _step(columns, counts, p, q, r, least, residual, sums)
            p, q, r, well = solve_sums(sums, SINGULAR_WEIGHTED)
            if not well:
                break
            x, y, z = x + p, y + q, z + r
            if abs(p) + abs(q) + abs(r) < near:
                break
        agreeing_samples(columns, values, counts, x, y, z, sigmas, floor, residual, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


@numba.njit(nogil=True, cache=True, error_model="numpy", fastmath={"reassoc", "contract", "nnan", "nsz"})
def _step(columns, counts, x, y, z, least, residual, sums):  # pragma: no cover
    """Move the residuals by b's last step (x, y, z); write the normal equations of the next one to `sums` (9,)."""
    x, y, z = np.float32(x), np.float32(y), np.float32(z)
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
    sums[0], sums[1], sums[2], sums[3], sums[4], sums[5] = a, b, c, d, e, f
    sums[6], sums[7], sums[8] = p, q, r

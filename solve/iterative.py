"""Iterated least squares that drops shadows and highlights by their residuals. The default method."""

import numba
import numpy as np

from solve.kernels import light_vector, normal_equations

SETTINGS = {
    "shadow_threshold": 0.05,
    "highlight_share": 0.25,
    "outlier_sigmas": 2.5,
    "noise_floor": 0.004,
    "iterations": 20,
    "support": 4,
}

SEED_SETTINGS = {
    **SETTINGS,
    "shadow_threshold": -np.inf,
    "highlight_share": 0.0,
    "noise_floor": 0.0,
    "support": 0,
}
"""The plain reading: fit all, drop what does not agree, again, and nothing guards what is left. In deep shadow most
samples agree with darkness, and the good ones are trimmed: the benchmark's 38 degrees there have this signature."""


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
    highlight_share,
    outlier_sigmas,
    noise_floor,
    iterations,
    support,
):
    """Fit b = albedo x normal to the samples of each pixel that agree with a Lambertian surface.

    Parameters
    ----------
    gray, valid, points, directions, positions, reach, is_near, scale
        See `solve.ls.fit`.
    shadow_threshold : float
        Shadowed is what lies under this share of the pixel's own 75th percentile (not of its
        maximum, which a highlight would lift).
    highlight_share : float
        The brightest share of the lit samples stays out of the first fit.
    outlier_sigmas : float
        Samples farther from the fit than this many robust sigmas are dropped.
    noise_floor : float
        Least sigma, as a share of `scale`.
    iterations : int
        At most; two or three are typical.
    support : int
        A pixel that has fewer samples left keeps the fit before.

    Returns
    -------
    b : (P, 3) float64
    used : (P, F) bool

    Notes
    -----
    V0 = {m > threshold * q75, not clipped}; first fit on V0 less its brightest share; then, until V
    stands still: fit on V, sigma = max(1.4826 median_V |r|, floor),
    V = {f in V0 : |r_f| <= k sigma, l_f . b > 0}. A pixel with fewer than four such samples keeps its
    last fit. The seed names the method without giving it; this is the reading that is measured in
    docs/methods.md.
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
        highlight_share,
        outlier_sigmas,
        noise_floor * scale,
        iterations,
        support,
    )


@numba.njit(nogil=True, cache=True)
def _fit(
    gray,
    valid,
    points,
    directions,
    positions,
    reach,
    is_near,
    threshold,
    highlights,
    sigmas,
    floor,
    iterations,
    support,
):  # pragma: no cover
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors = np.empty((lights, 3))
    lit = np.empty(lights, np.bool_)
    now = np.empty(lights, np.bool_)
    residual = np.empty(lights)
    for i in range(pixels):
        values = gray[i]
        ordered = np.sort(values)
        limit = threshold * ordered[int(0.75 * (lights - 1))]
        count = 0
        for k in range(lights):
            vectors[k] = light_vector(k, points[i], directions, positions, reach, is_near)
            lit[k] = valid[i, k] and values[k] > limit
            count += lit[k]
        if count < 4:
            count = 0
            for k in range(lights):
                lit[k] = valid[i, k]
                count += lit[k]
        _without_brightest(values, lit, count, highlights, now)
        x, y, z, well = normal_equations(vectors, values, now)
        if not well:
            now[:] = lit
            x, y, z, well = normal_equations(vectors, values, now)
        if well:
            for _ in range(iterations):
                size = 0
                for k in range(lights):
                    if now[k]:
                        residual[size] = abs(values[k] - _shade(vectors[k], x, y, z))
                        size += 1
                sigma = max(1.4826 * np.median(residual[:size]), floor)
                changed, size = False, 0
                before = now.copy()
                for k in range(lights):
                    shade = _shade(vectors[k], x, y, z)
                    keep = lit[k] and shade > 0.0 and abs(values[k] - shade) <= sigmas * sigma
                    changed = changed or keep != before[k]
                    now[k] = keep
                    size += keep
                if not changed:
                    break
                p, q, r, well = normal_equations(vectors, values, now)
                if size < support or not well:
                    now[:] = before
                    break
                x, y, z = p, q, r
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
        used[i] = now
    return b, used


@numba.njit(nogil=True, cache=True, inline="always")
def _shade(vector, x, y, z):  # pragma: no cover
    return vector[0] * x + vector[1] * y + vector[2] * z


@numba.njit(nogil=True, cache=True)
def _without_brightest(values, lit, count, share, out):  # pragma: no cover
    """Write `lit` less its brightest share to `out`; all of it when fewer than six would remain."""
    out[:] = lit
    drop = int(share * count)
    if count - drop < 6 or drop == 0:
        return
    chosen = np.empty(count, values.dtype)
    size = 0
    for k in range(len(values)):
        if lit[k]:
            chosen[size] = values[k]
            size += 1
    limit = np.sort(chosen)[count - drop]
    for k in range(len(values)):
        if out[k] and values[k] >= limit:
            out[k] = False

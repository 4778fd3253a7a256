"""Least squares over the middle of each pixel's samples by rank: shadows below, highlights above."""

import numba
import numpy as np

from solve.pixelwise.kernels import light_vectors, lit_samples, normal_equations
from solve.pixelwise.selection import NO_KEY, keys_of, smallest_key

SETTINGS = {"shadow_threshold": 0.05, "low": 0.2, "high": 0.8}
"""Ranked are the samples that are lit at all: an attached shadow takes no place in the band."""

SEED_SETTINGS = {"shadow_threshold": -np.inf, "low": 0.2, "high": 0.8}
"""The plain reading: every sample that is not clipped has a rank. (The seed has no such method.)"""


def fit(gray, valid, points, directions, positions, reach, is_near, scale, *, shadow_threshold, low, high):
    """Fit b = albedo x normal to the samples whose rank lies in a band.

    Parameters
    ----------
    gray, valid, points, directions, positions, reach, is_near, scale
        See `solve.pixelwise.ls.fit`.
    shadow_threshold : float
        Shadowed, and without a rank, is what lies under this share of the pixel's own 75th percentile.
    low, high : float
        The band, as shares of the ranked samples, darkest first.

    Returns
    -------
    b : (P, 3) float64
    used : (P, F) bool

    Notes
    -----
    b = argmin sum_{f in V} (l_f . b - m_f)^2, V = {f : low n <= rank of m_f < high n} among the n lit samples,
    the baseline "position threshold" of [Shi2019]. Equal samples share their fate. Where the band does not span
    space, all lit samples are used.

    Do not believe it where more than a fifth of the lit samples is glossy (a rough lobe), nor with fewer than
    some ten frames: it throws two fifths of them away, good or bad; and ranks follow the shading, so that what
    remains lies on a belt around the normal, which is worse conditioned than the whole. `iterative` keeps what
    agrees.
    """
    return _fit(gray, valid, points, directions, positions, reach, is_near, shadow_threshold, low, high)


@numba.njit(nogil=True, cache=True)
def _fit(gray, valid, points, directions, positions, reach, is_near, threshold, low, high):  # pragma: no cover
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors = np.empty((lights, 3))
    lit = np.empty(lights, np.bool_)
    keys = np.empty(lights, np.int32)
    for i in range(pixels):
        values = gray[i]
        light_vectors(points[i], directions, positions, reach, is_near, vectors)
        count = lit_samples(values, valid[i], threshold, lit)
        if count == 0:
            continue
        keys_of(values, keys)
        for k in range(lights):
            keys[k] = keys[k] if lit[k] else NO_KEY
        first = smallest_key(keys, int(np.floor(low * count)))
        last = smallest_key(keys, max(int(np.ceil(high * count)) - 1, 0))
        for k in range(lights):
            used[i, k] = first <= keys[k] <= last
        x, y, z, well = normal_equations(vectors, values, used[i])
        if not well:
            used[i] = lit
            x, y, z, well = normal_equations(vectors, values, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used

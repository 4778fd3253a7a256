"""Least squares over the middle of each pixel's samples by rank: shadows below, highlights above."""

from typing import NamedTuple

import numba
import numpy as np

from solve.methods import Method
from solve.pixelwise.kernels import light_vectors, lit_samples, normal_equations
from solve.pixelwise.selection import NO_KEY, smallest_key


class Settings(NamedTuple):
    """Settings of `position`.

    Parameters
    ----------
    shadow_threshold : float
        Shadowed, and without a rank, is what lies under this share of the pixel's own 75th percentile: an attached
        shadow takes no place in the band.
    low, high : float
        The band, as shares of the ranked samples, darkest first.
    """

    shadow_threshold: float = 0.05
    low: float = 0.2
    high: float = 0.8


@numba.njit(nogil=True, cache=True)
def fit(samples, scale, settings):  # pragma: no cover
    """Fit b = albedo x normal to the samples whose rank lies in a band; see `solve.methods.Method`.

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
    gray, valid, points, geometry = samples
    pixels, lights = gray.shape
    b = np.zeros((pixels, 3))
    used = np.zeros((pixels, lights), np.bool_)
    vectors = np.empty((lights, 3))
    lit = np.empty(lights, np.float32)
    keys, room = np.empty(lights, np.int32), np.empty(1, np.float32)
    for i in range(pixels):
        values = gray[i]
        light_vectors(points[i], geometry, vectors)
        count = lit_samples(values, valid[i], settings.shadow_threshold, keys, room, lit)
        if count == 0:
            continue
        for k in range(lights):
            keys[k] = keys[k] if lit[k] > 0 else NO_KEY
        first = smallest_key(keys, int(np.floor(settings.low * count)))
        last = smallest_key(keys, max(int(np.ceil(settings.high * count)) - 1, 0))
        for k in range(lights):
            used[i, k] = first <= keys[k] <= last
        x, y, z, well = normal_equations(vectors, values, used[i])
        if not well:
            used[i] = lit > 0
            x, y, z, well = normal_equations(vectors, values, used[i])
        b[i, 0], b[i, 1], b[i, 2] = x, y, z
    return b, used


# The plain reading: every sample that is not clipped has a rank. (The seed has no such method.)
METHOD = Method("position", {"default": Settings(), "seed": Settings(shadow_threshold=-np.inf)}, fit=fit)

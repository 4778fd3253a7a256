"""Least squares over the middle of each pixel's samples by rank: shadows below, highlights above."""

from typing import NamedTuple

import numpy as np

from solve.methods import Method
from solve.pixelwise.kernels import least_squares
from solve.samples import Samples


class PositionSettings(NamedTuple):
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


def fit(samples: Samples, scale: float, settings: PositionSettings):
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
    gray, count = samples.gray, samples.gray.shape[1]
    place = int(0.75 * (count - 1))
    level = np.partition(gray, place, axis=1)[:, place : place + 1]
    limit = settings.shadow_threshold * level if settings.shadow_threshold > -np.inf else -np.inf
    lit = samples.valid & (gray > limit)
    lit = np.where(lit.sum(1, keepdims=True) < 4, samples.valid, lit)
    ranked, size = np.sort(np.where(lit, gray, np.inf), axis=1), lit.sum(1, keepdims=True)
    first, last = np.floor(settings.low * size), np.maximum(np.ceil(settings.high * size) - 1, 0)
    first, last = (np.take_along_axis(ranked, np.minimum(at, count - 1).astype(int), 1) for at in (first, last))
    used = lit & (first <= gray) & (gray <= last)
    return least_squares(samples, used, lit), used


# The plain reading: every sample that is not clipped has a rank. (The seed has no such method.)
METHOD = Method(
    "position", {"default": PositionSettings(), "seed": PositionSettings(shadow_threshold=-np.inf)}, fit=fit
)

"""Intensities that the object tells, held to those that were given as far as it tells them badly.

Lambert's law leaves some changes of the intensities free, or nearly: e_f -> (1 + a . l_f) e_f wants b' with
l . b' = (1 + a . l) (l . b) for every light, which is quadratic in l and no normal gives; but over a narrow cap of
lights a quadratic function is nearly linear. There a little of what is not Lambert's law looks like a large a.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.intensities import GROUPS, Evidence, solve_intensities

Array = NDArray[np.float64]
_EACH = np.geomspace(1e-2, 1.0, 14) ** 2
"""Variances that the given intensities may have, each by itself: no flash repeats better than to 1 %."""
_SMOOTH = np.concatenate([[0.0], np.geomspace(1e-2, 1.0, 14)]) ** 2
"""And all together, along the directions."""


class _Modes(NamedTuple):
    """What the object says of one channel's intensities, along the modes of the misfit's curvature.

    Parameters
    ----------
    modes : (F, F - 1) float64
        Unit columns; the common factor, which nothing tells, is none of them.
    variance : (F - 1,) float64
        Of what is said.
    said : (F - 1,) float64
        Log of the intensities that leave the least misfit, over the given ones.
    trend : (F - 1, 3) float64
        The linear functions of the light's direction, of unit length.
    """

    modes: Array
    variance: Array
    said: Array
    trend: Array


def nearest_to_given(ratio: Array, parts: list[Evidence], directions: Array) -> tuple[Array, Array]:
    """Return log intensities (F, C) over the given ones, mean 0, and their covariance (F, F), the channels' mean.

    Parameters
    ----------
    ratio : (F, C) float64
        Log of the intensities that leave the least misfit, over the given ones.
    parts : list of C Evidence
        Of samples that were divided by the former.
    directions : (F, 3) float64

    Notes
    -----
    In the modes v of the misfit's curvature, which is w along v, both are normal:

    - the object's word has the variance misfit (a + c (1 - a)) / w, a being how much of v is linear in the light's
      direction. What is linear can be the same all over the object, so that more pixels do not tell it better;
      the rest differs from part to part, and c is what ten parts of the object say of that;
    - the given intensities are off each by itself, variance s0^2, and all by one linear function of the direction,
      variance s1^2: those under which what the object says is likeliest.

    So errors of the given intensities are repaired where they exceed what the object's own reflection could pretend.
    """
    told = [_modes(one, part, directions) for one, part in zip(ratio.T, parts, strict=True)]
    each, smooth = max(
        ((each, smooth) for each in _EACH for smooth in _SMOOTH),
        key=lambda given: sum(_log_likelihood(one, *given) for one in told),
    )
    held, covariance = [], np.zeros((len(ratio), len(ratio)))
    for one in told:
        given = each * np.eye(len(one.said)) + smooth * one.trend @ one.trend.T
        believed = np.linalg.solve(given + np.diag(one.variance), given).T
        held.append(one.modes @ believed @ one.said)
        covariance += one.modes @ (believed * one.variance) @ one.modes.T / len(told)
    return np.stack(held, 1), covariance


def _modes(ratio: Array, part: Evidence, directions: Array) -> _Modes:
    count = len(ratio)
    told = solve_intensities(part)
    x = 1 / told.relative
    groups = x[:, None] * (part.misfit - told.misfit * part.noise[..., None] * np.eye(count)) * x
    even = np.full((count, count), 1 / count)
    level = np.eye(count) - even
    curvature = level @ groups.sum(0) @ level
    # The common factor is made the last mode.
    weight, modes = np.linalg.eigh(curvature + 10 * np.trace(curvature) * even)
    weight, modes = np.maximum(weight[:-1], 1e-9 * weight[-2]), modes[:, :-1]
    pull = (groups.sum(2) - groups.sum((0, 2)) / GROUPS) @ modes
    scatter = GROUPS / (GROUPS - 1) * np.mean(np.sum(pull**2, 0) / weight)
    common = max(told.misfit * part.noise.sum() / count, 1e-30)
    linear = np.linalg.svd(level @ directions, full_matrices=False)[0]
    trend = modes.T @ linear
    share = np.sum(trend**2, 1)
    variance = (common * share + min(scatter, common) * (1 - share)) / weight
    return _Modes(modes, variance, modes.T @ ratio, trend)


def _log_likelihood(told: _Modes, each: float, smooth: float) -> float:
    """Return that of what is said, the given intensities being off by these variances."""
    own = told.variance + each
    weighted = told.trend.T / own
    inner = np.eye(told.trend.shape[1]) + smooth * weighted @ told.trend
    along = weighted @ told.said
    square = np.sum(told.said**2 / own) - smooth * along @ np.linalg.solve(inner, along)
    return -0.5 * (np.sum(np.log(own)) + np.linalg.slogdet(inner)[1] + square)

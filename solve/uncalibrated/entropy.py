"""Uncalibrated normals by the plainest albedo: few colours on the object make a peaked histogram.

Memory: 9 bytes a sample beside the samples themselves.
"""

from typing import NamedTuple

import numba
import numpy as np

from solve.methods import Method, Whole
from solve.problem import Problem
from solve.samples import Samples
from solve.uncalibrated.front_end import PLAIN, FrontEnd, family
from solve.uncalibrated.normals_and_lights import finish

TILT = np.linspace(-4, 4, 17)
LOG_DEPTH = np.linspace(-np.log(8), np.log(8), 21)
"""Of mu and nu the published range [Alldrin2007], of lambda twice the published 1/4 to 4: a low relief needs 6."""
_BINS = 1024
DOUBLE = 0.05
FLAT = 0.15


class Settings(NamedTuple):
    """Settings of `entropy`.

    Parameters
    ----------
    front_end : NamedTuple
    bins_per_mean : int
        The histogram's bins have the mean albedo divided by this for width.
    most_pixels : int
        Every so many pixels are taken, to have at most about these.
    """

    front_end: FrontEnd = FrontEnd()
    bins_per_mean: int = 64
    most_pixels: int = 6000


def fit_whole(problem: Problem, samples: Samples, settings: Settings) -> Whole:
    """Fit b = albedo x normal, and the lights.

    Notes
    -----
    (mu, nu, lambda) = argmin of the entropy of the histogram of |b G| / mean |b G| [Alldrin2007], over a grid, then
    around its lowest minima with steps that shrink. Each albedo is shared by two bins, so that the entropy is
    continuous.

    Do not believe it on texture, where every albedo is as likely as another, nor on shadows that were not cleaned
    away. It says so by a minimum that is flat, or one of two: the second is looked for, and its depth compared.
    """
    found = family(samples, problem.mask, settings.front_end)
    step = max(1, -(-len(found.b) // settings.most_pixels))
    b = np.ascontiguousarray(found.b[::step])
    bins_per_mean = settings.bins_per_mean
    grid = [[[_entropy(b, mu, nu, each, bins_per_mean) for each in LOG_DEPTH] for nu in TILT] for mu in TILT]
    minima = _lowest(np.array(grid))
    refined = [_refine(b, np.array([TILT[i], TILT[j], LOG_DEPTH[k]]), bins_per_mean) for i, j, k in minima]
    refined.sort(key=lambda each: each[0])
    (entropy, best), others = refined[0], refined[1:]
    cautions = []
    far = [value for value, place in others if _apart(best, place) > 0.3]
    if far and min(far) - entropy < DOUBLE:
        cautions.append(
            f"the entropy has a second minimum, only {min(far) - entropy:.3f} higher: another relief makes the albedo "
            "as plain."
        )
    depth = np.exp(best[2])
    around = [best + np.array(d) * [depth, depth, 1] * 0.15 for d in np.concatenate([np.eye(3), -np.eye(3)])]
    rise = min(_at(b, each, bins_per_mean) for each in around) - entropy
    if rise < FLAT:
        cautions.append(
            f"the entropy's minimum is flat (it rises by {rise:.3f} for a relief that differs by 15 %, expected "
            f"{FLAT}): the albedo varies too smoothly."
        )
    if np.max(np.abs(best[:2])) > 0.99 * TILT[-1] or abs(best[2]) > 0.99 * LOG_DEPTH[-1]:
        cautions.append("the entropy is least at the edge of the range that is searched.")
    relief = float(best[0]), float(best[1]), float(depth)
    return finish(found, relief, problem.mask, settings.front_end, *cautions)


def _at(b, place, bins):
    """Return the entropy at mu, nu, log lambda (3,)."""
    return _entropy(b, place[0], place[1], place[2], bins)


def plainest_depth(b, mu, nu):
    """Return lambda of least entropy for a tilt that is given; b (P, 3) float64."""
    bins_per_mean, most_pixels = Settings().bins_per_mean, Settings().most_pixels
    some = np.ascontiguousarray(b[:: max(1, -(-len(b) // most_pixels))])
    fine = np.linspace(LOG_DEPTH[0], LOG_DEPTH[-1], 401)
    return float(np.exp(fine[np.argmin([_entropy(some, mu, nu, each, bins_per_mean) for each in fine])]))


def _apart(one, other):
    """Return how far two reliefs differ, whatever the start: relative to the first one's depth."""
    depth = np.exp(one[2])
    return float(np.max(np.abs((one - other) / [depth, depth, 1])))


def _lowest(surface, count=8):
    """Return the indices of the lowest local minima of a grid (A, B, C), lowest first."""
    padded = np.pad(surface, 1, constant_values=np.inf)
    least = np.ones(surface.shape, bool)
    for axis in range(3):
        for move in (-1, 1):
            least &= surface <= np.roll(padded, move, axis)[1:-1, 1:-1, 1:-1]
    place = np.argwhere(least)
    return place[np.argsort(surface[tuple(place.T)], kind="stable")][:count]


def _refine(b, start, bins):
    """Return the entropy and place of the minimum near a grid point: the best of 27 neighbours, steps shrinking."""
    place, step = start.copy(), np.array([0.25, 0.25, 0.1])
    value = _at(b, place, bins)
    moves = [np.array(m) for m in np.ndindex(3, 3, 3)]
    for _ in range(40):
        trial = [place + (m - 1) * step for m in moves]
        values = [_at(b, t, bins) for t in trial]
        best = int(np.argmin(values))
        if values[best] < value - 1e-12:
            value, place = values[best], trial[best]
        else:
            step = step / 1.7
            if step[0] < 0.002:
                break
    place = np.clip(place, [TILT[0], TILT[0], LOG_DEPTH[0]], [TILT[-1], TILT[-1], LOG_DEPTH[-1]])
    return _at(b, place, bins), place


@numba.njit(nogil=True, cache=True)
def _entropy(b, mu, nu, log_depth, bins):  # pragma: no cover
    """Return the entropy, nats, of the histogram of |b G| / mean."""
    count = len(b)
    length = np.empty(count)
    depth = np.exp(log_depth)
    total = 0.0
    for i in range(count):
        x, y, z = b[i, 0] + mu * b[i, 2], b[i, 1] + nu * b[i, 2], depth * b[i, 2]
        length[i] = np.sqrt(x * x + y * y + z * z)
        total += length[i]
    if total <= 0.0:
        return np.inf
    histogram = np.zeros(_BINS + 1)
    factor = bins * count / total
    for i in range(count):
        place = length[i] * factor
        first = int(place)
        if first >= _BINS:
            histogram[_BINS] += 1.0
        else:
            share = place - first
            histogram[first] += 1.0 - share
            histogram[first + 1] += share
    out = 0.0
    for k in range(_BINS + 1):
        if histogram[k] > 0.0:
            out -= histogram[k] * np.log(histogram[k] / count)
    return out / count


METHOD = Method("entropy", {"default": Settings(), "seed": Settings(PLAIN)}, fit_whole=fit_whole, is_calibrated=False)

"""Uncalibrated normals by the plainest albedo: few colours on the object make a peaked histogram."""

import numpy as np
from scipy.ndimage import generate_binary_structure, minimum_filter
from scipy.optimize import minimize

from solve.methods import Method, Whole
from solve.problem import Problem
from solve.samples import Samples
from solve.uncalibrated.front_end import PLAIN, FrontEnd, family, finish

TILT = np.linspace(-4, 4, 17)
LOG_DEPTH = np.linspace(-np.log(8), np.log(8), 21)
"""Of mu and nu the published range [Alldrin2007], of lambda twice the published 1/4 to 4: a low relief needs 6."""
_BINS, _PER_MEAN = 1024, 64
"""Bins of the histogram, at most, and those up to the mean albedo."""
_PIXELS = 6000
"""Every so many pixels are taken, to have at most about these."""
STEPS = (0.25, 0.25, 0.1)
"""Of mu, nu and log lambda: where a search around a minimum begins."""
MINIMA = 8
DOUBLE = 0.05
FLAT = 0.15


def fit_whole(problem: Problem, samples: Samples, settings: FrontEnd) -> Whole:
    """Fit b = albedo x normal, and the lights.

    Notes
    -----
    (mu, nu, lambda) = argmin of the entropy of the histogram of |b G| / mean |b G| [Alldrin2007], over a grid, then
    around its lowest minima by a simplex that shrinks. Each albedo is shared by two bins, so that the entropy is
    continuous.

    Do not believe it on texture, where every albedo is as likely as another, nor on shadows that were not cleaned
    away. It says so by a minimum that is flat, or one of two: the second is looked for, and its depth compared.
    """
    found = family(samples, problem.mask, settings)
    b = _some(found.b)
    grid = [[[_entropy(b, mu, nu, each) for each in LOG_DEPTH] for nu in TILT] for mu in TILT]
    refined = [_refine(b, np.array([TILT[i], TILT[j], LOG_DEPTH[k]])) for i, j, k in _lowest(np.array(grid))]
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
    rise = min(_entropy(b, each[0], each[1], each[2]) for each in around) - entropy
    if rise < FLAT:
        cautions.append(
            f"the entropy's minimum is flat (it rises by {rise:.3f} for a relief that differs by 15 %, expected "
            f"{FLAT}): the albedo varies too smoothly."
        )
    if np.max(np.abs(best[:2])) > 0.99 * TILT[-1] or abs(best[2]) > 0.99 * LOG_DEPTH[-1]:
        cautions.append("the entropy is least at the edge of the range that is searched.")
    relief = float(best[0]), float(best[1]), float(depth)
    return finish(found, relief, problem.mask, settings, *cautions)


def plainest_depth(b, mu, nu):
    """Return lambda of least entropy for a tilt that is given; b (P, 3) float64."""
    some, fine = _some(b), np.linspace(LOG_DEPTH[0], LOG_DEPTH[-1], 401)
    return float(np.exp(fine[np.argmin([_entropy(some, mu, nu, each) for each in fine])]))


def _some(b):
    return np.ascontiguousarray(b[:: max(1, -(-len(b) // _PIXELS))])


def _apart(one, other):
    """Return how far two reliefs differ, whatever the start: relative to the first one's depth."""
    depth = np.exp(one[2])
    return float(np.max(np.abs((one - other) / [depth, depth, 1])))


def _lowest(surface):
    """Return the indices of the lowest local minima of a grid (A, B, C), lowest first."""
    beside = minimum_filter(surface, footprint=generate_binary_structure(3, 1), mode="nearest")
    place = np.argwhere(surface <= beside)
    return place[np.argsort(surface[tuple(place.T)], kind="stable")][:MINIMA]


def _refine(b, start):
    """Return the entropy and place of the minimum near a grid point."""
    bounds = [(TILT[0], TILT[-1]), (TILT[0], TILT[-1]), (LOG_DEPTH[0], LOG_DEPTH[-1])]
    # Inward from the edge of the range: a simplex needs its corners apart.
    inward = np.where(start > np.mean(bounds, 1), -1, 1) * STEPS
    simplex = np.concatenate([start[None], start + np.diag(inward)])
    how = {"initial_simplex": simplex, "xatol": 5e-4, "fatol": 1e-7, "maxfev": 500}
    found = minimize(lambda at: _entropy(b, *at), start, method="Nelder-Mead", bounds=bounds, options=how)
    return float(found.fun), found.x


def _entropy(b, mu, nu, log_depth):
    """Return the entropy, nats, of the histogram of |b G| / mean."""
    length = np.sqrt((b[:, 0] + mu * b[:, 2]) ** 2 + (b[:, 1] + nu * b[:, 2]) ** 2 + (np.exp(log_depth) * b[:, 2]) ** 2)
    if not length.any():
        return np.inf
    place = np.minimum(length * (_PER_MEAN / length.mean()), _BINS)
    first = place.astype(np.int64)
    share = place - first
    histogram = np.bincount(first, 1 - share, _BINS + 2) + np.bincount(first + 1, share, _BINS + 2)
    filled = histogram[histogram > 0] / len(b)
    return -float(np.sum(filled * np.log(filled)))


METHOD = Method("entropy", {"default": FrontEnd(), "seed": PLAIN}, fit_whole=fit_whole, is_calibrated=False)

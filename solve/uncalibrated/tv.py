"""Uncalibrated normals by the least total variation of the depth."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from scene.robust import spread
from solve.methods import Method, Whole
from solve.problem import Problem
from solve.samples import Samples
from solve.uncalibrated.entropy import plainest_depth
from solve.uncalibrated.front_end import PLAIN, FrontEnd, family, finish

Array = NDArray[np.float64]
UNEQUAL = 0.15


def fit_whole(problem: Problem, samples: Samples, settings: FrontEnd) -> Whole:
    """Fit b = albedo x normal, and the lights.

    Notes
    -----
    (mu, nu) = argmin sum |(b1 / b3 + mu, b2 / b3 + nu)|, the total variation of the depth [Queau2015]: minus the
    geometric median of the slopes. lambda from lights of one intensity: L1^2 + L2^2 + (L3 - mu L1 - nu L2)^2 / lambda^2
    is the same for all. Intensities that were calibrated are divided out before. Where they are not alike, lambda is
    that of the least entropy of the albedo, the authors' variant.

    Do not believe it where slopes do not balance: a leaning object, half a ball, a mask that ends where the object
    does not; nor under unequal intensities that nobody has measured.
    """
    found = family(samples, problem.mask, settings)
    slopes = found.b[:, :2] / np.where(np.abs(found.b[:, 2:]) > 1e-12, found.b[:, 2:], np.nan)
    mu, nu = -geometric_median(slopes[np.isfinite(slopes).all(1)])
    depth, unlike = depth_of_equal_lights(found.lights, mu, nu)
    cautions = []
    if depth is None or unlike > UNEQUAL:
        cautions.append(
            "no depth of the relief gives the lights one intensity (they would differ by "
            f"{'any amount' if depth is None else f'{unlike:.0%}'}, expected under {UNEQUAL:.0%}): it comes from the "
            "entropy of the albedo instead."
        )
        depth = plainest_depth(found.b, mu, nu)
    return finish(found, (mu, nu, depth), problem.mask, settings, *cautions)


def depth_of_equal_lights(lights: Array, mu: float, nu: float) -> tuple[float | None, float]:
    """Return lambda that makes lights (F, 3) equally strong for a given tilt, and their relative spread then.

    None where no lambda does. Least absolute deviations of L1^2 + L2^2 + x (L3 - mu L1 - nu L2)^2 = c,
    x = 1 / lambda^2: some lights may be off.
    """
    flat = np.sum(lights[:, :2] ** 2, 1)
    deep = (lights[:, 2] - mu * lights[:, 0] - nu * lights[:, 1]) ** 2
    weight = np.ones(len(lights))
    x = 0.0
    for _ in range(30):
        total = weight.sum()
        a, d = flat - weight @ flat / total, deep - weight @ deep / total
        x = -float(np.sum(weight * a * d)) / max(float(np.sum(weight * d * d)), 1e-300)
        residual = np.abs(a + x * d)
        weight = 1 / np.maximum(residual, 0.5 * np.median(residual) + 1e-12 * flat.mean())
    if x <= 0:
        return None, np.inf
    strength = np.sqrt(flat + x * deep)
    middle = float(np.median(strength))
    return float(x**-0.5), spread(strength - middle) / middle


def geometric_median(points):
    """Return the point (2,) with the least sum of distances to points (P, 2)."""
    scale = float(np.median(np.abs(points - np.median(points, axis=0)))) or 1.0

    def mean_distance(center):
        off = points - center
        length = np.maximum(np.linalg.norm(off, axis=1, keepdims=True), 1e-9 * scale)
        return length.mean() / scale, -np.mean(off / length, axis=0) / scale

    return minimize(mean_distance, np.median(points, axis=0), jac=True, tol=1e-10).x


# The plain reading; of the authors' four variants the benchmark names none.
METHOD = Method("tv", {"default": FrontEnd(), "seed": PLAIN}, fit_whole=fit_whole, is_calibrated=False)

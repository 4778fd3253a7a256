"""The unknowns of an adjustment at which its sum of squares is least."""

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.adjustment import Adjustment

Array = NDArray[np.float64]
ENOUGH, ROUNDED, BEGUN = 1e-7, 1e-13, 1e-2
"""Fall of the sum of squares, of residuals in sigmas, at which a fit is at rest, and what of it is rounding: what
still moves, moves by less than a thousandth of a sigma; and fall at which a bent one has served as a start."""
MOST_STEPS, FIRST_DAMPING, MOST_DAMPING = 40, 1e-4, 1e6
RIDGE = 1e-9  # keeps a light that no ball shows where it is


def minimum(problem: Adjustment, x: Array, *, bend: float = np.inf) -> Array:
    """Return the unknowns at which the sum of squares is least, by Levenberg's and Marquardt's steps.

    From about `bend` on a residual counts in proportion, not squared (soft L1), and the minimum is one to start from;
    inf: all are squared.
    """

    def cost(residual: Array) -> tuple[float, Array]:
        root = np.sqrt(1 + (residual / bend) ** 2)
        return float(np.sum(2 * residual**2 / (root + 1))), 1 / root

    damping, residual = FIRST_DAMPING, problem.residuals(x)
    before, weight = cost(residual)
    for _ in range(MOST_STEPS):
        slopes = problem.slopes(x)
        normal = slopes.T @ (weight[:, None] * slopes)
        gradient = slopes.T @ (weight * residual)
        while damping < MOST_DAMPING:
            moved = x - np.linalg.solve(normal + np.diag(damping * np.diag(normal) + RIDGE), gradient)
            left = problem.residuals(moved)
            after, lighter = cost(left)
            if after <= before:
                break
            damping *= 10
        else:
            return x
        fallen = before - after
        x, residual, before, weight, damping = moved, left, after, lighter, damping / 10
        if fallen <= (ENOUGH + ROUNDED * before if np.isinf(bend) else BEGUN):
            break
    return x

"""Least squares of many lights: each light's own few unknowns are eliminated, what they share is solved for.

No light touches another's unknowns, so J^T J is blocks on its diagonal, bordered by what is shared: the Schur
complement of the blocks is as small as the border, for ten lights as for a hundred [Triggs2000].
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ENOUGH, ROUNDED = 1e-7, 1e-13
"""Fall of the sum of squares, of residuals in sigmas, at which a fit is at rest, and what of it is rounding: what
still moves, moves by less than a thousandth of a sigma."""
MOST_STEPS, MOST_DAMPING = 40, 1e6


@dataclass(frozen=True)
class Rows:
    """The derivatives of R residuals.

    Parameters
    ----------
    shared : (R, m) float64
        By what the lights share.
    own : (R, p) float64
        By the unknowns of the one light that the residual hangs on.
    light : (R,) int
        Which one; any where `own` is 0.
    lights : int
    """

    shared: Array
    own: Array
    light: NDArray[np.intp]
    lights: int

    def covariance(self) -> "Covariance":
        """Return (J^T J)^-1."""
        return _eliminated(self, np.ones(len(self.own)), 0.0)[0]

    def step(self, residual: Array, weight: Array, damping: float) -> Array:
        """Return the step (m + F p,) of Levenberg and Marquardt."""
        found, solved = _eliminated(self, weight, damping)
        by_shared = -self.shared.T @ (weight * residual)
        by_own = -self.summed((weight * residual)[:, None] * self.own)
        shared = found.shared @ (by_shared - np.einsum("fpm,fp->m", solved, by_own))
        own = np.einsum("fpq,fq->fp", found.alone, by_own) - solved @ shared
        return np.concatenate([shared, own.ravel()])

    def summed(self, values: Array) -> Array:
        """Return (F, ...), the sums of values (R, ...) light by light."""
        out = np.zeros((self.lights, *values.shape[1:]))
        np.add.at(out, self.light, values)
        return out


@dataclass(frozen=True)
class Covariance:
    """The parts of a covariance that anybody asks for.

    Parameters
    ----------
    shared : (m, m) float64
    own : (F, p, p) float64
    mixed : (F, m, p) float64
        Of what is shared and each light's own.
    alone : (F, p, p) float64
        Of each light, were all that is shared known.
    """

    shared: Array
    own: Array
    mixed: Array
    alone: Array

    def leverage(self, rows: Rows) -> Array:
        """Return (R,) how much of each residual the unknowns take: the diagonal of J C J^T."""
        own, mixed = self.own[rows.light], self.mixed[rows.light]
        return (
            np.einsum("rm,mn,rn->r", rows.shared, self.shared, rows.shared)
            + 2 * np.einsum("rm,rmp,rp->r", rows.shared, mixed, rows.own)
            + np.einsum("rp,rpq,rq->r", rows.own, own, rows.own)
        )


def _eliminated(rows: Rows, weight: Array, damping: float) -> tuple[Covariance, Array]:
    """Return (J^T W J, its diagonal grown by `damping`)^-1, and what each light's unknowns follow the shared with."""
    weighted, grown = weight[:, None] * rows.own, 1 + damping
    blocks = rows.summed(weighted[:, :, None] * rows.own[:, None])
    border = rows.summed(weighted[:, :, None] * rows.shared[:, None])
    corner = rows.shared.T @ (weight[:, None] * rows.shared)
    every, all_shared = np.arange(blocks.shape[1]), np.arange(len(corner))
    blocks[:, every, every] *= grown
    corner[all_shared, all_shared] *= grown
    alone = np.asarray(np.linalg.pinv(blocks, hermitian=True), np.float64)
    solved = alone @ border
    shared = np.linalg.pinv(corner - np.einsum("fpm,fpn->mn", border, solved), hermitian=True)
    mixed = -shared @ solved.swapaxes(1, 2)
    return Covariance(shared, alone - solved @ mixed, mixed, alone), solved


def at_rest(residuals: Callable[[Array], Array], rows: Callable[[Array], Rows], x: Array, *, bend: float) -> Array:
    """Return the unknowns at which the sum of squares is least.

    Parameters
    ----------
    residuals, rows : callables
        Of the unknowns (m + F p,): what is to be small (R,), and its derivatives.
    x : (m + F p,) float
        The start.
    bend : float
        From about here on a residual counts in proportion, not squared (soft L1); inf: all are squared.
    """

    def cost(residual: Array) -> tuple[float, Array]:
        root = np.sqrt(1 + (residual / bend) ** 2)
        return float(np.sum(2 * residual**2 / (root + 1))), 1 / root

    damping, residual = 1e-4, residuals(x)
    before, weight = cost(residual)
    for _ in range(MOST_STEPS):
        slopes = rows(x)
        while damping < MOST_DAMPING:
            moved = x + slopes.step(residual, weight, damping)
            left = residuals(moved)
            after, lighter = cost(left)
            if after <= before:
                break
            damping *= 10
        else:
            return x
        fallen = before - after
        x, residual, before, weight, damping = moved, left, after, lighter, damping / 10
        if fallen <= ENOUGH + ROUNDED * before:
            break
    return x

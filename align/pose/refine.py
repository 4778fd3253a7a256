"""From a rough pose to the best one: Gauss-Newton on silhouette, normals and shading.

Each kind of evidence is a `Term`: residuals in units of its own robust scale, with their Jacobian. Terms are
minimised together under a bounded loss r^2 / (1 + r^2) [Geman1987]: what does not fit at all
(highlights, a support that was not scanned, a wrong patch of the mask) stops pulling.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import nudge
from scene.pose import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Term:
    """One kind of evidence at one pose."""

    residuals: Array
    """(K,): in units of the loss's scale."""
    jacobian: Array
    """(K, 6)."""
    blocks: NDArray[np.int64]
    """(K,): residuals of one block (a patch of the image) err together."""
    weight: float = 1.0
    """The term's share in the cost, which is weight * mean(r^2 / (1 + r^2))."""
    constant: float = 0.0
    """Cost without a slope, such as the area that does not overlap."""

    @property
    def cost(self) -> float:
        if not len(self.residuals):
            return self.weight + self.constant
        square = self.residuals**2
        return float(self.weight * np.mean(square / (1 + square)) + self.constant)

    def normal_equations(self) -> tuple[Array, Array]:
        """Return (6, 6) and (6,) of the reweighted least squares."""
        if not len(self.residuals):
            return np.zeros((6, 6)), np.zeros(6)
        pull = self.weight / len(self.residuals) / (1 + self.residuals**2) ** 2
        weighted = self.jacobian * pull[:, None]
        return weighted.T @ self.jacobian, weighted.T @ self.residuals

    def information(self, units: Array) -> tuple[Array, Array, float]:
        """Return what the term knows of K unknowns (K, K), its pull (K,), both in `units` (K,), and its design effect.

        The loss's scale is taken for three standard deviations. H = J^T W J / sigma^2 is the covariance's inverse if
        all residuals erred independently. They do not: a highlight, or a ripple of the scan, pulls a whole patch one
        way. The scatter of the patches' summed pulls, G = sum_blocks g g^T, replaces that assumption (sandwich
        H^-1 G H^-1, clustered [Liang1986]): the design effect, trace(H^-1 G) / K, is how much more the residuals err
        together than alone, and both answers are divided by it.
        """
        sigma = 1 / 3
        pull = 1 / (1 + self.residuals**2) ** 2 / sigma**2
        weighted = self.jacobian * pull[:, None]
        hessian = weighted.T @ self.jacobian
        _, block = np.unique(self.blocks, return_inverse=True)
        pulls = np.stack([np.bincount(block, column * self.residuals) for column in weighted.T], -1)
        slope = pulls.sum(0)
        pulls = pulls - pulls.sum(0) / max(len(pulls), 1)
        hessian, scatter = (m * units * units[:, None] for m in (hessian, pulls.T @ pulls))
        effect = max(1.0, float(np.trace(np.linalg.pinv(hessian, rcond=1e-9) @ scatter)) / len(units))
        return hessian / effect, slope * units / effect, effect


Evaluate = Callable[[Pose], Sequence[Term]]
"""Terms at a pose, their Jacobians for `nudge` about the scan's middle."""


def descend(evaluate: Evaluate, pose: Pose, middle_mm: Array, scales: NDArray, *, steps: int) -> tuple[Pose, float]:
    """Return the pose of lowest cost from `pose` on, and the cost, by Levenberg-Marquardt [Marquardt1963].

    `middle_mm` (3,) of the scan, its own frame; `scales` (6,): a small step of each twist, rotations in radians,
    translations in mm. A step is cut to 10 of these.
    """
    terms = evaluate(pose)
    cost = sum(term.cost for term in terms)
    damping = 1e-2
    for _ in range(steps):
        hessian, slope = _equations(terms, scales)
        ridge = damping * np.diag(hessian) + 1e-9 * np.trace(hessian)
        step = -np.linalg.lstsq(hessian + np.diag(ridge), slope, rcond=None)[0]
        step *= min(1.0, 10 / max(float(np.abs(step).max()), 1e-12))
        candidate = nudge(pose, step * scales, pose.apply(middle_mm))
        new_terms = evaluate(candidate)
        new_cost = sum(term.cost for term in new_terms)
        if new_cost < cost:
            small = cost - new_cost < 1e-5 * cost and float(np.abs(step).max()) < 0.02
            pose, cost, terms = candidate, new_cost, new_terms
            damping = max(damping / 5, 1e-5)
            if small:
                break
        else:
            if float(np.abs(step).max()) < 0.01:
                break
            damping = min(damping * 8, 1e3)
    return pose, cost


def settle(evaluate: Evaluate, pose: Pose, middle_mm: Array, scales: NDArray, *, steps: int) -> Pose:
    """Return the pose where Gauss-Newton's steps from `pose`, near the end of the descent, have become small.

    Near the end the cost's own ripples (a ray crosses an edge of the mesh, a sample its shadow's border) are larger
    than what is left to gain, and to ask for a lower cost is to stop at the first ripple. The slope is an average
    over many pixels: the place where it vanishes is well defined.
    """
    for _ in range(steps):
        hessian, slope = _equations(evaluate(pose), scales)
        step = -np.linalg.lstsq(hessian + 1e-9 * np.trace(hessian) * np.eye(6), slope, rcond=None)[0]
        last = float(np.abs(step).max())
        pose = nudge(pose, step * scales * min(1.0, 3 / max(last, 1e-12)), pose.apply(middle_mm))
        if last < 0.004:
            break
    return pose


def _equations(terms: Sequence[Term], scales: NDArray) -> tuple[Array, Array]:
    """Return the terms' normal equations, in units of the scales, so that millimetres and radians damp alike."""
    hessian, slope = (sum(parts) for parts in zip(*(term.normal_equations() for term in terms), strict=True))
    return hessian * scales * scales[:, None], slope * scales


def disagreement(one: tuple[Array, Array], two: tuple[Array, Array]) -> float:
    """Return by how many times their own variance two pieces of evidence contradict each other, at least 1.

    Each, information and pull (see `Term.information`), would alone step by -H^-1 slope. Where the two steps differ by
    more than their covariances allow, something is in neither model (bounced light, a light's error), and the
    covariance is inflated by the excess (Birge's ratio [Birge1932]).
    """
    covariances = [np.linalg.pinv(hessian, rcond=1e-9, hermitian=True) for hessian, _ in (one, two)]
    gap = covariances[0] @ one[1] - covariances[1] @ two[1]
    inverse = np.linalg.pinv(covariances[0] + covariances[1], rcond=1e-9, hermitian=True)
    return float(max(1.0, gap @ inverse @ gap / max(np.linalg.matrix_rank(inverse), 1)))


def robust_sigma(residuals: NDArray) -> float:
    """Return the standard deviation of the inliers: 1.4826 times the median magnitude."""
    return float(1.4826 * np.median(np.abs(residuals))) if residuals.size else np.inf

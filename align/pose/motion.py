"""Small motions of a pose, what they do in the image, and the descent to the pose that explains most.

Each kind of evidence is a `Term`: residuals in units of its own robust scale, with their Jacobian. Terms are minimised
together under a bounded loss r^2 / (1 + r^2) [Geman1987]: what does not fit at all (highlights, a support that was not
scanned, a wrong patch of the mask) stops pulling.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose, rotation_from_vector
from scene.robust import cluster_sums

Array = NDArray[np.float64]


def nudge(pose: Pose, twist: ArrayLike, pivot: ArrayLike) -> Pose:
    """Return `pose` (camera_from_scan) after a small motion in the camera frame.

    `twist` (6,): rotation vector (radians) about `pivot`, then translation (mm), camera axes. `pivot` (3,), mm: about
    the object's own middle, rotation and translation stay nearly independent; about the camera's centre a rotation of
    an object one metre away is mostly a translation.
    """
    twist, pivot = np.asarray(twist, np.float64), np.asarray(pivot, np.float64)
    turn = rotation_from_vector(twist[:3])
    return Pose.from_rotation_translation(turn, pivot + twist[3:] - pivot @ turn.T) @ pose


def small_steps(mesh: Mesh, camera: Camera, pose: Pose, *, step_px: float) -> Array:
    """Return (6,) twists (radians, mm) that each move the scan's image by about `step_px`; 0 where nothing moves."""
    depth = 1.0 if camera.is_orthographic else -float(pose.apply(mesh.center_mm)[2])
    side = step_px * depth / camera.fx
    along = 0.0 if camera.is_orthographic else side * depth / mesh.radius_mm
    return np.array([side / mesh.radius_mm] * 3 + [side, side, along])


def image_flow(camera: Camera, points: NDArray, pivot: NDArray) -> Array:
    """Return d(pixel)/d(twist) (P, 2, 6) of points (P, 3), camera frame, for `nudge` about `pivot`."""
    step_mm = 1e-4 * max(1.0, float(np.nanmax(np.abs(points[:, 2]), initial=0.0)))
    flow = np.stack(
        [(camera.project(points + step_mm * axis) - camera.project(points - step_mm * axis)) for axis in np.eye(3)], -1
    ) / (2 * step_mm)
    # d(point)/d(twist): omega x arm = -[arm]x omega, then the shift.
    jacobian = np.concatenate([-cross_matrices(points - pivot), np.broadcast_to(np.eye(3), (len(points), 3, 3))], -1)
    return flow @ jacobian


def cross_matrices(vectors: NDArray) -> Array:
    """Return (P, 3, 3) matrices [v]x of vectors (P, 3): [v]x w = v x w."""
    return np.cross(vectors[:, None], np.eye(3)).transpose(0, 2, 1)


def apart_px(mesh: Mesh, camera: Camera, a: Pose, b: Pose) -> float:
    """Return the rms distance, in pixels, between the images of the scan at two poses."""
    points = mesh.vertices[:: max(1, len(mesh.vertices) // 500)]
    apart = np.linalg.norm(a.apply(points) - b.apply(points), axis=1)
    scale = 1.0 if camera.is_orthographic else max(-float(a.apply(mesh.center_mm)[2]), 1e-9)
    return float(np.sqrt(np.mean(apart**2)) * camera.fx / scale)


def looking_along(directions: NDArray) -> Array:
    """Return rotations (..., 3, 3) that turn each unit direction (..., 3) to +z; the turn about z is arbitrary."""
    z = np.asarray(directions, np.float64)
    helper = np.where(np.abs(z[..., 2:]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    x = unit(np.cross(helper, z))
    return np.stack([x, np.cross(z, x), z], -2)


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
    is_prior: bool = False
    """Known beforehand, not measured: it has no outliers, and its cost is r^2."""

    @property
    def pull(self) -> Array:
        """(K,): weights of the reweighted least squares."""
        return np.ones(len(self.residuals)) if self.is_prior else 1 / (1 + self.residuals**2) ** 2

    def normal_equations(self) -> tuple[Array, Array]:
        """Return (6, 6) and (6,) of the reweighted least squares."""
        if not len(self.residuals):
            return np.zeros((6, 6)), np.zeros(6)
        weighted = self.jacobian * (self.weight / len(self.residuals) * self.pull)[:, None]
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
        weighted = self.jacobian * (self.pull / sigma**2)[:, None]
        hessian = weighted.T @ self.jacobian
        pulls = cluster_sums(weighted * self.residuals[:, None], self.blocks)
        slope = pulls.sum(0)
        pulls = pulls - pulls.sum(0) / max(len(pulls), 1)
        hessian, scatter = (m * units * units[:, None] for m in (hessian, pulls.T @ pulls))
        effect = max(1.0, float(np.trace(np.linalg.pinv(hessian, rcond=1e-9) @ scatter)) / len(units))
        return hessian / effect, slope * units / effect, effect


Evaluate = Callable[[Pose], Sequence[Term]]
"""Terms at a pose, their Jacobians for `nudge` about the scan's middle."""


def settle(evaluate: Evaluate, pose: Pose, middle_mm: Array, scales: NDArray, *, steps: int, longest: float) -> Pose:
    """Return the pose where Gauss-Newton's steps from `pose` have become small, or after so many `steps`.

    `middle_mm` (3,) of the scan, its own frame; `scales` (6,): a small step of each twist, rotations in radians,
    translations in mm; a step is cut to `longest` of these. No lower cost is asked for: near the end its ripples (a ray
    crosses an edge of the mesh, a sample its shadow's border) are larger than what is left to gain. The slope is an
    average over many pixels: the place where it vanishes is well defined.
    """
    for _ in range(steps):
        hessian, slope = _equations(evaluate(pose), scales)
        step = -np.linalg.lstsq(hessian + 1e-9 * np.trace(hessian) * np.eye(6), slope, rcond=None)[0]
        last = float(np.abs(step).max())
        pose = nudge(pose, step * scales * min(1.0, longest / max(last, 1e-12)), pose.apply(middle_mm))
        if last < 0.004:
            break
    return pose


def _equations(terms: Sequence[Term], scales: NDArray) -> tuple[Array, Array]:
    """Return the terms' normal equations, in units of the scales, so that millimetres and radians damp alike."""
    hessian, slope = (sum(parts) for parts in zip(*(term.normal_equations() for term in terms), strict=True))
    return hessian * scales * scales[:, None], slope * scales

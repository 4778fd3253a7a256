"""What an adjustment comes to: lights, balls, camera, and the covariance of all of them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.adjustment import Adjustment
from calibrate.lights.blocks import Covariance
from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]
CAP = 30.0
"""Sigmas at which a highlight that was left out counts in the comparison of models."""


@dataclass(frozen=True)
class LightFit:
    """Lights, balls and camera that explain the highlights.

    Parameters
    ----------
    camera : Camera
        Adjusted within its sigmas, which are then what is left of them.
    spheres : list of Sphere
        Adjusted.
    reference : (3,) float64
        Where the directions hold; it moves with the camera as the balls do.
    directions : (F, 3) float64
        At the reference point.
    positions_mm : (F, 3) float64 or None
    direction_sigma_deg : (F,) float64
        One tangent axis.
    range_sigma : (F,) float64
        Relative; NaN for distant lights.
    position_covariance_mm2 : (F, 3, 3) float64 or None
    residual_px : (S, F) float64
        Distance between the highlight and where the model mirrors the light; NaN where unused.
    used : (S, F) bool
    chi2 : float
        Sum of squared residuals in expected standard deviations.
    chi2_all : float
        The same with the highlights that were left out, each capped at `CAP` sigmas: to compare models.
    scale : float
        How many times larger the highlights' errors are than was stated, by their scatter.
    unknowns, observations : int
    """

    camera: Camera
    spheres: list[Sphere]
    reference: Array
    directions: Array
    positions_mm: Array | None
    direction_sigma_deg: Array
    range_sigma: Array
    position_covariance_mm2: Array | None
    residual_px: Array
    used: NDArray[np.bool_]
    chi2: float
    chi2_all: float
    scale: float
    unknowns: int
    observations: int

    @property
    def misfit(self) -> float:
        """Root of chi2 per degree of freedom: highlights, outlines, diameters against all that was stated of them."""
        # The loose priors of the ranges are no observations: each range takes its own.
        ranges = 0 if self.positions_mm is None else len(self.directions)
        return float(np.sqrt(self.chi2 / max(self.observations - self.unknowns - ranges, 1)))


def conclude(problem: Adjustment, x: Array) -> LightFit:
    """Return what the solution `x` says, with the covariance (J^T J)^-1 of the whitened problem."""
    camera, spheres = problem.camera_at(x), problem.balls_at(x)
    directions, inverse = problem.lights_at(x)
    residual, covariance = problem.residuals(x), problem.slopes(x).covariance()
    variance = np.diag(covariance.shared)
    own = np.diagonal(covariance.own, axis1=1, axis2=2)
    ball = problem.first_ball + 3 * np.arange(problem.balls)
    size = np.linalg.norm(problem.residual_pixels(x), axis=-1)
    left_out = np.isfinite(problem.highlights[..., 0]) & ~problem.used
    capped = np.minimum(np.nan_to_num(size / problem.stated, nan=CAP), CAP)[left_out]
    seen = 2 * int(problem.used.sum())
    chi2 = float(np.sum(residual[:seen] ** 2)) * problem.scale**2 + float(np.sum(residual[seen:] ** 2))
    reference = problem.reference_at(camera)
    return LightFit(
        _narrowed(problem, camera, variance),
        [
            replace(s, sigma_px=float(np.sqrt((variance[i] + variance[i + 1]) / 2)))
            for s, i in zip(spheres, ball, strict=True)
        ],
        reference,
        directions,
        reference + directions / inverse[:, None] if problem.near else None,
        np.rad2deg(np.sqrt((own[:, 0] + own[:, 1]) / 2)),
        np.sqrt(own[:, 2]) if problem.near else np.full(problem.lights, np.nan),
        _of_positions(problem, x, covariance) if problem.near else None,
        np.where(problem.used, size, np.nan),
        problem.used.copy(),
        chi2,
        chi2 + float(np.sum(capped**2)),
        problem.scale,
        len(x),
        len(residual),
    )


def _narrowed(problem: Adjustment, camera: Camera, variance: Array) -> Camera:
    """Return the adjusted camera with the sigmas that are left."""
    left = np.zeros(3)
    left[problem.free_camera] = np.sqrt(variance[: problem.first_ball])
    return replace(camera, focal_sigma=float(left[0]), center_sigma_px=float(np.hypot(left[1], left[2]) / np.sqrt(2)))


def _of_positions(problem: Adjustment, x: Array, covariance: Covariance) -> Array:
    """Return the covariances (F, 3, 3), mm^2, of reference + d / w: of the light's own unknowns and the camera's."""
    directions, inverse = problem.lights_at(x)
    side, up = problem.tangents(x, directions)
    own = np.stack([side, up, -directions], -1) / inverse[:, None, None]
    here, cameras = problem.reference_at(problem.camera_at(x)), problem.first_ball
    step = 1e-4 * np.eye(len(x))[:cameras]
    shared = np.zeros((3, cameras))
    for i, s in enumerate(step):
        shared[:, i] = (problem.reference_at(problem.camera_at(x + s)) - here) / 1e-4
    both = shared @ covariance.mixed[:, :cameras] @ own.swapaxes(1, 2)
    alone = own @ covariance.own @ own.swapaxes(1, 2)
    return alone + both + both.swapaxes(1, 2) + shared @ covariance.shared[:cameras, :cameras] @ shared.T

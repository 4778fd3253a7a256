"""The adjustment of balls and lights together: unknowns, residuals and their derivatives.

Each light is a direction at the reference point and an inverse range, 0 for a distant light, so that the
two models are one code and nested. Each ball may move within what its outline allows.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calibrate.directions import mean_directions, mirrored_rays
from scene.spheres import Sphere

Array = NDArray[np.float64]
NEAREST_INVERSE_MM = 1e-5
"""100 m: farther is distant."""
RANGE_PRIOR = 0.7
"""Loose relative prior of the range about the other lights': what one ball alone sees has no range of its own."""
INLIER_SIGMAS, INLIER_PX = 5.0, 1.0
CAP = 30.0


@dataclass(frozen=True)
class LightFit:
    """Lights and balls that explain the highlights.

    Parameters
    ----------
    spheres : list of Sphere
        Adjusted.
    directions : (F, 3) float64
        At the reference point.
    positions_mm : (F, 3) float64 or None
    direction_sigma_deg : (F,) float64
        One tangent axis.
    range_sigma : (F,) float64
        Relative; NaN for distant lights.
    residual_px : (S, F) float64
        Distance between the highlight and where the model mirrors the light; NaN where unused.
    used : (S, F) bool
    chi2 : float
        Sum of squared residuals in expected standard deviations.
    chi2_all : float
        The same with the highlights that were left out, each capped at `CAP` sigmas: to compare models.
    unknowns, observations : int
    """

    spheres: list[Sphere]
    directions: Array
    positions_mm: Array | None
    direction_sigma_deg: Array
    range_sigma: Array
    residual_px: Array
    used: NDArray[np.bool_]
    chi2: float
    chi2_all: float
    unknowns: int
    observations: int

    @property
    def reduced(self) -> float:
        """chi2 per degree of freedom."""
        return self.chi2 / max(self.observations - self.unknowns, 1)


def ray_meeting(points: Array, directions: Array) -> Array:
    """Return the point (3,) nearest to rays (K, 3), (K, 3) in the least-squares sense; NaN if they are parallel."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    normal = across.sum(0)
    if np.linalg.cond(normal) > 1e7:
        return np.full(3, np.nan)
    return np.linalg.solve(normal, np.einsum("kij,kj->i", across, points))


class Adjustment:
    """Unknowns: per ball (u, v, radius); per light two tangent components, and the inverse range if near."""

    def __init__(self, camera, spheres, covariances, highlights, sigma_px, reference, near) -> None:
        self.camera, self.spheres = camera, spheres
        self.highlights, self.sigma = highlights, sigma_px
        self.reference, self.near = np.asarray(reference, np.float64), near
        self.balls, self.lights = highlights.shape[:2]
        self.used = np.isfinite(highlights[..., 0])
        # Whitening of the outline's prior: |L^-1 d|^2 = d^T C^-1 d.
        self.whiten = [np.linalg.inv(np.linalg.cholesky(c)) for c in covariances]
        rays = [mirrored_rays(camera, s, h) for s, h in zip(spheres, highlights, strict=True)]
        points, directions = (np.stack(part) for part in zip(*rays, strict=True))
        self.origin = mean_directions(directions)
        self.inverse = np.zeros(self.lights)
        if near:
            for f in range(self.lights):
                seen = np.isfinite(directions[:, f, 0])
                if seen.sum() >= 2:
                    meeting = ray_meeting(points[seen, f], directions[seen, f]) - self.reference
                    distance = np.linalg.norm(meeting)
                    if np.isfinite(distance) and meeting @ self.origin[f] > 0:
                        self.origin[f] = meeting / distance
                        self.inverse[f] = 1 / distance
            typical = float(np.median(self.inverse[self.inverse > 0])) if (self.inverse > 0).any() else 1e-3
            self.inverse[self.inverse <= 0] = typical
            self.typical = typical
            self.inverse = np.clip(self.inverse, 0.2 * typical, 5 * typical)
        else:
            self.typical = 0.0
        # Two unit vectors across each direction.
        helper = np.where(np.abs(self.origin[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        self.side = np.cross(self.origin, helper)
        self.side /= np.linalg.norm(self.side, axis=1, keepdims=True)
        self.up = np.cross(self.origin, self.side)
        self.per_light = 3 if near else 2

    def start(self) -> Array:
        lights = np.zeros((self.lights, self.per_light))
        if self.near:
            lights[:, 2] = np.log(self.inverse)
        return np.concatenate([np.zeros(3 * self.balls), lights.ravel()])

    def unpack(self, x: Array) -> tuple[list[Sphere], Array, Array]:
        moves = x[: 3 * self.balls].reshape(self.balls, 3)
        spheres = [
            replace(s, center_px=s.center_px + m[:2], radius_px=float(s.radius_px + m[2]))
            for s, m in zip(self.spheres, moves, strict=True)
        ]
        lights = x[3 * self.balls :].reshape(self.lights, self.per_light)
        directions = self.origin + lights[:, :1] * self.side + lights[:, 1:2] * self.up
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        inverse = np.exp(np.clip(lights[:, 2], np.log(NEAREST_INVERSE_MM), 3.0)) if self.near else np.zeros(self.lights)
        return spheres, directions, inverse

    def residual_pixels(self, x: Array) -> Array:
        """Return (S, F, 2) px; NaN where unseen."""
        spheres, directions, inverse = self.unpack(x)
        out = np.full((self.balls, self.lights, 2), np.nan)
        for s, sphere in enumerate(spheres):
            out[s] = self._of_ball(sphere, self.highlights[s], directions, inverse)
        return out

    def _of_ball(self, sphere: Sphere, pixels: Array, directions: Array, inverse: Array | float) -> Array:
        step = 0.01
        points, seen = mirrored_rays(self.camera, sphere, pixels)
        target = directions + np.reshape(inverse, (-1, 1)) * (self.reference - points)
        target = target / np.linalg.norm(target, axis=1, keepdims=True)
        along = np.stack(
            [(mirrored_rays(self.camera, sphere, pixels + d)[1] - seen) / step for d in np.eye(2) * step], -1
        )
        normal = np.einsum("fik,fil->fkl", along, along)
        right = np.einsum("fik,fi->fk", along, seen - target)
        det = normal[:, 0, 0] * normal[:, 1, 1] - normal[:, 0, 1] ** 2
        return (
            np.stack(
                [
                    normal[:, 1, 1] * right[:, 0] - normal[:, 0, 1] * right[:, 1],
                    normal[:, 0, 0] * right[:, 1] - normal[:, 0, 1] * right[:, 0],
                ],
                -1,
            )
            / det[:, None]
        )

    def agreeing(self, x: Array, f: int, balls: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Return (S,) which balls of a frame to believe: all but the one without which the others agree best.

        Of two that contradict each other nobody knows which is right: the surer one is kept.
        """
        keep = np.zeros(self.balls, bool)
        if len(balls) < 3:
            keep[balls[self.sigma[balls, f].argmin()]] = True
            return keep
        spheres = self.unpack(x)[0]
        x_of_light = x[3 * self.balls + self.per_light * f :][: self.per_light]
        misses = []
        for left_out in balls:
            others = [int(s) for s in balls if s != left_out]

            def miss(light: Array, others: list[int] = others) -> Array:
                direction = self.origin[f] + light[0] * self.side[f] + light[1] * self.up[f]
                near = np.exp(np.clip(light[2], np.log(NEAREST_INVERSE_MM), 3.0)) if self.near else 0.0
                rows = [
                    self._of_ball(
                        spheres[s], self.highlights[s, f : f + 1], direction[None] / np.linalg.norm(direction), near
                    )
                    for s in others
                ]
                return np.nan_to_num(np.concatenate(rows).ravel(), nan=1e3)

            misses.append(float(least_squares(miss, x_of_light, loss="soft_l1").cost))
        keep[balls] = True
        keep[balls[int(np.argmin(misses))]] = False
        return keep

    def _left_out(self, x: Array) -> float:
        size = np.linalg.norm(self.residual_pixels(x), axis=-1) / self.sigma
        out = np.isfinite(self.highlights[..., 0]) & ~self.used
        return float(np.sum(np.minimum(np.nan_to_num(size[out], nan=CAP), CAP) ** 2))

    def residuals(self, x: Array) -> Array:
        pixels = self.residual_pixels(x) / self.sigma[..., None]
        # Off the ball there is no mirror; a large constant keeps the step from going there.
        pixels = np.where(np.isfinite(pixels), pixels, 1e3)
        moves = x[: 3 * self.balls].reshape(self.balls, 3)
        prior = np.concatenate([w @ m for w, m in zip(self.whiten, moves, strict=True)])
        parts = [pixels[self.used].ravel(), prior]
        if self.near:
            parts.append((x[3 * self.balls + 2 :: 3] - np.log(self.typical)) / RANGE_PRIOR)
        return np.concatenate(parts)

    def jacobian(self, x: Array) -> Array:
        """Differences, but of all lights at once: no light acts on another's highlights."""
        step = 1e-6
        base = self.residuals(x)
        out = np.zeros((len(base), len(x)))
        for i in range(3 * self.balls):
            moved = x.copy()
            moved[i] += step
            out[:, i] = (self.residuals(moved) - base) / step
        light_of_row = np.full(len(base), -1)
        pairs = np.nonzero(self.used)[1]
        light_of_row[: 2 * len(pairs)] = np.repeat(pairs, 2)
        if self.near:
            light_of_row[-self.lights :] = np.arange(self.lights)
        rows = np.flatnonzero(light_of_row >= 0)
        for k in range(self.per_light):
            moved = x.copy()
            moved[3 * self.balls + k :: self.per_light] += step
            change = (self.residuals(moved) - base) / step
            out[rows, 3 * self.balls + self.per_light * light_of_row[rows] + k] = change[rows]
        return out

    def result(self, x: Array) -> LightFit:
        spheres, directions, inverse = self.unpack(x)
        residual = self.residuals(x)
        jacobian = self.jacobian(x)
        chi2 = float(residual @ residual)
        observations = 2 * int(self.used.sum()) + 3 * self.balls + (self.lights if self.near else 0)
        excess = max(1.0, chi2 / max(observations - len(x), 1))
        covariance = np.linalg.pinv(jacobian.T @ jacobian) * excess
        first = 3 * self.balls + self.per_light * np.arange(self.lights)
        variance = np.diag(covariance)
        sigma = np.rad2deg(np.sqrt((variance[first] + variance[first + 1]) / 2))
        moved = [
            replace(s, sigma_px=float(np.sqrt((variance[3 * i] + variance[3 * i + 1]) / 2)))
            for i, s in enumerate(spheres)
        ]
        pixels = np.where(self.used, np.linalg.norm(self.residual_pixels(x), axis=-1), np.nan)
        return LightFit(
            moved,
            directions,
            self.reference + directions / inverse[:, None] if self.near else None,
            sigma,
            np.sqrt(variance[first + 2]) if self.near else np.full(self.lights, np.nan),
            pixels,
            self.used.copy(),
            chi2,
            chi2 + self._left_out(x),
            len(x),
            observations,
        )

"""The adjustment of camera, balls and lights together: unknowns, residuals, derivatives, least squares.

Each light is a direction at the reference point and an inverse range, 0 for a distant light, so that the
two models are one code and nested. Each ball may move within what its outline allows, each diameter and the camera
within what is known of them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from calibrate.lights.directions import (
    SURROUNDINGS_DEG,
    Shading,
    mirrored_rays,
    no_shading,
    two_across,
)
from calibrate.silhouette.outline import moved, outline_shift
from scene.camera import Camera
from scene.normals import unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
LOG_INVERSE_RANGE = np.log(1e-5), 3.0  # bounds, of 1 / mm: 100 m, farther is distant; and what keeps a step finite
RANGE_PRIOR = 0.7
"""Loose relative prior of the range about the other lights': what one ball alone sees has no range of its own."""
STEP, PIXEL_STEP = 1e-4, 0.01
"""Of the differences by the unknowns, in sigmas' order of magnitude, and by the pixel: the mirror's law is smooth."""
ALL, NONE = -1, -2  # in place of a ball's or a light's number: what depends on all of them, and on none
FREEDOM = 6  # of outlines' errors, which are Student's: a circle that is another thing's lies far off
ALONE, HARDLY = 25.0, 1e-4  # chi-square of three numbers from which an outline is another thing's; its weight then
OFF_BALL = 1e3  # sigmas: off the ball there is no mirror; a large constant keeps the step from going there


@dataclass(frozen=True)
class ObservedSpots:
    """What S chrome balls, and white ones' shading, show of F lights, and how well it is known."""

    camera: Camera  # its `focal_sigma` and `center_sigma_px` say how far it may move; 0: not at all
    spheres: list[Sphere]
    covariances: list[Array]  # (3, 3) of each ball's (u, v, radius), px^2
    highlights: Array  # (S, F, 2) pixels, NaN where unseen; each frame needs one ball, chrome or white, at least
    sigma_px: Array  # (S, F)
    reference: Array  # (3,) where the directions hold, mm
    diameter_sigma: Array | None = None  # (S,) relative, of the diameters; 0 or None: exact
    shading: Shading | None = None


class Adjustment:
    """Unknowns: the camera's log focal length and centre; per ball (u, v, radius) and the log of its diameter; what the
    surroundings add to the white balls' shading (3); per light two tangent components, and the log of the inverse range
    if near. What is known exactly is left out.

    Notes
    -----
    A highlight's residual is, to first order, its distance in the picture from where the light would be mirrored: the
    angle between the mirrored ray and the direction to the light, through the inverse of d(direction) / d(pixel).
    Minimising it in the picture weights small and slanted mirrors rightly [Ackermann2013].
    """

    def __init__(self, seen: ObservedSpots, *, near: bool) -> None:
        self.seen, self.near, self.camera = seen, near, seen.camera
        self.reference = np.asarray(seen.reference, np.float64)
        self.sigma, self.scale = seen.sigma_px, 1.0
        self.balls, self.lights = seen.highlights.shape[:2]
        self.used = np.isfinite(seen.highlights[..., 0])
        self.shading = seen.shading or no_shading(self.lights)
        self.shaded = self.shading.clear  # which of it is used
        camera = seen.camera
        known = np.array([camera.focal_sigma, camera.center_sigma_px, camera.center_sigma_px], np.float64)
        camera_sigma = np.zeros(3) if camera.is_orthographic else known
        diameter_sigma = np.zeros(self.balls) if seen.diameter_sigma is None else seen.diameter_sigma
        self.shifts = [outline_shift(camera, s) if camera_sigma.any() else np.zeros((3, 3)) for s in seen.spheres]
        # Columns of x: camera, balls, diameters, the shading's bend, then the lights.
        self.free_camera, self.free_diameters = np.flatnonzero(camera_sigma), np.flatnonzero(diameter_sigma)
        self.first_ball = len(self.free_camera)
        self.first_diameter = self.first_ball + 3 * self.balls
        self.first_bend = self.first_diameter + len(self.free_diameters)
        self.first_light = self.first_bend + 3 * self.shaded.any()
        self.per_light = 3 if near else 2
        every, each = np.arange(self.lights), np.arange(self.balls)
        nothing = np.full(self.first_light - self.first_bend + self.per_light * self.lights, ALL)
        of_all = np.full(self.first_ball, ALL), np.repeat(each, 3), self.free_diameters, nothing
        self.ball_of = np.concatenate(of_all).astype(int)
        self.light_of = np.concatenate([np.full(self.first_light, ALL), np.repeat(every, self.per_light)]).astype(int)
        typical = self._start_lights()
        # What is small beside the highlights: prior @ (x - middle). |L^-1 d|^2 = d^T C^-1 d whitens the outlines'.
        prior = block_diag(
            np.diag(1 / camera_sigma[self.free_camera]),
            *(np.linalg.inv(np.linalg.cholesky(c)) for c in seen.covariances),
            np.diag(1 / diameter_sigma[self.free_diameters]),
            np.eye(self.first_light - self.first_bend) / np.deg2rad(SURROUNDINGS_DEG),
            *([[[0, 0, 1 / RANGE_PRIOR]]] * self.lights if near else [np.zeros((0, 2 * self.lights))]),
        )
        self.stated = np.asarray(prior, np.float64)
        self.prior, self.outline_weight = self.stated, np.ones(self.balls)
        self.middle = np.zeros(len(self.ball_of))
        self.middle[self.first_light + 2 :: 3] = np.log(typical) if near else 0

    def _start_lights(self) -> float:
        """Set the lights to begin with, as far as the camera; return that inverse range, 1 / mm."""
        shown_by = zip(self.seen.spheres, self.seen.highlights, strict=True)
        toward = unit(np.nansum([mirrored_rays(self.camera, ball, pixels)[1] for ball, pixels in shown_by], axis=0))
        toward = np.where(np.isfinite(toward), toward, self.shading.rough)
        typical = 1 / max(float(np.linalg.norm(self.reference)), 1.0)
        self._begin(toward, np.full(self.lights, typical if self.near else 0.0))
        return typical

    def _begin(self, toward: Array, inverse: Array) -> None:
        self.origin, self.inverse = toward, inverse
        self.side, self.up = two_across(toward)

    def start(self, positions: Array | None = None) -> Array:
        """Return the unknowns (n,) to begin with; `positions` (F, 3): of near lights, where they are known."""
        if positions is not None:
            away = positions - self.reference
            distance = np.linalg.norm(away, axis=1)
            self._begin(away / distance[:, None], 1 / distance)
        x = self.middle.copy()
        if self.near:
            x[self.first_light + 2 :: 3] = np.log(self.inverse)
        return x

    def _camera_change(self, x: Array) -> Array:
        change = np.zeros(3)
        change[self.free_camera] = x[: self.first_ball]
        return change

    def camera_at(self, x: Array) -> Camera:
        """Return the adjusted camera."""
        change = self._camera_change(x)
        if not change.any():
            return self.camera
        c, grown = self.camera, float(np.exp(change[0]))
        return replace(c, fx=c.fx * grown, fy=c.fy * grown, cx=c.cx + float(change[1]), cy=c.cy + float(change[2]))

    def ball_at(self, x: Array, ball: int) -> Sphere:
        """Return an adjusted ball: what the camera's change does to a given outline, and its own move."""
        first = self.first_ball + 3 * ball
        found = moved(self.seen.spheres[ball], x[first : first + 3] + self.shifts[ball] @ self._camera_change(x))
        for column in np.flatnonzero(self.free_diameters == ball):
            factor = float(np.exp(x[self.first_diameter + column]))
            found = replace(found, diameter_mm=2 * found.radius_mm * factor)
        return found

    def reference_at(self, camera: Camera) -> Array:
        """Return the reference point in an adjusted camera: the same pixel, farther by what the lens is longer."""
        if camera is self.camera or self.camera.is_orthographic or self.reference[2] >= 0:
            return self.reference
        pixel = self.camera.project(self.reference)
        return camera.points_at_depth(pixel, self.reference[2] * camera.fx / self.camera.fx)

    def lights_at(self, x: Array) -> tuple[Array, Array]:
        """Return directions (F, 3) and inverse ranges (F,)."""
        lights = x[self.first_light :].reshape(self.lights, self.per_light)
        directions = unit(self.origin + lights[:, :1] * self.side + lights[:, 1:2] * self.up)
        if not self.near:
            return directions, np.zeros(self.lights)
        return directions, np.exp(np.clip(lights[:, 2], *LOG_INVERSE_RANGE))

    def positions_at(self, x: Array) -> Array:
        """Return the positions (F, 3) of near lights, mm."""
        directions, inverse = self.lights_at(x)
        return self.reference_at(self.camera_at(x)) + directions / inverse[:, None]

    def residual_pixels(self, x: Array) -> Array:
        """Return (S, F, 2) px; NaN where unseen."""
        camera, (directions, inverse) = self.camera_at(x), self.lights_at(x)
        reference, out = self.reference_at(camera), []
        beside = PIXEL_STEP * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        for ball, highlights in enumerate(self.seen.highlights):
            # The highlights' pixels, and beside them, at once: each call costs more than what it does.
            points, rays = mirrored_rays(camera, self.ball_at(x, ball), highlights + beside[:, None])
            seen, (a, b) = rays[0], (rays[1:] - rays[0]) / PIXEL_STEP
            aa, ab, bb = np.sum(a * a, 1), np.sum(a * b, 1), np.sum(b * b, 1)
            inverted = np.stack([bb[:, None] * a - ab[:, None] * b, aa[:, None] * b - ab[:, None] * a], 1)
            inverted /= (aa * bb - ab * ab)[:, None, None]
            # d + w (ref - x) points from the ball to the light.
            target = unit(directions + inverse[:, None] * (reference - points[0]))
            # Stereographic: it grows all the way to the opposite direction, where that of the sine is 0 again.
            half = np.maximum(1 + np.sum(seen * target, 1), 1e-6)[:, None] / 2
            out.append(np.einsum("fki,fi->fk", inverted, seen - target) / half)
        return np.stack(out)

    def shading_misses(self, x: Array) -> Array:
        """Return (W, F, 2) sigmas; NaN where a white ball shows too little."""
        bend = x[self.first_bend : self.first_light]
        return self.shading.misses(*self.lights_at(x), self.reference, bend if len(bend) else np.zeros(3))

    def outline_chi2(self, x: Array) -> Array:
        """Return (S,): by how much each ball is moved, against its outline's covariance."""
        rows = slice(self.first_ball, self.first_diameter)
        return np.sum((self.stated[rows] @ (x - self.middle)).reshape(-1, 3) ** 2, 1)

    def outline_excess(self, x: Array) -> float:
        """Return by how much -2 log of Student's density is above the outlines' weighted squares."""
        chi2 = self.outline_chi2(x)
        return float(np.sum((FREEDOM + 3) * np.log1p(chi2 / FREEDOM) - self.outline_weight * chi2))

    def loosen(self, x: Array) -> None:
        """Let outlines that the highlights contradict count less, as Student's errors do [Lange1989].

        Where all but one of three and more agree, that one hardly counts.
        """
        chi2 = self.outline_chi2(x)
        self.outline_weight = np.minimum((FREEDOM + 3) / (FREEDOM + chi2), 1)
        if self.balls > 2 and (chi2 > ALONE).sum() == 1:
            self.outline_weight[chi2 > ALONE] = HARDLY
        self.prior = self.stated.copy()
        self.prior[self.first_ball : self.first_diameter] *= np.repeat(np.sqrt(self.outline_weight), 3)[:, None]

    def _misses(self, x: Array) -> Array:
        """Return (S + W, F, 2) sigmas: what highlights and shading miss by."""
        return np.concatenate([self.residual_pixels(x) / self.sigma[..., None], self.shading_misses(x)])

    def residuals(self, x: Array) -> Array:
        """Return what is to be small, in sigmas: the highlights and the shading that are used, then the priors."""
        misses = self._misses(x)[np.concatenate([self.used, self.shaded])]
        misses = np.where(np.isfinite(misses), misses, OFF_BALL)
        return np.concatenate([misses.ravel(), self.prior @ (x - self.middle)])

    def slopes(self, x: Array) -> Array:
        """Return the derivatives (R, n) of `residuals`."""
        ball = np.concatenate([np.arange(self.balls), np.full(len(self.shaded), NONE)])
        every = np.broadcast_to(np.arange(self.lights)[:, None], (len(ball), self.lights, 2))
        slopes = self._slopes(self._misses, x, np.broadcast_to(ball[:, None, None], every.shape), every)
        used = slopes[np.concatenate([self.used, self.shaded])].reshape(-1, len(x))
        return np.concatenate([np.nan_to_num(used), self.prior])

    def position_slopes(self, x: Array) -> Array:
        """Return the derivatives (F, 3, n) of the positions by all unknowns; a light's by the other lights' are 0."""
        light = np.repeat(np.arange(self.lights)[:, None], 3, 1)
        return self._slopes(self.positions_at, x, np.full(light.shape, NONE), light)

    def _slopes(self, of: Callable[[Array], Array], x: Array, ball: Array, light: Array) -> Array:
        """Return the derivatives (..., n) of a function's values (...), each of which is of one ball and one light.

        By differences; all balls, and all lights, are moved at once: none moves another's values.
        """
        here, out = of(x), np.zeros((*light.shape, len(x)))
        columns = np.arange(len(x))
        balls, lights = columns[self.first_ball : self.first_diameter], columns[self.first_light :]
        groups = [[k] for k in range(self.first_ball)] + [balls[k::3] for k in range(3)]
        groups += [columns[self.first_diameter : self.first_bend]]
        groups += [[k] for k in range(self.first_bend, self.first_light)]
        groups += [lights[k :: self.per_light] for k in range(self.per_light)]
        for group in groups:
            if len(group):
                beside = x.copy()
                beside[group] += STEP
                own = (self.ball_of[group] == ALL) | (self.ball_of[group] == ball[..., None])
                own &= (self.light_of[group] == ALL) | (self.light_of[group] == light[..., None])
                out[..., group] = np.where(own, ((of(beside) - here) / STEP)[..., None], 0)
        return out

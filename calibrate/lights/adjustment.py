"""The adjustment of camera, balls and lights together: unknowns, residuals, derivatives, covariance.

Each light is a direction at the reference point and an inverse range, 0 for a distant light, so that the
two models are one code and nested. Each ball may move within what its outline allows, each diameter and the camera
within what is known of them.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.blocks import Rows
from calibrate.lights.directions import mean_directions, mirrored_rays
from calibrate.silhouette.outline import moved, offset_jacobian, outline_with_normals
from scene.camera import Camera
from scene.spheres import Sphere

Array = NDArray[np.float64]
NEAREST_INVERSE_MM = 1e-5
"""100 m: farther is distant."""
RANGE_PRIOR = 0.7
"""Loose relative prior of the range about the other lights': what one ball alone sees has no range of its own."""
FLATNESS, FLATNESS_SIGMA = 0.3, 0.3
"""What is known of the flashes' flatness: the data tell it hardly from another distance, but sigma knows of it."""
STEP = 1e-4
"""Of the differences by balls and camera, in sigmas' order of magnitude: the law of the mirror is smooth."""


def ray_meeting(points: Array, directions: Array) -> Array:
    """Return the point (3,) nearest to rays (K, 3), (K, 3) in the least-squares sense; NaN if they are parallel."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    normal = across.sum(0)
    if np.linalg.cond(normal) > 1e7:
        return np.full(3, np.nan)
    return np.linalg.solve(normal, np.einsum("kij,kj->i", across, points))


class Adjustment:
    """Unknowns: the camera's log focal length and centre; per ball (u, v, radius) and the log of its diameter; per
    light two tangent components, and the log of the inverse range if near; and the flashes' flatness. What is known
    exactly is left out.

    Notes
    -----
    A glowing ball is mirrored about its centre. The near half of a flat head that faces the reference point looks
    larger: at angle t between its axis and the ball, its picture of angular half size a lies k a^2 sin t cos t beside
    its centre, k = 0 for a glowing ball, 1/3 for a flat one's centroid, 1 for its outline. Small, but the same on all
    balls: it would pass for another distance.
    """

    def __init__(
        self,
        camera: Camera,
        spheres: list[Sphere],
        covariances: list[Array],
        highlights: Array,
        sigma_px: Array,
        reference: Array,
        *,
        near: bool,
        diameter_sigma: Array | None = None,
        extents_px: Array | None = None,
    ) -> None:
        self.camera, self.spheres = camera, spheres
        self.highlights, self.stated = highlights, sigma_px
        self.sigma, self.scale = sigma_px, 1.0
        self.reference, self.near = np.asarray(reference, np.float64), near
        self.balls, self.lights = highlights.shape[:2]
        self.used = np.isfinite(highlights[..., 0])
        # Whitening of the outline's prior: |L^-1 d|^2 = d^T C^-1 d.
        self.whiten = [np.linalg.inv(np.linalg.cholesky(c)) for c in covariances]
        known = [camera.focal_sigma, camera.center_sigma_px, camera.center_sigma_px]
        self.camera_sigma = np.zeros(3) if camera.is_orthographic else np.array(known, np.float64)
        self.diameter_sigma = np.zeros(self.balls) if diameter_sigma is None else diameter_sigma
        self.shifts = [_outline_shift(camera, s) if self.camera_sigma.any() else np.zeros((3, 3)) for s in spheres]
        # Columns of x: camera, balls, diameters, then the lights.
        self.free_camera = np.flatnonzero(self.camera_sigma)
        self.free_diameters = np.flatnonzero(self.diameter_sigma)
        self.first_ball = len(self.free_camera)
        self.first_diameter = self.first_ball + 3 * self.balls
        # With one ball, or distant lights, no flatness could be told from a turn.
        self.extents = np.zeros((self.balls, self.lights)) if extents_px is None else extents_px
        self.flat = bool(near and self.balls > 1 and self.extents.any())
        self.first_light = self.first_diameter + len(self.free_diameters) + self.flat
        self.per_light = 3 if near else 2
        self._start_lights()

    def _start_lights(self) -> None:
        rays = [mirrored_rays(self.camera, s, h) for s, h in zip(self.spheres, self.highlights, strict=True)]
        points, directions = (np.stack(part) for part in zip(*rays, strict=True))
        self.origin = mean_directions(directions)
        self.inverse = np.zeros(self.lights)
        self.typical = 0.0
        if self.near:
            for f in range(self.lights):
                seen = np.isfinite(directions[:, f, 0])
                if seen.sum() >= 2:
                    meeting = ray_meeting(points[seen, f], directions[seen, f]) - self.reference
                    distance = np.linalg.norm(meeting)
                    if np.isfinite(distance) and meeting @ self.origin[f] > 0:
                        self.origin[f] = meeting / distance
                        self.inverse[f] = 1 / distance
            some = self.inverse[self.inverse > 0]
            self.typical = float(np.median(some)) if len(some) else 1e-3
            self.inverse = np.where(self.inverse > 0, self.inverse, self.typical)
            self.inverse = np.clip(self.inverse, 0.2 * self.typical, 5 * self.typical)
        # Two unit vectors across each direction.
        helper = np.where(np.abs(self.origin[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
        self.side = np.cross(self.origin, helper)
        self.side /= np.linalg.norm(self.side, axis=1, keepdims=True)
        self.up = np.cross(self.origin, self.side)

    def start(self) -> Array:
        """Return the unknowns (n,) to begin with."""
        lights = np.zeros((self.lights, self.per_light))
        if self.near:
            lights[:, 2] = np.log(self.inverse)
        shared = np.zeros(self.first_light)
        shared[self.first_light - self.flat :] = FLATNESS
        return np.concatenate([shared, lights.ravel()])

    def camera_at(self, x: Array) -> Camera:
        """Return the adjusted camera."""
        change = self._camera_change(x)
        if not change.any():
            return self.camera
        c, grown = self.camera, float(np.exp(change[0]))
        return replace(c, fx=c.fx * grown, fy=c.fy * grown, cx=c.cx + float(change[1]), cy=c.cy + float(change[2]))

    def _camera_change(self, x: Array) -> Array:
        change = np.zeros(3)
        change[self.free_camera] = x[: self.first_ball]
        return change

    def balls_at(self, x: Array) -> list[Sphere]:
        """Return the adjusted balls: what the camera's change does to a given outline, and their own moves."""
        moves = x[self.first_ball : self.first_diameter].reshape(self.balls, 3)
        change = self._camera_change(x)
        out = [moved(s, m + shift @ change) for s, m, shift in zip(self.spheres, moves, self.shifts, strict=True)]
        for column, i in enumerate(self.free_diameters):
            factor = float(np.exp(x[self.first_diameter + column]))
            out[i] = replace(out[i], diameter_mm=2 * out[i].radius_mm * factor)
        return out

    def reference_at(self, camera: Camera) -> Array:
        """Return the reference point in an adjusted camera: the same pixel, farther by what the lens is longer."""
        if camera is self.camera or self.camera.is_orthographic or self.reference[2] >= 0:
            return self.reference
        pixel = self.camera.project(self.reference)
        return camera.points_at_depth(pixel, self.reference[2] * camera.fx / self.camera.fx)

    def lights_at(self, x: Array) -> tuple[Array, Array]:
        """Return directions (F, 3) and inverse ranges (F,)."""
        lights = x[self.first_light :].reshape(self.lights, self.per_light)
        directions = self.origin + lights[:, :1] * self.side + lights[:, 1:2] * self.up
        directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        inverse = np.exp(np.clip(lights[:, 2], np.log(NEAREST_INVERSE_MM), 3.0)) if self.near else np.zeros(self.lights)
        return directions, inverse

    def residual_pixels(self, x: Array) -> Array:
        """Return (S, F, 2) px; NaN where unseen."""
        lights = self.lights_at(x)
        return np.stack([self._of_ball(x, s, *lights)[0] for s in range(self.balls)])

    def _of_ball(self, x: Array, ball: int, directions: Array, inverse: Array) -> tuple[Array, Array, Array, Array]:
        """Return the residuals (F, 2), the picture's derivative by direction (F, 2, 3), q (F, 3) and its arm (F, 3).

        q = d + w (ref - x) points from the ball to the light; the arm is its derivative by log w.
        """
        camera, sphere, pixels = self.camera_at(x), self.balls_at(x)[ball], self.highlights[ball]
        step = 0.01
        points, seen = mirrored_rays(camera, sphere, pixels)
        arm = inverse[:, None] * (self.reference_at(camera) - points)
        toward = directions + arm
        target = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        along = [(mirrored_rays(camera, sphere, pixels + d)[1] - seen) / step for d in np.eye(2) * step]
        a, b = along
        aa, ab, bb = np.sum(a * a, 1), np.sum(a * b, 1), np.sum(b * b, 1)
        if self.flat:
            square = self.extents[ball] ** 2 * (aa + bb) / 2
            cosine = np.sum(directions * target, 1)
            beside = (square * cosine)[:, None] * (directions - cosine[:, None] * target)
            target = target + x[self.first_light - 1] * beside
        determinant = (aa * bb - ab * ab)[:, None]
        inverted = np.stack(
            [(bb[:, None] * a - ab[:, None] * b) / determinant, (aa[:, None] * b - ab[:, None] * a) / determinant], 1
        )
        # Stereographic: the residual grows all the way to the opposite direction, where that of the sine is 0 again.
        half = np.maximum(1 + np.sum(seen * target, 1), 1e-6)[:, None] / 2
        residual = np.einsum("fki,fi->fk", inverted, seen - target) / half
        return residual, (inverted + residual[:, :, None] * seen[:, None] / 2) / half[:, None], toward, arm

    def residuals(self, x: Array) -> Array:
        """Return what is to be small: highlights in sigmas, then the priors of balls, camera, diameters, ranges."""
        pixels = self.residual_pixels(x) / self.sigma[..., None]
        # Off the ball there is no mirror; a large constant keeps the step from going there.
        pixels = np.where(np.isfinite(pixels), pixels, 1e3)
        moves = x[self.first_ball : self.first_diameter].reshape(self.balls, 3)
        return np.concatenate(
            [
                pixels[self.used].ravel(),
                *(w @ m for w, m in zip(self.whiten, moves, strict=True)),
                x[: self.first_ball] / self.camera_sigma[self.free_camera],
                x[self.first_diameter : self.first_light - self.flat] / self.diameter_sigma[self.free_diameters],
                (x[self.first_light - self.flat : self.first_light] - FLATNESS) / FLATNESS_SIGMA,
                (x[self.first_light + 2 :: 3] - np.log(self.typical)) / RANGE_PRIOR if self.near else [],
            ]
        )

    def slopes(self, x: Array) -> Rows:
        """Return the derivatives of `residuals`: closed form by the lights, central differences by what is shared."""
        shared = np.zeros((self.balls, self.lights, 2, self.first_light))
        own = np.zeros((self.balls, self.lights, 2, self.per_light))
        directions, inverse = self.lights_at(x)
        tangents = self.tangents(x, directions)
        for s in range(self.balls):
            for i in self._of_shared(s):
                step = STEP * np.eye(len(x))[i]
                ends = [self._of_ball(y, s, directions, inverse)[0] for y in (x + step, x - step)]
                shared[s, ..., i] = (ends[0] - ends[1]) / (2 * STEP)
            _, inverted, toward, arm = self._of_ball(x, s, directions, inverse)
            length = np.linalg.norm(toward, axis=1)[:, None]
            target = toward / length
            for k, move in enumerate([*tangents, arm][: self.per_light]):
                across = (move - target * np.sum(target * move, 1, keepdims=True)) / length
                own[s, ..., k] = -np.einsum("fki,fi->fk", inverted, across)
        by_shared, by_own = (
            np.nan_to_num((part / self.sigma[..., None, None])[self.used]).reshape(-1, part.shape[-1])
            for part in (shared, own)
        )
        light = np.repeat(np.nonzero(self.used)[1], 2)
        # The priors: of balls, camera and diameters; then of each light's range.
        prior = np.zeros((self.first_light, self.first_light))
        for s, whiten in enumerate(self.whiten):
            prior[3 * s : 3 * s + 3, self.first_ball + 3 * s : self.first_ball + 3 * s + 3] = whiten
        cameras, diameters = np.arange(self.first_ball), np.arange(self.first_diameter, self.first_light - self.flat)
        prior[3 * self.balls + cameras, cameras] = 1 / self.camera_sigma[self.free_camera]
        prior[diameters, diameters] = 1 / self.diameter_sigma[self.free_diameters]
        if self.flat:
            prior[-1, -1] = 1 / FLATNESS_SIGMA
        ranges = np.arange(self.lights if self.near else 0)
        of_range = np.zeros((len(ranges), self.per_light))
        of_range[:, 2:] = 1 / RANGE_PRIOR
        return Rows(
            np.concatenate([by_shared, prior, np.zeros((len(ranges), self.first_light))]),
            np.concatenate([by_own, np.zeros((self.first_light, self.per_light)), of_range]),
            np.concatenate([light, np.zeros(self.first_light, np.intp), ranges]),
            self.lights,
        )

    def _of_shared(self, ball: int) -> list[int]:
        """Return which shared unknowns move a ball's highlights: the camera's, its own, the flashes' flatness."""
        own = self.first_ball + 3 * ball
        diameter = self.first_diameter + np.flatnonzero(self.free_diameters == ball)
        flatness = range(self.first_light - self.flat, self.first_light)
        return [*range(self.first_ball), *range(own, own + 3), *diameter, *flatness]

    def tangents(self, x: Array, directions: Array) -> tuple[Array, Array]:
        """Return the derivatives (F, 3) of the directions by their two tangent components."""
        lights = x[self.first_light :].reshape(self.lights, self.per_light)
        length = np.linalg.norm(self.origin + lights[:, :1] * self.side + lights[:, 1:2] * self.up, axis=1)[:, None]
        side, up = ((v - directions * np.sum(directions * v, 1, keepdims=True)) / length for v in (self.side, self.up))
        return side, up


def _outline_shift(camera: Camera, sphere: Sphere) -> Array:
    """Return (3, 3): what (u, v, radius) must change by with log f, cx and cy so that the outline stays where it is.

    The outline was measured, the cone is inferred. What is left over, that the ellipse is a little longer or shorter,
    is not used: it tells the focal length to 2 % a ball at best, and a lens whose k1 is 0.05 fakes 10 %.
    """
    points, normals = outline_with_normals(camera, sphere, 90)
    jacobian = offset_jacobian(camera, sphere, points, normals)
    other = [
        replace(camera, fx=camera.fx * 1.001, fy=camera.fy * 1.001),
        replace(camera, cx=camera.cx + 1),
        replace(camera, cy=camera.cy + 1),
    ]
    offsets = [np.sum((sphere.outline(c, 90) - points) * normals, 1) for c in other]
    return np.asarray(-np.linalg.lstsq(jacobian, np.stack(offsets, -1) / [0.001, 1.0, 1.0], rcond=None)[0], np.float64)

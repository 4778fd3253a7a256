"""Calibration balls: what was asked for, and what was found."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import Frames

Kind = Literal["chrome", "white"]
KINDS: tuple[Kind, ...] = get_args(Kind)
WHITE_BALL_ALBEDO = 0.8
"""Reflectance that a session's white balls are taken to have."""


@dataclass(frozen=True)
class SphereRequest:
    """One `[[spheres]]` entry of a session: what the user says of a ball.

    `mask` is (H, W) bool, the ball's silhouette; `frames` holds the ball's own photographs when it
    was shot apart from the object, same lights, same order.
    """

    kind: Kind
    diameter_mm: float | None = None
    center_px: tuple[float, float] | None = None
    radius_px: float | None = None
    mask: NDArray[np.bool_] | None = None
    frames: Frames | None = None


@dataclass(frozen=True)
class Sphere:
    """A ball in the picture.

    Parameters
    ----------
    center_px : (2,) float64
        Projection of the ball's centre (not the centre of its outline, which perspective shifts outward).
    radius_px : float
        fx R / -z of the centre: the three numbers (center_px, radius_px) fix the cone of the silhouette.
    sigma_px : float
        Standard deviation of the circle's three numbers (u, v, radius), root mean square.
    score : float
        0 to 1, how much of the outline was seen where the fit says it is.
    apart : bool
        Photographed apart from the object (its pixels are not in the session's frames).
    diameter_sigma : float
        Relative standard deviation of `diameter_mm`; 0 where it was stated.
    """

    kind: Kind
    center_px: NDArray[np.float64]
    radius_px: float
    diameter_mm: float | None = None
    sigma_px: float = 0.0
    score: float = 1.0
    apart: bool = False
    diameter_sigma: float = 0.0

    def __repr__(self) -> str:
        u, v = self.center_px
        size = f", diameter {self.diameter_mm:g} mm" if self.diameter_mm else ""
        return f"{self.kind} ball at ({u:.1f}, {v:.1f}) px, radius {self.radius_px:.1f} px{size}"

    @property
    def radius_mm(self) -> float:
        """The radius; 1 where the diameter is unknown, which leaves directions exact."""
        return self.diameter_mm / 2 if self.diameter_mm else 1.0

    def center_mm(self, camera: Camera) -> NDArray[np.float64]:
        """Return the centre (3,) in the camera frame, in units of `radius_mm`.

        An orthographic camera does not tell depth: the centre is then put at z = -radius_mm.
        """
        if camera.is_orthographic:
            # The scale of an orthographic camera comes from the ball itself.
            mm_per_px = self.radius_mm / self.radius_px
            u, v = self.center_px
            return np.array([(u - camera.cx) * mm_per_px, -(v - camera.cy) * mm_per_px, -self.radius_mm])
        return camera.points_at_depth(self.center_px, -camera.fx * self.radius_mm / self.radius_px)

    def normals(self, camera: Camera, pixels: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return what the rays through pixels (..., 2) meet on the ball.

        Returns
        -------
        normals : (..., 3) float64
            Outward unit normals, NaN where the ray misses.
        points : (..., 3) float64
            In units of `radius_mm`.

        Notes
        -----
        x = s d with |s d - c| = R: s = d.c - sqrt((d.c)^2 - |c|^2 + R^2). Exact under perspective;
        the orthographic formula is wrong by 10 degrees at 11 degrees off axis.
        """
        center = self.center_mm(camera)
        pixels = np.asarray(pixels, np.float64)
        if camera.is_orthographic:
            xy = (pixels - self.center_px) / self.radius_px * [1.0, -1.0]
            square = 1 - np.sum(xy * xy, -1, keepdims=True)
            z = np.sqrt(np.where(square >= 0, square, np.nan))
            normals = np.where(square >= 0, np.concatenate([xy, z], -1), np.nan)
            return normals, center + self.radius_mm * normals
        _, rays = camera.rays(pixels)
        along = rays @ center
        square = along**2 - center @ center + self.radius_mm**2
        s = along - np.sqrt(np.where(square >= 0, square, np.nan))
        points = s[..., None] * rays
        return (points - center) / self.radius_mm, points

    def outline(self, camera: Camera, count: int = 360) -> NDArray[np.float64]:
        """Return (count, 2) pixels on the silhouette: an ellipse under perspective.

        Each lies in the middle of its share of the turn, whatever the count.
        """
        angle = (np.arange(count) + 0.5) * (2 * np.pi / count)
        if camera.is_orthographic:
            return self.center_px + self.radius_px * np.stack([np.cos(angle), np.sin(angle)], -1)
        center, radius = self.center_mm(camera), self.radius_mm
        distance = np.linalg.norm(center)
        axis = center / distance
        # The circle of tangency: its plane cuts the axis at d - R^2/d, its radius is R sqrt(1 - (R/d)^2).
        side = np.cross(axis, [0.0, 1.0, 0.0])
        side /= np.linalg.norm(side)
        up = np.cross(side, axis)
        ring = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up
        return camera.project(
            axis * (distance - radius**2 / distance) + ring * radius * np.sqrt(1 - (radius / distance) ** 2)
        )

    def mask(self, camera: Camera, *, grow_px: float = 0.0) -> NDArray[np.bool_]:
        """Return (H, W) bool, the ball's silhouette, grown by `grow_px`."""
        grown = replace(self, radius_px=self.radius_px + grow_px)
        out = np.zeros((camera.height, camera.width), bool)
        # Only the box around the outline: a small ball in 24 megapixels must stay cheap.
        low = np.floor(grown.outline(camera).min(0)).astype(int)
        high = np.ceil(grown.outline(camera).max(0)).astype(int) + 1
        u0, v0 = np.clip(low, 0, [camera.width, camera.height])
        u1, v1 = np.clip(high, 0, [camera.width, camera.height])
        v, u = np.mgrid[v0:v1, u0:u1]
        normals, _ = grown.normals(camera, np.stack([u, v], -1))
        out[v0:v1, u0:u1] = np.isfinite(normals[..., 0])
        return out

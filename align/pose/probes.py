"""Pixels whose rays are cast again and again: what they see of the scan, and how that changes as the scan moves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import point_jacobian
from scene.camera import Camera
from scene.normals import unit
from scene.pose import Pose
from scene.rays import Hits, RayCaster

Array = NDArray[np.float64]

BESIDE = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""A pixel and its four neighbours, in steps."""
STRAIGHT = 0.2
"""Cosine between neighbours' normals under which a fold lies between them, and the slope tells nothing."""


@dataclass(frozen=True)
class Probes:
    """P pixels with their rays, undistorted once.

    Parameters
    ----------
    camera : Camera
    pixels : (P, 2) float64
    step_px : float
        How far beside each pixel its neighbours are cast.
    origins, directions : (5, P, 3) float64
        Of the pixel's ray and its four neighbours'.
    """

    camera: Camera
    pixels: Array
    step_px: float
    origins: Array
    directions: Array

    @classmethod
    def of(cls, camera: Camera, pixels: NDArray, *, step_px: float) -> "Probes":
        """Prepare the rays."""
        pixels = np.asarray(pixels, np.float64)
        origins, directions = camera.rays(pixels + step_px * BESIDE[:, None])
        return cls(camera, pixels, step_px, origins, directions)

    def surface(self, caster: RayCaster, pose: Pose) -> tuple[Array, Array]:
        """Return points and unit normals (P, 3), camera frame; NaN where the scan is missed.

        Through a hole in the scan its inside is seen: there, normals are NaN, too.
        """
        return _seen(caster, pose, self.origins[0], self.directions[0])

    def slopes(self, caster: RayCaster, pose: Pose, points: Array, normals: Array, pivot: Array) -> Array:
        """Return d(normal)/d(twist) (P, 3, 6) at the fixed pixels, for `nudge` about `pivot`; 0 where unknown.

        A turn w turns the normal by w x n. The surface's point moves in the image, too, and the pixel sees the one
        that was beside it: minus the normal's slope in the image times that flow. Central differences over
        neighbouring rays give the slope; one-sided ones would take a scan's ripples for a slope.
        """
        back = pose.inverse()
        count = len(points)
        hits = caster.cast(back.apply(self.origins[1:].reshape(-1, 3)), back.rotate(self.directions[1:].reshape(-1, 3)))
        beside = _normals(caster, pose, hits).reshape(4, count, 3)
        flow = image_flow(self.camera, points, pivot)
        out = np.zeros((count, 3, 6))
        # w x n, column by column.
        x, y, z = normals.T
        out[:, 1, 0], out[:, 2, 0] = -z, y
        out[:, 0, 1], out[:, 2, 1] = z, -x
        out[:, 0, 2], out[:, 1, 2] = -y, x
        for axis in range(2):
            ahead, behind = beside[2 * axis], beside[2 * axis + 1]
            slope = (ahead - behind) / (2 * self.step_px)
            smooth = np.einsum("pk,pk->p", ahead, behind) > STRAIGHT
            out -= np.where(smooth[:, None], slope, np.nan)[:, :, None] * flow[:, axis, None, :]
        out[~np.isfinite(out).all((1, 2))] = 0
        return out


def surface(caster: RayCaster, camera: Camera, pose: Pose, pixels: NDArray) -> tuple[Array, Array]:
    """Return points and unit normals (P, 3), camera frame, that pixels see; see `Probes.surface`."""
    return _seen(caster, pose, *camera.rays(pixels))


def image_flow(camera: Camera, points: NDArray, pivot: NDArray) -> Array:
    """Return d(pixel)/d(twist) (P, 2, 6) of points (P, 3), camera frame, for `nudge` about `pivot`."""
    step_mm = 1e-4 * max(1.0, float(np.nanmax(np.abs(points[:, 2]), initial=0.0)))
    flow = np.stack(
        [(camera.project(points + step_mm * axis) - camera.project(points - step_mm * axis)) for axis in np.eye(3)], -1
    ) / (2 * step_mm)
    return flow @ point_jacobian(points, pivot)


def _seen(caster: RayCaster, pose: Pose, origins: Array, directions: Array) -> tuple[Array, Array]:
    back = pose.inverse()
    hits = caster.cast(back.apply(origins), back.rotate(directions))
    points = origins + directions * np.where(hits.hit, hits.distance, np.nan)[:, None]
    return points, _normals(caster, pose, hits)


def _normals(caster: RayCaster, pose: Pose, hits: Hits) -> Array:
    normals = unit(pose.rotate(hits.interpolate(caster.mesh, caster.normals)))
    normals[~hits.front] = np.nan
    return normals

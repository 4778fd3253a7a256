"""What pixels see of the scan at a pose, and how that changes as the scan moves."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import cross_matrices, image_flow
from scene.camera import Camera
from scene.normals import unit
from scene.pose import Pose
from scene.rays import Hits, RayCaster

Array = NDArray[np.float64]

BESIDE = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
"""A pixel and its four neighbours."""
STRAIGHT = 0.2
"""Cosine between neighbours' normals under which a fold lies between them, and the slope tells nothing."""


@dataclass(frozen=True)
class View:
    """A scan at a pose (camera_from_scan) before a camera."""

    caster: RayCaster
    camera: Camera
    pose: Pose

    @property
    def pivot(self) -> Array:
        """(3,) the scan's middle, camera frame, mm: what `nudge` turns about."""
        return self.pose.apply(self.caster.mesh.center_mm)

    def hits(self, pixels: NDArray) -> Hits:
        """Return what pixels (P, 2) see of the scan."""
        return self._cast(*self.camera.rays(pixels))

    def normals(self, hits: Hits) -> Array:
        """Return the unit normals (P, 3), camera frame, interpolated over the faces that were hit; NaN elsewhere."""
        return unit(self.pose.rotate(hits.interpolate(self.caster.mesh, self.caster.normals)))

    def surface(self, origins: Array, directions: Array) -> tuple[Array, Array]:
        """Return points and unit normals (P, 3), camera frame, that rays meet; NaN where the scan is missed.

        Through a hole in the scan its inside is seen: there, normals are NaN, too.
        """
        hits = self._cast(origins, directions)
        points, normals = origins + directions * np.where(hits.hit, hits.distance, np.nan)[:, None], self.normals(hits)
        normals[~hits.front] = np.nan
        return points, normals

    def _cast(self, origins: Array, directions: Array) -> Hits:
        back = self.pose.inverse()
        return self.caster.cast(back.apply(origins), back.rotate(directions), lines=self.camera.is_orthographic)


def probe_rays(camera: Camera, pixels: NDArray) -> tuple[Array, Array]:
    """Return origins and directions (5, P, 3) of the rays of pixels (P, 2) and of their four neighbours."""
    return camera.rays(np.asarray(pixels, np.float64) + BESIDE[:, None])


def normal_slopes(view: View, rays: tuple[Array, Array], points: Array, normals: Array) -> Array:
    """Return d(normal)/d(twist) (P, 3, 6) at fixed pixels, for `nudge` about the scan's middle; 0 if unknown.

    `rays`: their `probe_rays`; points and normals (P, 3): what they see. A turn w turns the normal by w x n. The
    surface's point moves in the image, too, and the pixel sees the one that was beside it: minus the normal's slope in
    the image times that flow. Central differences over neighbouring rays give the slope; one-sided ones would take a
    scan's ripples for a slope.
    """
    beside = view.surface(*(part[1:].reshape(-1, 3) for part in rays))[1].reshape(4, len(points), 3)
    flow = image_flow(view.camera, points, view.pivot)
    out = np.zeros((len(points), 3, 6))
    out[:, :, :3] = -cross_matrices(normals)
    for axis in range(2):
        ahead, behind = beside[2 * axis], beside[2 * axis + 1]
        smooth = np.einsum("pk,pk->p", ahead, behind) > STRAIGHT
        out -= np.where(smooth[:, None], (ahead - behind) / 2, np.nan)[:, :, None] * flow[:, axis, None, :]
    out[~np.isfinite(out).all((1, 2))] = 0
    return out

"""What mask and photometric normals say about a pose: a wide basin, a rough answer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.probes import Probes
from align.pose.refine import Term
from align.pose.rim import Rim, find_rim, outline_jacobian, sample, signed_distance
from scene.camera import Camera
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

UNKNOWN = 0.15
"""Residual, in units of the loss, of a pixel that looks into a hole of the scan: little more than of one explained."""


def small_steps(mesh: Mesh, camera: Camera, pose: Pose, *, step_px: float) -> Array:
    """Return (6,) twists (radians, mm) that each move the scan's image by about `step_px`; 0 where nothing moves."""
    depth = 1.0 if camera.is_orthographic else -float(pose.apply(mesh.center_mm)[2])
    side = step_px * depth / camera.fx
    along = 0.0 if camera.is_orthographic else side * depth / mesh.radius_mm
    return np.array([side / mesh.radius_mm] * 3 + [side, side, along])


@dataclass(frozen=True)
class RoughEvidence:
    """Silhouette against mask, and rendered against photometric normals."""

    camera: Camera
    mask: NDArray[np.bool_]
    distance: NDArray[np.float32]
    probes: Probes
    targets: Array
    cells: int
    step_px: float

    @classmethod
    def of(
        cls, camera: Camera, mask: NDArray[np.bool_], normals: NDArray, *, cells: int, count: int
    ) -> "RoughEvidence":
        """Prepare for a raster of `cells` across the object and `count` normals."""
        import cv2

        v, u = np.nonzero(mask)
        size = max(np.ptp(u), np.ptp(v)) + 1
        step = float(size / cells)
        known = mask & np.isfinite(normals).all(-1)
        smooth = cv2.GaussianBlur(
            np.where(known[..., None], normals, 0).astype(np.float32), (0, 0), max(0.4 * step, 0.5)
        )
        v, u = np.nonzero(known)
        pick = np.unique(np.linspace(0, len(v) - 1, min(count, len(v))).astype(int))
        target = smooth[v[pick], u[pick]].astype(np.float64)
        target /= np.linalg.norm(target, axis=1, keepdims=True)
        pixels = np.stack([u, v], -1)[pick].astype(np.float64)
        probes = Probes.of(camera, pixels, step_px=0.5 * step)
        return cls(camera, mask, signed_distance(mask), probes, target, cells, step)

    def rim(self, caster: RayCaster, pose: Pose) -> Rim:
        return find_rim(caster, self.camera, pose, cells=self.cells)

    def terms(self, caster: RayCaster, pose: Pose) -> list[Term]:
        """Return the terms at a pose."""
        pivot = pose.apply(caster.mesh.center_mm)
        rim = self.rim(caster, pose)
        reach = 2 * self.step_px
        # The slope of the mask's distance, not of the outline's: it is what the residual follows.
        ahead = [sample(self.distance, rim.pixels + d * rim.outward) for d in (-1.0, 0.0, 1.0)]
        slope = (ahead[2] - ahead[0]) / 2
        jacobian = outline_jacobian(self.camera, rim.points, rim.outward, pivot) * slope[:, None]
        outline = Term(
            ahead[1] / reach,
            jacobian / reach,
            np.zeros(len(slope), np.int64),
            constant=1 - rim.overlap(self.mask),
        )
        points, normals = self.probes.surface(caster, pose)
        seen = np.isfinite(normals[:, 0])
        scale = 0.5
        residual = np.where(seen[:, None], (normals - self.targets) / scale, 3.0)
        # Through a hole nothing is known: neither good nor bad.
        residual[~seen & np.isfinite(points[:, 0])] = UNKNOWN
        slopes = np.where(seen[:, None, None], self.probes.slopes(caster, pose, points, normals, pivot) / scale, 0.0)
        flat = slopes.reshape(-1, 6)
        normal_term = Term(residual.ravel(), flat, np.zeros(len(flat), np.int64), weight=3.0)
        return [outline, normal_term]

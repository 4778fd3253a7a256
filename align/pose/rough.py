"""What mask and photometric normals say about a pose: a wide basin, a rough answer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import apart_px, small_steps
from align.pose.photographed import Target
from align.pose.refine import Term, descend
from align.pose.scan_outline import find_outline, outline_jacobian, sample, signed_distance
from align.pose.scan_view import Probes, View
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

UNKNOWN = 0.15
"""Residual, in units of the loss, of a pixel that looks into a hole of the scan: little more than of one explained."""


@dataclass(frozen=True)
class RoughEvidence:
    """Silhouette against mask, and rendered against photometric normals."""

    caster: RayCaster
    target: Target
    distance: NDArray[np.float32]
    """(H, W), see `signed_distance`."""
    probes: Probes
    normals: Array
    """(P, 3) at the probes: photometric, smoothed."""
    cells: int
    step_px: float

    @classmethod
    def of(cls, caster: RayCaster, target: Target, *, cells: int, count: int) -> "RoughEvidence":
        """Prepare for a raster of `cells` across the object and `count` normals."""
        import cv2

        v, u = np.nonzero(target.mask)
        size = max(np.ptp(u), np.ptp(v)) + 1
        step = float(size / cells)
        known = target.mask & np.isfinite(target.normals).all(-1)
        smooth = cv2.GaussianBlur(
            np.where(known[..., None], target.normals, 0).astype(np.float32), (0, 0), max(0.4 * step, 0.5)
        )
        v, u = np.nonzero(known)
        pick = np.unique(np.linspace(0, len(v) - 1, min(count, len(v))).astype(int))
        normals = smooth[v[pick], u[pick]].astype(np.float64)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        pixels = np.stack([u, v], -1)[pick].astype(np.float64)
        probes = Probes.of(target.camera, pixels, step_px=0.5 * step)
        return cls(caster, target, signed_distance(target.mask), probes, normals, cells, step)

    def terms(self, pose: Pose) -> list[Term]:
        """Return the terms at a pose."""
        view = View(self.caster, self.target.camera, pose)
        found = find_outline(view, cells=self.cells)
        reach = 2 * self.step_px
        # The slope of the mask's distance, not of the outline's: it is what the residual follows.
        ahead = [sample(self.distance, found.pixels + d * found.outward) for d in (-1.0, 0.0, 1.0)]
        slope = (ahead[2] - ahead[0]) / 2
        jacobian = outline_jacobian(view.camera, found.points, found.outward, view.pivot) * slope[:, None]
        blocks = np.zeros(len(slope), np.int64)
        outline = Term(ahead[1] / reach, jacobian / reach, blocks, constant=1 - found.overlap(self.target.mask))
        points, normals = self.probes.surface(self.caster, pose)
        seen = np.isfinite(normals[:, 0])
        scale = 0.5
        residual = np.where(seen[:, None], (normals - self.normals) / scale, 3.0)
        # Through a hole nothing is known: neither good nor bad.
        residual[~seen & np.isfinite(points[:, 0])] = UNKNOWN
        slopes = np.where(seen[:, None, None], self.probes.slopes(self.caster, pose, points, normals) / scale, 0.0)
        flat = slopes.reshape(-1, 6)
        return [outline, Term(residual.ravel(), flat, np.zeros(len(flat), np.int64), weight=3.0)]

    def descend(self, steps: int, pose: Pose) -> tuple[Pose, float]:
        """Return the pose of lowest cost from `pose` on, and the cost."""
        mesh = self.caster.mesh
        scales = small_steps(mesh, self.target.camera, pose, step_px=self.step_px)
        return descend(self.terms, pose, mesh.center_mm, scales, steps=steps)

    def distinct(self, found: list[tuple[Pose, float]], *, apart_steps: float) -> list[tuple[Pose, float]]:
        """Return the poses, lowest cost first, without those that lie so near to a better one."""
        mesh, camera, kept = self.caster.mesh, self.target.camera, []
        for pose, cost in sorted(found, key=lambda item: item[1]):
            if all(apart_px(mesh, camera, pose, other) > apart_steps * self.step_px for other, _ in kept):
                kept.append((pose, cost))
        return kept

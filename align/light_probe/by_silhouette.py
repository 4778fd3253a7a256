"""What the mask alone says about a pose: a wide basin, a rough answer."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.motion import distinct, small_steps
from align.pose.photographed import longer_side
from align.pose.refine import Term, descend
from align.pose.scan_outline import find_outline, outline_jacobian, sample, signed_distance
from align.pose.scan_view import View
from scene.camera import Camera
from scene.pose import Pose
from scene.rays import RayCaster


@dataclass(frozen=True)
class BySilhouette:
    """Silhouette against mask."""

    caster: RayCaster
    camera: Camera
    mask: NDArray[np.bool_]
    """(H, W)."""
    distance: NDArray[np.float32]
    """(H, W), see `signed_distance`."""
    cells: int
    """Of the raster on which the outline is searched, across the object."""

    @classmethod
    def of(cls, caster: RayCaster, camera: Camera, mask: NDArray[np.bool_], *, cells: int) -> "BySilhouette":
        """Prepare for a raster of `cells` across the object."""
        return cls(caster, camera, mask, signed_distance(mask), cells)

    @property
    def step_px(self) -> float:
        """Of the raster."""
        return longer_side(self.mask) / self.cells

    def terms(self, pose: Pose) -> list[Term]:
        """Return the outline's term at a pose."""
        view = View(self.caster, self.camera, pose)
        found = find_outline(view, cells=self.cells)
        reach = 2 * self.step_px
        # The slope of the mask's distance, not of the outline's: it is what the residual follows.
        ahead = [sample(self.distance, found.pixels + d * found.outward) for d in (-1.0, 0.0, 1.0)]
        slope = (ahead[2] - ahead[0]) / 2
        jacobian = outline_jacobian(view.camera, found.points, found.outward, view.pivot) * slope[:, None]
        blocks = np.zeros(len(slope), np.int64)
        return [Term(ahead[1] / reach, jacobian / reach, blocks, constant=1 - found.overlap(self.mask))]

    def descend(self, steps: int, pose: Pose) -> tuple[Pose, float]:
        """Return the pose of lowest cost from `pose` on, and the cost."""
        mesh = self.caster.mesh
        scales = small_steps(mesh, self.camera, pose, step_px=self.step_px)
        return descend(self.terms, pose, mesh.center_mm, scales, steps=steps)

    def distinct(self, found: list[tuple[Pose, float]], *, apart_steps: float) -> list[tuple[Pose, float]]:
        """Return the poses, lowest cost first, without those that lie so near to a better one."""
        rated = sorted(found, key=lambda item: item[1])
        far = apart_steps * self.step_px
        kept = distinct(self.caster.mesh, self.camera, [pose for pose, _ in rated], least_px=far)
        return [rated[number] for number in kept]

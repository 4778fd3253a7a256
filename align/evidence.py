"""What the photographs say about a pose: outline, photometric normals, shading."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.embree import RayCaster
from align.motion import nudge
from align.refine import Term, information, robust_sigma
from align.rim import Rim, find_rim, locate_edges, sample, signed_distance
from align.shading import Explained, Samples, explain, find_shadows, light_vectors, surface
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose

Array = NDArray[np.float64]


def small_steps(mesh: Mesh, camera: Camera, pose: Pose, *, step_px: float) -> Array:
    """Return (6,) twists (radians, mm) that each move the scan's image by about `step_px`; 0 where nothing moves."""
    depth = 1.0 if camera.is_orthographic else -float(pose.apply(mesh.center_mm)[2])
    side = step_px * depth / camera.fx
    along = 0.0 if camera.is_orthographic else side * depth / mesh.radius_mm
    return np.array([side / mesh.radius_mm] * 3 + [side, side, along])


def _moved_normals(
    caster: RayCaster, camera: Camera, pose: Pose, pixels: NDArray, steps: Array
) -> list[tuple[float, Array]]:
    pivot = pose.apply(caster.mesh.center_mm)
    moved = []
    for axis, step in enumerate(steps):
        after = nudge(pose, np.eye(6)[axis] * step, pivot) if step else pose
        moved.append((step or 1.0, surface(caster, camera, after, pixels)[1]))
    return moved


@dataclass(frozen=True)
class RoughEvidence:
    """Silhouette against mask, and rendered against photometric normals: a wide basin, a rough answer."""

    camera: Camera
    mask: NDArray[np.bool_]
    distance: NDArray[np.float32]
    pixels: Array
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
        return cls(camera, mask, signed_distance(mask), pixels, target, cells, step)

    def rim(self, caster: RayCaster, pose: Pose) -> Rim:
        return find_rim(caster, self.camera, pose, cells=self.cells)

    def terms(self, caster: RayCaster, steps: Array, pose: Pose) -> list[Term]:
        """Return the terms at a pose; `steps` (6,) are the finite differences' steps."""
        pivot = pose.apply(caster.mesh.center_mm)
        rim = self.rim(caster, pose)
        reach = 2 * self.step_px
        # The slope of the mask's distance, not of the outline's: it is what the residual follows.
        ahead = [sample(self.distance, rim.pixels + d * rim.outward) for d in (-1.0, 0.0, 1.0)]
        slope = (ahead[2] - ahead[0]) / 2
        jacobian = rim.jacobian(self.camera, pivot) * slope[:, None]
        outline = Term(
            ahead[1] / reach,
            jacobian / reach,
            np.zeros(len(slope), np.int64),
            constant=1 - rim.overlap(self.mask),
        )
        _, normals = surface(caster, self.camera, pose, self.pixels)
        seen = np.isfinite(normals[:, 0])
        scale = 0.5
        residual = np.where(seen[:, None], (normals - self.targets) / scale, 3.0)
        slopes = np.zeros((*residual.shape, 6))
        for axis, (step, after) in enumerate(_moved_normals(caster, self.camera, pose, self.pixels, steps)):
            both = seen & np.isfinite(after[:, 0])
            slopes[both, :, axis] = (after[both] - normals[both]) / (step * scale)
        flat = slopes.reshape(-1, 6)
        normal_term = Term(residual.ravel(), flat, np.zeros(len(flat), np.int64), weight=3.0)
        return [outline, normal_term]


@dataclass(frozen=True)
class FinalEvidence:
    """Outline against the photographs' edges, and the shading of all frames, at full resolution."""

    caster: RayCaster
    camera: Camera
    lights: Lights
    mask: NDArray[np.bool_]
    distance: NDArray[np.float32]
    picture: NDArray[np.float32]
    samples: Samples
    cells: int
    pose: Pose
    reach_px: float
    shadows: NDArray[np.bool_]
    block_px: float
    rim: Rim
    rim_sigma: float = 1.0
    rim_share: float = 0.0
    rim_count: int = 0
    residual_px: float = np.inf
    shading_sigma: float = 0.1
    weights: tuple[float, float] = (1.0, 1.0)
    informations: tuple[Array, ...] = ()
    cost: float = np.inf

    @classmethod
    def of(
        cls,
        caster: RayCaster,
        camera: Camera,
        frames: Frames,
        lights: Lights,
        mask: NDArray[np.bool_],
        samples: Samples,
        pose: Pose,
        *,
        cells: int,
        reach_px: float,
    ) -> "FinalEvidence":
        v, u = np.nonzero(mask)
        block = max(4.0, (max(np.ptp(u), np.ptp(v)) + 1) / 16)
        nothing = np.zeros(samples.values.shape, bool)
        evidence = cls(
            caster, camera, lights, mask, signed_distance(mask), mean_picture(frames, lights, mask), samples, cells,
            pose, reach_px, nothing, block, find_rim(caster, camera, pose, cells=cells),
        )  # fmt: skip
        return evidence.renewed(pose, reach_px=reach_px)

    def renewed(self, pose: Pose, *, reach_px: float) -> "FinalEvidence":
        """Return the evidence about `pose`: cast shadows, robust scales, and the terms' weights anew."""
        points, normals = surface(self.caster, self.camera, pose, self.samples.pixels)
        shadows = find_shadows(self.caster, self.lights, pose, points, normals)
        here = replace(self, pose=pose, reach_px=reach_px, shadows=shadows)
        rim, offset, used = here._outline(pose)
        explained = here._shading(pose, with_jacobian=False)
        rim_sigma = max(robust_sigma(offset[used]), 0.05)
        near = np.abs(offset[used]) < 3 * rim_sigma
        here = replace(
            here,
            rim=rim,
            rim_sigma=rim_sigma,
            rim_share=float(used.mean()) if len(used) else 0.0,
            rim_count=int(used.sum()),
            residual_px=float(np.sqrt(np.mean(offset[used][near] ** 2))) if near.any() else np.inf,
            shading_sigma=max(robust_sigma(explained.residuals[explained.used]), 0.005),
            weights=(1.0, 1.0),
        )
        terms = here.terms(pose)
        weights, matrices = [], []
        scales = small_steps(self.caster.mesh, self.camera, pose, step_px=1.0)
        for term in terms:
            hessian, scatter = information(term, 1 / 3)
            hessian, scatter = (m * scales * scales[:, None] for m in (hessian, scatter))
            # How much more a term's residuals err together than alone: its design effect.
            effect = max(1.0, float(np.trace(np.linalg.pinv(hessian, rcond=1e-9) @ scatter)) / 6)
            weights.append(9 * len(term.residuals) / effect)
            matrices.append(hessian / effect)
        total = sum(weights)
        return replace(
            here,
            weights=(weights[0] / total, weights[1] / total),
            informations=tuple(matrices),
            cost=here._fixed_cost(offset, used, explained),
        )

    def covariance(self) -> Array:
        """Return (6, 6) of the twist about the scan's middle; zero along what cannot be seen."""
        scales = small_steps(self.caster.mesh, self.camera, self.pose, step_px=1.0)
        return np.linalg.pinv(sum(self.informations), rcond=1e-12, hermitian=True) * scales * scales[:, None]

    def terms(self, pose: Pose) -> list[Term]:
        """Return outline and shading as terms, in units of three sigma."""
        pivot = pose.apply(self.caster.mesh.center_mm)
        rim, offset, used = self._outline(pose)
        unit = 3 * self.rim_sigma
        jacobian = rim.jacobian(self.camera, pivot)[used]
        outline = Term(offset[used] / unit, jacobian / unit, self._blocks(rim.pixels[used]), self.weights[0])
        explained = self._shading(pose, with_jacobian=True)
        assert explained.jacobian is not None
        unit = 3 * self.shading_sigma
        which = explained.used
        blocks = np.broadcast_to(self._blocks(self.samples.pixels), which.shape)[which]
        shading = Term(
            explained.residuals[which] / unit,
            explained.jacobian[which].astype(np.float64) / unit,
            blocks,
            self.weights[1],
        )
        return [outline, shading]

    def _outline(self, pose: Pose) -> tuple[Rim, Array, NDArray[np.bool_]]:
        """Return the rim, how far it lies outside the picture's edge (K,), px, and where that is known."""
        rim = find_rim(self.caster, self.camera, pose, cells=self.cells)
        offset = -locate_edges(self.picture, rim.pixels, rim.outward, reach_px=self.reach_px)
        # An edge far from the mask's border is one inside the object, or of a cast shadow.
        at_edge = sample(self.distance, rim.pixels - np.nan_to_num(offset)[:, None] * rim.outward)
        return rim, offset, np.isfinite(offset) & (np.abs(at_edge) < 4)

    def _shading(self, pose: Pose, *, with_jacobian: bool) -> Explained:
        pixels = self.samples.pixels
        points, normals = surface(self.caster, self.camera, pose, pixels)
        vectors = light_vectors(self.lights, np.where(np.isfinite(points), points, self.lights.reference_point_mm))
        steps = small_steps(self.caster.mesh, self.camera, pose, step_px=0.7)
        moved = _moved_normals(self.caster, self.camera, pose, pixels, steps) if with_jacobian else None
        return explain(self.samples, normals, vectors, self.shadows, moved)

    def _fixed_cost(self, offset: Array, used: NDArray[np.bool_], explained: Explained) -> float:
        """Return a cost whose scales do not follow the residuals, to compare poses by."""
        miss = 1 - self.rim.overlap(self.mask)
        outline = np.where(used, np.nan_to_num(offset), 10.0) / 2
        relative = np.abs(explained.residuals[explained.used]) / 0.1
        seen = explained.used.any(0).mean()
        shading = float(np.mean(relative**2 / (1 + relative**2))) if relative.size else 1.0
        return miss + float(np.mean(outline**2 / (1 + outline**2))) + seen * shading + (1 - seen)

    def _blocks(self, pixels: NDArray) -> NDArray[np.int64]:
        cell = (pixels / self.block_px).astype(np.int64)
        return cell[:, 1] * 100_000 + cell[:, 0]


def mean_picture(frames: Frames, lights: Lights, mask: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (H, W) float32, the mean frame in units of the lights' intensity, around the mask; 0 elsewhere."""
    v, u = np.nonzero(mask)
    margin = 20
    columns = slice(max(int(u.min()) - margin, 0), int(u.max()) + margin + 1)
    top, bottom = max(int(v.min()) - margin, 0), min(int(v.max()) + margin + 1, frames.height)
    out = np.zeros(mask.shape, np.float32)
    weight = (1 / lights.intensities / (3 * len(frames))).astype(np.float32)
    for band in frames.bands(64 << 20):
        rows = slice(max(band.start, top), min(band.stop, bottom))
        for index in range(len(frames)) if rows.start < rows.stop else ():
            # A mirror's glint in one frame must not make the edge.
            out[rows, columns] += np.minimum(frames.read(rows, [index], columns=columns)[0], 1) @ weight[index]
    return out

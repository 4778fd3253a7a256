"""What the photographs say about a pose: outline, photometric normals, shading."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.embree import RayCaster
from align.motion import nudge
from align.refine import Term, information, robust_sigma
from align.rim import Rim, find_rim, locate_edges, outline_jacobian, sample, signed_distance
from align.shading import Samples, choose, explain, find_shadows, light_vectors, surface
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
) -> list[tuple[float, Array, Array]]:
    """Return, for each twist, its step and the normals that pixels see after and before it.

    Central differences: a scan's noise makes its normals differ from themselves one facet on, and a one-sided
    difference would take that for a slope against the residual (a bias of some tenths of a pixel).
    """
    pivot = pose.apply(caster.mesh.center_mm)
    moved = []
    for axis, step in enumerate(steps):
        sides = [
            surface(caster, camera, nudge(pose, np.eye(6)[axis] * step * sign, pivot), pixels)[1] for sign in (1, -1)
        ]
        moved.append((step or 1.0, sides[0], sides[1]))
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
        jacobian = outline_jacobian(self.camera, rim.points, rim.outward, pivot) * slope[:, None]
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
        for axis, (step, after, before) in enumerate(_moved_normals(caster, self.camera, pose, self.pixels, steps)):
            both = seen & np.isfinite(after[:, 0]) & np.isfinite(before[:, 0])
            slopes[both, :, axis] = (after[both] - before[both]) / (2 * step * scale)
        flat = slopes.reshape(-1, 6)
        normal_term = Term(residual.ravel(), flat, np.zeros(len(flat), np.int64), weight=3.0)
        return [outline, normal_term]


@dataclass(frozen=True)
class FinalEvidence:
    """Outline against the photographs' edges, and the shading of all frames, at full resolution.

    What depends on the pose in jumps (which points make the outline, where the picture's edge lies, which
    samples are lit) is fixed at `pose`; `renewed` takes it again elsewhere.
    """

    caster: RayCaster
    camera: Camera
    lights: Lights
    mask: NDArray[np.bool_]
    distance: NDArray[np.float32]
    picture: NDArray[np.float32]
    samples: Samples
    cells: int
    block_px: float
    pose: Pose
    rim: Rim
    rim_on_scan: Array
    """(K, 3), mm, scan frame: the outline's points that have an edge in the picture."""
    edges: Array
    """(K, 2) pixels: where those edges are."""
    outward: Array
    """(K, 2)."""
    used: NDArray[np.bool_]
    """(N, P): samples lit."""
    rim_sigma: float = 1.0
    shading_sigma: float = 0.1
    rim_share: float = 0.0
    residual_px: float = np.inf
    bias_px: float = 0.0
    """How far outside the picture's edges the scan's outline lies on the whole."""
    weights: tuple[float, float] = (1.0, 1.0)
    informations: tuple[Array, ...] = ()
    cost: float = np.inf

    @classmethod
    def of(
        cls,
        caster: RayCaster,
        camera: Camera,
        lights: Lights,
        mask: NDArray[np.bool_],
        picture: NDArray[np.float32],
        samples: Samples,
        pose: Pose,
        *,
        cells: int,
        reach_px: float,
    ) -> "FinalEvidence":
        """Take the evidence about `pose`; the outline is looked for within `reach_px`."""
        distance = signed_distance(mask)
        rim = find_rim(caster, camera, pose, cells=cells)
        offset = locate_edges(picture, rim.pixels, rim.outward, reach_px=reach_px)
        at = rim.pixels + np.nan_to_num(offset)[:, None] * rim.outward
        # An edge far from the mask's border is one inside the object, or of a cast shadow.
        seen = np.isfinite(offset) & (np.abs(sample(distance, at)) < 4)

        points, normals = surface(caster, camera, pose, samples.pixels)
        shadows = find_shadows(caster, lights, pose, points, normals)
        used = choose(samples, normals, _vectors(lights, points), shadows)
        v, u = np.nonzero(mask)
        here = cls(
            caster, camera, lights, mask, distance, picture, samples, cells,
            max(4.0, (max(np.ptp(u), np.ptp(v)) + 1) / 16), pose,
            rim, pose.inverse().apply(rim.points[seen]), at[seen], rim.outward[seen], used,
        )  # fmt: skip
        return here._weighed(np.where(seen, offset, np.nan))

    def renewed(self, pose: Pose, *, reach_px: float) -> "FinalEvidence":
        """Return the evidence taken again about `pose`."""
        return FinalEvidence.of(
            self.caster, self.camera, self.lights, self.mask, self.picture, self.samples, pose,
            cells=self.cells, reach_px=reach_px,
        )  # fmt: skip

    def _weighed(self, offset: Array) -> "FinalEvidence":
        """Return the evidence with robust scales, the terms' weights and information; `offset` (all rim points), px."""
        found = -offset[np.isfinite(offset)]
        bias = float(np.median(found)) if len(found) else 0.0
        rim_sigma = max(robust_sigma(found - bias), 0.05)
        inliers = found[np.abs(found - bias) < 3 * rim_sigma]
        residuals = self._shading(self.pose, with_jacobian=False)[0]
        here = replace(
            self,
            rim_sigma=rim_sigma,
            bias_px=bias,
            rim_share=len(found) / max(len(offset), 1),
            residual_px=float(np.sqrt(np.mean((inliers - bias) ** 2))) if len(inliers) else np.inf,
            shading_sigma=max(robust_sigma(residuals[self.used]), 0.005),
            cost=self._fixed_cost(offset, residuals),
        )
        weights, matrices = [], []
        scales = small_steps(self.caster.mesh, self.camera, self.pose, step_px=1.0)
        for term in here.terms(self.pose):
            hessian, scatter = information(term, 1 / 3)
            hessian, scatter = (m * scales * scales[:, None] for m in (hessian, scatter))
            # How much more a term's residuals err together than alone: its design effect.
            effect = max(1.0, float(np.trace(np.linalg.pinv(hessian, rcond=1e-9) @ scatter)) / 6)
            weights.append(9 * len(term.residuals) / effect)
            matrices.append(hessian / effect)
        total = max(sum(weights), 1e-12)
        return replace(here, weights=(weights[0] / total, weights[1] / total), informations=tuple(matrices))

    def covariance(self) -> Array:
        """Return (6, 6) of the twist about the scan's middle; zero along what cannot be seen."""
        scales = small_steps(self.caster.mesh, self.camera, self.pose, step_px=1.0)
        return np.linalg.pinv(sum(self.informations), rcond=1e-12, hermitian=True) * scales * scales[:, None]

    def terms(self, pose: Pose) -> list[Term]:
        """Return outline and shading at a pose, in units of three sigma."""
        pivot = pose.apply(self.caster.mesh.center_mm)
        points = pose.apply(self.rim_on_scan)
        pixels = self.camera.project(points)
        unit = 3 * self.rim_sigma
        # Limbs darken, and the steepest place of a blurred limb lies inside the true outline by an amount that
        # is much the same all round: `bias_px` takes it up instead of the depth.
        offset = np.einsum("kp,kp->k", pixels - self.edges, self.outward) - self.bias_px
        jacobian = outline_jacobian(self.camera, points, self.outward, pivot)
        pull = 1 / (1 + (offset / unit) ** 2) ** 2
        if len(offset):
            jacobian = jacobian - pull @ jacobian / pull.sum()
            offset = offset - pull @ offset / pull.sum()
        outline = Term(offset / unit, jacobian / unit, self._blocks(self.edges), self.weights[0])
        residuals, slopes = self._shading(pose, with_jacobian=True)
        assert slopes is not None
        unit = 3 * self.shading_sigma
        blocks = np.broadcast_to(self._blocks(self.samples.pixels), self.used.shape)[self.used]
        shading = Term(
            residuals[self.used] / unit, slopes[self.used].astype(np.float64) / unit, blocks, self.weights[1]
        )
        return [outline, shading]

    def _shading(self, pose: Pose, *, with_jacobian: bool) -> tuple[Array, NDArray[np.float32] | None]:
        pixels = self.samples.pixels
        points, normals = surface(self.caster, self.camera, pose, pixels)
        steps = small_steps(self.caster.mesh, self.camera, pose, step_px=0.7)
        moved = _moved_normals(self.caster, self.camera, pose, pixels, steps) if with_jacobian else None
        return explain(self.samples, self.used, normals, _vectors(self.lights, points), moved)

    def _fixed_cost(self, offset: Array, residuals: Array) -> float:
        """Return a cost whose scales do not follow the residuals, to compare poses by."""
        miss = 1 - self.rim.overlap(self.mask)
        outline = np.nan_to_num(offset, nan=10.0) / 2
        relative = residuals[self.used] / 0.1
        seen = float(self.used.any(0).mean())
        shading = float(np.mean(relative**2 / (1 + relative**2))) if relative.size else 1.0
        edge = float(np.mean(outline**2 / (1 + outline**2))) if outline.size else 1.0
        return miss + edge + seen * shading + (1 - seen)

    def _blocks(self, pixels: NDArray) -> NDArray[np.int64]:
        cell = (pixels / self.block_px).astype(np.int64)
        return cell[:, 1] * 100_000 + cell[:, 0]


def _vectors(lights: Lights, points: Array) -> Array:
    return light_vectors(lights, np.where(np.isfinite(points), points, lights.reference_point_mm))


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

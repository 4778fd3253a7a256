"""What the photographs say about a pose, at full resolution: the outline's edges, and the shading of all frames."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from align.embree import RayCaster
from align.refine import Term, disagreement, information, robust_sigma
from align.rim import Rim, find_rim, locate_edges, outline_jacobian, sample, signed_distance
from align.rough import moved_normals, small_steps
from align.shading import Samples, choose, explain, find_shadows, free_normals, surface
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.pose import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """How well a pose explains the photographs, in terms that a wrong scan cannot meet.

    Parameters
    ----------
    overlap : float
        Intersection over union of the scan's silhouette and the mask.
    normals_deg : float
        Median angle between the scan's normals and those that fit the photographs best, pixel by pixel, under
        the same lights and with the same samples.
    outline_share : float
        Share of the outline within max(1 px, 0.5 % of the object's size) of an edge in the photographs.
    """

    overlap: float
    normals_deg: float
    outline_share: float

    @property
    def misfit(self) -> float:
        """One number: 10 degrees off everywhere, or a quarter of the outline without its edge, is 1."""
        return self.normals_deg / 10 + (1 - self.outline_share) / 0.25

    @property
    def words(self) -> str:
        return (
            f"at the best pose the silhouette overlaps the mask by {100 * self.overlap:.1f} %, "
            f"{100 * self.outline_share:.0f} % of the scan's outline lie on an edge in the photographs (expected above "
            f"90 %), and its normals are {self.normals_deg:.1f} degrees (median) from what the photographs show "
            "(expected below 4)"
        )


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
    residual_px: float = np.inf
    bias_px: float = 0.0
    """How far outside the picture's edges the scan's outline lies on the whole."""
    weights: tuple[float, float] = (1.0, 1.0)
    information: Array = field(default_factory=lambda: np.zeros((6, 6)))
    """(6, 6), inverse covariance in units of `small_steps` of one pixel."""
    disagreement: float = 1.0
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
        seen = np.isfinite(offset) & (np.abs(sample(distance, at)) < max(4.0, 0.7 * reach_px))

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
            residual_px=float(np.sqrt(np.mean((inliers - bias) ** 2))) if len(inliers) else np.inf,
            shading_sigma=max(robust_sigma(residuals[self.used]), 0.005),
            cost=self._fixed_cost(offset, residuals),
        )
        weights, matrices, slopes = [], [], []
        scales = small_steps(self.caster.mesh, self.camera, self.pose, step_px=1.0)
        for term in here.terms(self.pose):
            hessian, scatter, slope = information(term, 1 / 3)
            hessian, scatter = (m * scales * scales[:, None] for m in (hessian, scatter))
            # How much more a term's residuals err together than alone: its design effect.
            effect = max(1.0, float(np.trace(np.linalg.pinv(hessian, rcond=1e-9) @ scatter)) / 6)
            weights.append(9 * len(term.residuals) / effect)
            matrices.append(hessian / effect)
            slopes.append(slope * scales / effect)
        total = max(sum(weights), 1e-12)
        return replace(
            here,
            weights=(weights[0] / total, weights[1] / total),
            information=sum(matrices) / disagreement(matrices, slopes),
            disagreement=disagreement(matrices, slopes),
        )

    def covariance(self) -> Array:
        """Return (6, 6) of the twist about the scan's middle; zero along what cannot be seen."""
        scales = small_steps(self.caster.mesh, self.camera, self.pose, step_px=1.0)
        return np.linalg.pinv(self.information, rcond=1e-12, hermitian=True) * scales * scales[:, None]

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

    def fit(self) -> Fit:
        """Return how well the evidence's pose fits."""
        pixels = self.samples.pixels
        points, normals = surface(self.caster, self.camera, self.pose, pixels)
        error = angular_error_deg(free_normals(self.samples, self.used, _vectors(self.lights, points)), normals)
        size = float(np.ptp(np.argwhere(self.mask), axis=0).max()) + 1
        near = max(1.0, 0.005 * size)
        offset = locate_edges(self.picture, self.rim.pixels, self.rim.outward, reach_px=max(6.0, 0.05 * size))
        on_edge = np.abs(offset + self.bias_px) < near
        return Fit(
            self.rim.overlap(self.mask),
            float(np.nanmedian(error)) if np.isfinite(error).any() else 90.0,
            float(np.mean(on_edge)) if len(on_edge) else 0.0,
        )

    def _shading(self, pose: Pose, *, with_jacobian: bool) -> tuple[Array, NDArray[np.float32] | None]:
        pixels = self.samples.pixels
        points, normals = surface(self.caster, self.camera, pose, pixels)
        steps = small_steps(self.caster.mesh, self.camera, pose, step_px=0.7)
        moved = moved_normals(self.caster, self.camera, pose, pixels, steps) if with_jacobian else None
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
    return lights.toward(np.where(np.isfinite(points), points, lights.reference_point_mm))

"""What the photographs say about a pose, at full resolution: the outline's edges, and the shading of all frames."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from align.pose.outline_edges import LimbPictures
from align.pose.probes import Probes
from align.pose.refine import Term, disagreement, information, robust_sigma
from align.pose.rim import Rim, find_rim, outline_jacobian, sample, signed_distance
from align.pose.rough import small_steps
from align.pose.shading import FEWEST, Samples, choose, cosines, explain, find_shadows, free_normals
from align.pose.sharp_picture import longer_side
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

EDGE_BIAS_PX, EDGE_DOUBT_PX = 0.05, 0.1
"""How far outside the limb's edges, as the scan lets expect them, the outline lies; and how unsure that is."""
UNMODELLED = 8.0
"""The pose's variance is so many times what the residuals' scatter tells: what all patches share (the lights' errors,
the smoothed normals' own) is not in it. Measured on virtual sessions of known pose."""
MASK_PX = 1.0
"""What a mask's border may be off by."""


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
        Share of the outline within max(1 px, 0.5 % of the object's size) of an edge in the photographs or, where
        object and backdrop are alike and there is none, of the mask's border.
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
    limbs: LimbPictures
    samples: Samples
    probes: Probes
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
    weights: tuple[float, ...] = (1.0, 1.0, 1.0)
    information: Array = field(default_factory=lambda: np.zeros((6, 6)))
    """(6, 6), inverse covariance in units of `small_steps` of one pixel."""
    disagreement: float = 1.0

    @classmethod
    def of(
        cls,
        caster: RayCaster,
        camera: Camera,
        lights: Lights,
        mask: NDArray[np.bool_],
        limbs: LimbPictures,
        samples: Samples,
        pose: Pose,
        *,
        cells: int,
        reach_px: float,
    ) -> "FinalEvidence":
        """Take the evidence about `pose`; the outline is looked for within `reach_px`."""
        block_px = max(4.0, longer_side(mask) / 16)
        probes = Probes.of(camera, samples.pixels, step_px=1.0)
        fixed = (caster, camera, lights, mask, signed_distance(mask), limbs, samples, probes, cells, block_px)
        return cls._about(fixed, pose, reach_px)

    def renewed(self, pose: Pose, *, reach_px: float) -> "FinalEvidence":
        """Return the evidence taken again about `pose`."""
        fixed = (
            self.caster, self.camera, self.lights, self.mask, self.distance, self.limbs, self.samples, self.probes,
            self.cells, self.block_px,
        )  # fmt: skip
        return self._about(fixed, pose, reach_px)

    @classmethod
    def _about(cls, fixed: tuple, pose: Pose, reach_px: float) -> "FinalEvidence":
        """Return the evidence about a pose; `fixed` are the fields that do not depend on it."""
        caster, camera, lights, mask, distance, limbs, samples, probes, cells, block_px = fixed
        rim = find_rim(caster, camera, pose, cells=cells)
        offset = limbs.locate(rim.pixels, rim.outward, reach_px=reach_px)
        offset -= limbs.expect(caster, camera, lights, pose, rim, offset)
        at = rim.pixels + np.nan_to_num(offset)[:, None] * rim.outward
        # An edge far from the mask's border is one inside the object, or of a cast shadow.
        seen = np.isfinite(offset) & (np.abs(sample(distance, at)) < max(4.0, 0.7 * reach_px))
        points, normals = probes.surface(caster, pose)
        shadows = find_shadows(caster, lights, pose, points, normals)
        used = choose(samples, normals, _vectors(lights, points), shadows)
        on_scan = pose.inverse().apply(rim.points[seen])
        here = cls(
            caster, camera, lights, mask, distance, limbs, samples, probes, cells, block_px, pose,
            rim, on_scan, at[seen], rim.outward[seen], used,
        )  # fmt: skip
        return here._weighed(np.where(seen, offset, np.nan))

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
        contradiction = disagreement(matrices[:2], slopes[:2])
        return replace(
            here,
            weights=tuple(weight / total for weight in weights),
            information=sum(matrices) / contradiction,
            disagreement=contradiction,
        )

    def covariance(self) -> Array:
        """Return (6, 6) of the twist about the scan's middle; zero along what cannot be seen."""
        scales = small_steps(self.caster.mesh, self.camera, self.pose, step_px=1.0)
        inverse = np.linalg.pinv(self.information, rcond=1e-12, hermitian=True)
        return UNMODELLED * inverse * scales * scales[:, None]

    def terms(self, pose: Pose) -> list[Term]:
        """Return outline, shading, and the outline's common offset, at a pose, in units of three sigma."""
        pivot = pose.apply(self.caster.mesh.center_mm)
        points = pose.apply(self.rim_on_scan)
        pixels = self.camera.project(points)
        unit = 3 * self.rim_sigma
        # Limbs darken, and the steepest place of a blurred limb lies inside the true outline by an amount that
        # is much the same all round: an unknown of its own, known beforehand to some tenths of a pixel. Taken for
        # the outline, it would pass for depth; were it wholly unknown, depth would not be seen.
        offset = np.einsum("kp,kp->k", pixels - self.edges, self.outward)
        jacobian = outline_jacobian(self.camera, points, self.outward, pivot)
        pull = 1 / (1 + ((offset - self.bias_px) / unit) ** 2) ** 2
        common, along = np.zeros(0), np.zeros((0, 6))
        if len(offset):
            common, along = np.atleast_1d(pull @ offset / pull.sum()), (pull @ jacobian / pull.sum())[None]
            jacobian, offset = jacobian - along, offset - common
        outline = Term(offset / unit, jacobian / unit, self._blocks(self.edges), self.weights[0])
        doubt = 3 * EDGE_DOUBT_PX
        bias = Term((common - EDGE_BIAS_PX) / doubt, along / doubt, np.zeros(len(common), np.int64), self.weights[2])
        return [outline, self._shading_term(pose), bias]

    def shading_under(self, vectors: Array) -> Term:
        """Return the shading's term at the evidence's pose under light vectors (N, P, 3) other than the lights'."""
        return self._shading_term(self.pose, vectors)

    def _shading_term(self, pose: Pose, vectors: Array | None = None) -> Term:
        residuals, slopes = self._shading(pose, with_jacobian=True, vectors=vectors)
        assert slopes is not None
        unit = 3 * self.shading_sigma
        blocks = np.broadcast_to(self._blocks(self.samples.pixels), self.used.shape)[self.used]
        return Term(residuals[self.used] / unit, slopes[self.used] / unit, blocks, self.weights[1])

    @cached_property
    def fit(self) -> Fit:
        """How well the evidence's pose fits; every comparison asks for it."""
        points, normals = self.probes.surface(self.caster, self.pose)
        error = angular_error_deg(free_normals(self.samples, self.used, _vectors(self.lights, points)), normals)
        size = float(longer_side(self.mask))
        near = max(1.0, 0.005 * size)
        offset = self.limbs.locate(self.rim.pixels, self.rim.outward, reach_px=max(6.0, 0.05 * size))
        on_edge = np.abs(offset + self.bias_px) < near
        on_edge |= np.abs(sample(self.distance, self.rim.pixels)) < near + MASK_PX
        return Fit(
            self.rim.overlap(self.mask),
            float(np.nanmedian(error)) if np.isfinite(error).any() else 90.0,
            float(np.mean(on_edge)) if len(on_edge) else 0.0,
        )

    def _shading(self, pose: Pose, *, with_jacobian: bool, vectors: Array | None = None) -> tuple[Array, Array | None]:
        points, normals = self.probes.surface(self.caster, pose)
        slopes = None
        if with_jacobian:
            slopes = self.probes.slopes(self.caster, pose, points, normals, pose.apply(self.caster.mesh.center_mm))
        vectors = _vectors(self.lights, points) if vectors is None else vectors
        return explain(self.samples, self.used, normals, vectors, slopes)

    def pixel_costs(self, sigma: float) -> Array:
        """Return (P,) how badly the pose explains each pixel's samples, 0 to 1; NaN where it says nothing.

        A sample is predicted dark, too, where the scan turns from the light. Cast shadows say nothing: light falls
        through the holes of a scan.
        """
        points, normals = self.probes.surface(self.caster, self.pose)
        vectors = _vectors(self.lights, points)
        away = cosines(vectors, normals) < 0
        residuals, _ = explain(self.samples, self.used, normals, vectors)
        dark = away & ~self.samples.clipped & np.isfinite(normals[:, 0])
        relative = np.where(dark, self.samples.values / self.samples.scale, residuals) / (3 * sigma)
        counted = self.used | dark
        cost = (counted * relative**2 / (1 + relative**2)).sum(0) / np.maximum(counted.sum(0), 1)
        missed = ~np.isfinite(points[:, 0])
        cost[self.used.sum(0) < FEWEST] = np.nan
        cost[missed] = 1.0
        return cost

    def _blocks(self, pixels: NDArray) -> NDArray[np.int64]:
        cell = (pixels / self.block_px).astype(np.int64)
        return cell[:, 1] * 100_000 + cell[:, 0]


def _vectors(lights: Lights, points: Array) -> Array:
    return lights.toward(np.where(np.isfinite(points), points, lights.reference_point_mm))

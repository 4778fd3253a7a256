"""What the photographs say about a pose, at full resolution: the outline's edges, and the shading of all frames."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from align.pose.appearance import Appearance, Lit
from align.pose.motion import apart_px, small_steps
from align.pose.outline_edges import EdgePictures
from align.pose.photographed import Photographs, longer_side
from align.pose.refine import Term, descend, disagreement, robust_sigma, settle
from align.pose.scan_outline import Outline, find_outline, outline_jacobian, sample, signed_distance
from align.pose.scan_view import Probes, View
from align.pose.shading import FEWEST, Samples, choose, cosines, explain, find_shadows, take_samples
from scene.camera import Camera
from scene.lights import Lights
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

EDGE_BIAS_PX, EDGE_DOUBT_PX = 0.05, 0.1
"""How far outside the edges, as the scan lets expect them, the outline lies; and how unsure that is."""
UNMODELLED = 8.0
"""The pose's variance is so many times what the residuals' scatter tells: what all patches share (the lights' errors,
the smoothed normals' own) is not in it. Measured on virtual sessions of known pose."""
LOOKED = 2000
"""Pixels, about, that tell the appearance: its numbers are few."""
MASK_PX = 1.0
"""What a mask's border may be off by."""
SETTLED_PX = 0.01
"""A round of the refinement that moves the scan's image by less is the last."""
NEAREST_PX = 2.5
"""The outline's edges are looked for ever closer by, down to this."""


@dataclass(frozen=True)
class Observed:
    """A scan and its photographs: what of them does not depend on the pose."""

    caster: RayCaster
    camera: Camera
    lights: Lights
    mask: NDArray[np.bool_]
    """(H, W): the object's, as it was found."""
    distance: NDArray[np.float32]
    """(H, W), to its border; see `signed_distance`."""
    near: NDArray[np.float32]
    """(H, W), to where the outline is: the same, or to the border of the scan's silhouette at a pose that is known."""
    pictures: EdgePictures | None
    """None: the mask's border is the edge."""
    samples: Samples
    probes: Probes
    """At the samples' pixels."""
    cells: int
    """Of the raster on which the outline is searched, across the scan."""
    lights_known: bool = True
    """Else the object is taken for matte, and what its surroundings send back for the lights' own."""

    @classmethod
    def of(
        cls,
        caster: RayCaster,
        photographs: Photographs,
        pictures: EdgePictures | None,
        *,
        count: int,
        cells: int,
        silhouette: NDArray[np.bool_] | None = None,
        lights_known: bool = True,
    ) -> "Observed":
        """Read about `count` pixels of the object, or of the scan's `silhouette` (H, W), from all frames."""
        camera, mask = photographs.camera, photographs.mask
        distance = photographs.distance
        near = distance if silhouette is None else signed_distance(silhouette)
        samples = take_samples(photographs.frames, photographs.lights, near < 0, count=count)
        probes = Probes.of(camera, samples.pixels, step_px=1.0)
        known = caster, camera, photographs.lights, mask, distance, near, pictures
        return cls(*known, samples, probes, cells, lights_known)

    def toward(self, points: Array) -> Array:
        """Return the light vectors (N, P, 3) at points (P, 3), of intensity 1; anything where the scan is missed."""
        return self.lights.toward(np.where(np.isfinite(points), points, self.lights.reference_point_mm))

    def lit(self, points: Array, scale: float = 1.0) -> Lit:
        """Return the lights at points (P, 3) of a scan `scale` times as large and as far."""
        return Lit.of(self.toward(scale * points), -self.probes.directions[0])

    @property
    def near_px(self) -> float:
        """How far beside an edge an outline is still on it: 1 px, or 0.5 % of the object's size."""
        return max(1.0, 0.005 * longer_side(self.mask))

    def patches(self, pixels: NDArray) -> NDArray[np.int64]:
        """Return the number (K,) of the patch that holds each pixel (K, 2), 16 patches across the object."""
        return patches(pixels, max(4.0, longer_side(self.mask) / 16))


def patches(pixels: NDArray, size_px: float) -> NDArray[np.int64]:
    """Return the number (K,) of the square patch of the image that holds each pixel (K, 2)."""
    cell = (pixels / size_px).astype(np.int64)
    return cell[:, 1] * 100_000 + cell[:, 0]


@dataclass(frozen=True)
class FinalEvidence:
    """Outline against the photographs' edges, and the shading of all frames, at full resolution.

    What depends on the pose in jumps (which points make the outline, where the picture's edge lies, which
    samples are lit) is fixed at `pose`; `renewed` takes it again elsewhere.
    """

    seen: Observed
    pose: Pose
    surface: tuple[Array, Array]
    """Points and normals (P, 3) that the samples' pixels see; see `View.surface`."""
    lit: Lit
    """The lights at these points."""
    used: NDArray[np.bool_]
    """(N, P): samples lit."""
    look: Appearance
    outline: Outline
    on_scan: Array
    """(K, 3), mm, scan frame: the outline's points that have an edge in the picture."""
    edges: Array
    """(K, 2) pixels: where those edges are."""
    outward: Array
    """(K, 2)."""
    outline_sigma: float = 1.0
    shading_sigma: float = 0.1
    residual_px: float = np.inf
    apart_px: float = np.inf
    """Median distance from the scan's outline to the picture's edges."""
    bias_px: float = 0.0
    """How far outside the picture's edges the scan's outline lies on the whole."""
    weights: tuple[float, ...] = (1.0, 1.0, 1.0)
    information: Array = field(default_factory=lambda: np.zeros((6, 6)))
    """(6, 6), inverse covariance in units of `small_steps` of one pixel."""
    disagreement: float = 1.0

    @classmethod
    def about(cls, seen: Observed, pose: Pose, *, reach_px: float) -> "FinalEvidence":
        """Take the evidence about `pose`; the outline's edges are looked for within `reach_px`."""
        view = View(seen.caster, seen.camera, pose)
        points, normals = seen.probes.surface(seen.caster, pose)
        lit = seen.lit(points)
        used = choose(seen.samples, normals, lit.vectors, find_shadows(view, seen.lights, points, normals))
        look = Appearance.matte()
        if seen.lights_known:
            some = np.arange(0, len(points), max(1, len(points) // LOOKED))
            values = np.where(used, seen.samples.values, 0) / seen.samples.scale
            look = Appearance.of(values[:, some], used[:, some], normals[some], lit.only(some))
        outline = find_outline(view, cells=seen.cells)
        if seen.pictures is None:
            offset = -sample(seen.distance, outline.pixels)
        else:
            offset = seen.pictures.locate(outline.pixels, outline.outward, reach_px=reach_px)
            offset -= seen.pictures.expect(view, seen.lights, look, outline, offset)
        at = outline.pixels + np.nan_to_num(offset)[:, None] * outline.outward
        # An edge far from the mask's border is one inside the object, or of a cast shadow.
        found = np.isfinite(offset) & (np.abs(sample(seen.near, at)) < max(4.0, 0.7 * reach_px))
        on_scan = pose.inverse().apply(outline.points[found])
        here = cls(seen, pose, (points, normals), lit, used, look, outline, on_scan, at[found], outline.outward[found])
        return here._weighed(-offset[found])

    def renewed(self, pose: Pose, *, reach_px: float) -> "FinalEvidence":
        """Return the evidence taken again about `pose`."""
        return self.about(self.seen, pose, reach_px=reach_px)

    def under(self, lights: Lights) -> "FinalEvidence":
        """Return the evidence with other lights; what hangs on them is taken again by `renewed`."""
        return replace(self, seen=replace(self.seen, lights=lights, samples=self.seen.samples.under(lights)))

    def refined(self, *, rounds: int, reach_px: float) -> "FinalEvidence":
        """Return the evidence at the pose that explains it best, at most `reach_px` off.

        Shadows, edges, scales and weights are renewed each round, until the pose stays.
        """
        mesh, camera, here = self.seen.caster.mesh, self.seen.camera, self
        for index in range(rounds):
            before = here.pose
            pose = here.settled() if index else descend(here.terms, before, mesh.center_mm, here.steps(0.5), steps=6)[0]
            here = here.renewed(pose, reach_px=max(NEAREST_PX, reach_px / 2 ** (index + 1)))
            if index and apart_px(mesh, camera, before, pose) < SETTLED_PX:
                break
        return here

    def settled(self) -> Pose:
        """Return the pose at which the cost's slope vanishes, near this one."""
        return settle(self.terms, self.pose, self.seen.caster.mesh.center_mm, self.steps(0.5), steps=4)

    def steps(self, step_px: float) -> Array:
        """Return (6,) twists that move the scan's image by `step_px`; see `small_steps`."""
        return small_steps(self.seen.caster.mesh, self.seen.camera, self.pose, step_px=step_px)

    def covariance(self) -> Array:
        """Return (6, 6) of the twist about the scan's middle; zero along what cannot be seen."""
        scales = self.steps(1.0)
        inverse = np.linalg.pinv(self.information, rcond=1e-12, hermitian=True)
        return UNMODELLED * inverse * scales * scales[:, None]

    def terms(self, pose: Pose) -> list[Term]:
        """Return outline, shading, and the outline's common offset, at a pose, in units of three sigma."""
        camera, mesh = self.seen.camera, self.seen.caster.mesh
        points = pose.apply(self.on_scan)
        unit = 3 * self.outline_sigma
        # An object darkens toward its outline, and the steepest place of the blurred edge lies inside the true outline
        # by an amount that is much the same all round: an unknown of its own, known beforehand to some tenths of a
        # pixel. Taken for the outline, it would pass for depth; were it wholly unknown, depth would not be seen.
        offset = np.einsum("kp,kp->k", camera.project(points) - self.edges, self.outward)
        jacobian = outline_jacobian(camera, points, self.outward, pose.apply(mesh.center_mm))
        pull = 1 / (1 + ((offset - self.bias_px) / unit) ** 2) ** 2
        common, along = np.zeros(0), np.zeros((0, 6))
        if len(offset):
            common, along = np.atleast_1d(pull @ offset / pull.sum()), (pull @ jacobian / pull.sum())[None]
            jacobian, offset = jacobian - along, offset - common
        outline = Term(offset / unit, jacobian / unit, self.seen.patches(self.edges), self.weights[0])
        doubt = 3 * (MASK_PX if self.seen.pictures is None else EDGE_DOUBT_PX)
        bias = Term((common - EDGE_BIAS_PX) / doubt, along / doubt, np.zeros(len(common), np.int64), self.weights[2])
        return [outline, self.shading(pose), bias]

    def shading(self, pose: Pose, scale: float = 1.0) -> Term:
        """Return the shading's term at a pose, of a scan `scale` times as large and as far."""
        seen = self.seen
        is_here = pose is self.pose
        points, normals = self.surface if is_here else seen.probes.surface(seen.caster, pose)
        slopes = seen.probes.slopes(seen.caster, pose, points, normals)
        lit = self.lit if is_here and scale == 1 else seen.lit(points, scale)
        residuals, _, jacobian = explain(seen.samples, self.used, normals, lit, self.look, slopes)
        assert jacobian is not None
        unit = 3 * self.shading_sigma
        blocks = np.broadcast_to(seen.patches(seen.samples.pixels), self.used.shape)[self.used]
        return Term(residuals[self.used] / unit, jacobian[self.used] / unit, blocks, self.weights[1])

    @cached_property
    def outline_share(self) -> float:
        """Share of the outline within `Observed.near_px` of an edge in the photographs.

        Or, where object and backdrop are alike and there is none, of the mask's border.
        """
        seen, outline = self.seen, self.outline
        near = seen.near_px
        on_edge = np.abs(sample(seen.distance, outline.pixels)) < near + MASK_PX
        if seen.pictures is not None:
            offset = seen.pictures.locate(
                outline.pixels, outline.outward, reach_px=max(6.0, 0.05 * longer_side(seen.mask))
            )
            on_edge |= np.abs(offset + self.bias_px) < near
        return float(np.mean(on_edge)) if len(on_edge) else 0.0

    def pixel_costs(self, sigma: float) -> Array:
        """Return (P,) how badly the pose explains each pixel's samples, 0 to 1; NaN where it says nothing.

        A sample is predicted dark, too, where the scan turns from the light. Cast shadows say nothing: light falls
        through the holes of a scan.
        """
        (points, normals), samples = self.surface, self.seen.samples
        residuals, albedo, _ = explain(samples, self.used, normals, self.lit, self.look)
        dark = (cosines(self.lit.vectors, normals) < 0) & ~samples.clipped & np.isfinite(normals[:, 0])
        beside = samples.values / samples.scale - np.maximum(albedo * self.look.sent_back(normals), 0)
        relative = np.where(dark, beside, residuals) / (3 * sigma)
        counted = self.used | dark
        cost = (counted * relative**2 / (1 + relative**2)).sum(0) / np.maximum(counted.sum(0), 1)
        cost[self.used.sum(0) < FEWEST] = np.nan
        cost[~np.isfinite(points[:, 0])] = 1.0
        return cost

    def _weighed(self, found: Array) -> "FinalEvidence":
        """Return the evidence with robust scales, weights and information; `found` (K,), px: outline minus edge."""
        bias = float(np.median(found)) if len(found) else 0.0
        sigma = max(robust_sigma(found - bias), 0.05)
        inliers = found[np.abs(found - bias) < 3 * sigma]
        residuals = explain(self.seen.samples, self.used, self.surface[1], self.lit, self.look).residuals
        here = replace(
            self,
            outline_sigma=sigma,
            bias_px=bias,
            apart_px=float(np.median(np.abs(found))) if len(found) else np.inf,
            residual_px=float(np.sqrt(np.mean((inliers - bias) ** 2))) if len(inliers) else np.inf,
            shading_sigma=max(robust_sigma(residuals[self.used]), 0.005),
        )
        terms = here.terms(self.pose)
        matrices, slopes, effects = zip(*(term.information(self.steps(1.0)) for term in terms), strict=True)
        weights = [9 * len(term.residuals) / effect for term, effect in zip(terms, effects, strict=True)]
        # Where outline and shading contradict each other the shading's model is at fault: lights, bounced light, metal.
        contradiction = disagreement(matrices[:2], slopes[:2])
        weights[1] /= contradiction
        total = max(sum(weights), 1e-12)
        return replace(
            here,
            weights=tuple(weight / total for weight in weights),
            information=matrices[0] + matrices[1] / contradiction + matrices[2],
            disagreement=contradiction,
        )

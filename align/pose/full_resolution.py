"""What the photographs say about a pose, at full resolution: the outline's edges, and the shading of all frames."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.pose.appearance import Appearance, Lit
from align.pose.motion import Term, apart_px, image_flow, settle, small_steps
from align.pose.outline_edges import EdgePictures, OutlineEdges
from align.pose.photographed import Photographs, longer_side, shading_tells
from align.pose.scan_view import Outline, View, probe_rays, sample, signed_distance
from align.pose.shading import ShadedSamples, choose, explain, find_shadows, take_samples
from scene.camera import Camera
from scene.lights import Lights
from scene.pose import Pose
from scene.rays import RayCaster
from scene.robust import spread

Array = NDArray[np.float64]

EDGE_BIAS_PX, EDGE_DOUBT_PX = 0.05, 0.1
"""How far outside the edges, as the scan lets expect them, the outline lies; and how unsure that is."""
UNMODELLED = 8.0
"""The pose's variance is so many times what the residuals' scatter tells: what all patches share (the lights' errors,
the smoothed normals' own) is not in it. Measured on virtual sessions of known pose."""
CHECKED = 0.05
"""Share of the brightness that the shading's residuals are where it counts as much as the outline does; it counts at
most in proportion. What is wrong with a material's law, or with the lights, is wrong in all samples alike: the outline
alone can tell, not their scatter. Without this bound bronzes lay ten times as far off as was stated."""
LOOKED = 2000
"""Pixels, about, that tell the appearance: its numbers are few."""
MASK_PX = 1.0
"""What a mask's border may be off by."""
SETTLED_PX = 0.01
"""A round of the refinement that moves the scan's image by less is the last."""
NEAREST_PX = 2.5
"""The outline's edges are looked for ever closer by, down to this."""


@dataclass(frozen=True)
class ObservedObject:
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
    samples: ShadedSamples
    rays: tuple[Array, Array]
    """The samples' pixels' and their neighbours', see `probe_rays`: undistorted once, cast as the scan moves."""
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
    ) -> "ObservedObject":
        """Read about `count` pixels of the object, or of the scan's `silhouette` (H, W), from all frames."""
        camera, mask, distance = photographs.camera, photographs.mask, photographs.distance
        near = distance if silhouette is None else signed_distance(silhouette)
        samples = take_samples(photographs.frames, photographs.lights, near < 0, count=count)
        known = caster, camera, photographs.lights, mask, distance, near, pictures, samples
        return cls(*known, probe_rays(camera, samples.pixels), cells, lights_known)

    def toward(self, points: Array) -> Array:
        """Return the light vectors (N, P, 3) at points (P, 3), of intensity 1; anything where the scan is missed."""
        return self.lights.toward(np.where(np.isfinite(points), points, self.lights.reference_point_mm))

    def lit(self, points: Array) -> Lit:
        """Return the lights at points (P, 3)."""
        return Lit.of(self.toward(points), -self.rays[1][0])

    @property
    def near_px(self) -> float:
        """How far beside an edge an outline is still on it: 1 px, or 0.5 % of the object's size; and a mask's error."""
        return max(1.0, 0.005 * longer_side(self.mask)) + MASK_PX * (self.pictures is None)

    def patches(self, pixels: NDArray) -> NDArray[np.int64]:
        """Return the number (K,) of the patch that holds each pixel (K, 2), 16 patches across the object."""
        return patches(pixels, max(4.0, longer_side(self.mask) / 16))


def patches(pixels: NDArray, size_px: float) -> NDArray[np.int64]:
    """Return the number (K,) of the square patch of the image that holds each pixel (K, 2)."""
    cell = (pixels / size_px).astype(np.int64)
    return cell[:, 1] * 100_000 + cell[:, 0]


class Weighed(NamedTuple):
    """What outline, shading and the outline's common offset know of a pose, and how they count together."""

    weights: tuple[float, ...]
    information: Array
    """(6, 6), inverse covariance in units of `small_steps` of one pixel."""


@dataclass(frozen=True)
class FinalEvidence:
    """Outline against the photographs' edges, and the shading of all frames, at full resolution.

    What depends on the pose in jumps (which points make the outline, where the picture's edge lies, which
    samples are lit) is fixed at `pose`; `renewed` takes it again elsewhere. Each part is found when it is asked for.
    """

    seen: ObservedObject
    pose: Pose
    reach_px: float
    """How far from the outline its edges are looked for."""

    @property
    def view(self) -> View:
        """The scan at the pose."""
        return View(self.seen.caster, self.seen.camera, self.pose)

    @cached_property
    def surface(self) -> tuple[Array, Array]:
        """Points and normals (P, 3) that the samples' pixels see; see `View.surface`."""
        return self.view.surface(*(part[0] for part in self.seen.rays))

    @cached_property
    def lit(self) -> Lit:
        """The lights at these points."""
        return self.seen.lit(self.surface[0])

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """(N, P): samples lit; none where shading tells nothing."""
        if not shading_tells(self.seen.lights):
            return np.zeros(self.seen.samples.values.shape, bool)
        points, normals = self.surface
        shadows = find_shadows(self.view, self.seen.lights, points, normals)
        return choose(self.seen.samples, normals, self.lit.vectors, shadows)

    @cached_property
    def look(self) -> Appearance:
        """How the object looks if it stands here."""
        seen, used = self.seen, self.used
        if not seen.lights_known or not used.any():
            return Appearance.matte()
        some = np.arange(0, used.shape[1], max(1, used.shape[1] // LOOKED))
        values = np.where(used, seen.samples.values, 0) / seen.samples.scale
        return Appearance.of(values[:, some], used[:, some], self.surface[1][some], self.lit.only(some))

    @cached_property
    def outline(self) -> Outline:
        """The scan's."""
        return self.view.outline(cells=self.seen.cells)

    @cached_property
    def edges(self) -> OutlineEdges:
        """Where the photographs show the outline."""
        seen, outline = self.seen, self.outline
        if seen.pictures is None:
            offset = -sample(seen.distance, outline.pixels)
        else:
            offset = seen.pictures.locate(outline.pixels, outline.outward, reach_px=self.reach_px)
            offset -= seen.pictures.expect(self.view, seen.lights, self.look, outline, offset)
        at = outline.pixels + np.nan_to_num(offset)[:, None] * outline.outward
        # An edge far from the mask's border is one inside the object, or of a cast shadow.
        found = np.isfinite(offset) & (np.abs(sample(seen.near, at)) < max(4.0, 0.7 * self.reach_px))
        on_scan = self.pose.inverse().apply(outline.points[found])
        return OutlineEdges.of(on_scan, at[found], outline.outward[found], offset[found])

    @cached_property
    def shading_sigma(self) -> float:
        """Robust standard deviation of the shading's residuals, relative to the pixel's brightness."""
        residuals = explain(self.seen.samples, self.used, self.surface[1], self.lit, self.look).residuals
        return max(spread(residuals[self.used]), 0.005) if self.used.any() else np.inf

    @cached_property
    def weighed(self) -> Weighed:
        """How the terms count together, and what they know."""
        terms = self._terms(self.pose)
        known = [term.information(self.steps(1.0)) for term in terms]
        matrices = [matrix for matrix, _, _ in known]
        weights = [len(term.residuals) / effect for term, (_, _, effect) in zip(terms, known, strict=True)]
        if weights[1]:
            doubt = max(1.0, self.shading_sigma / CHECKED * weights[1] / max(weights[0], 1.0))
            weights[1], matrices[1] = weights[1] / doubt, matrices[1] / doubt
        total = max(sum(weights), 1e-12)
        return Weighed(tuple(weight / total for weight in weights), np.sum(matrices, 0))

    def renewed(self, pose: Pose, *, reach_px: float) -> "FinalEvidence":
        """Return the evidence taken again about `pose`."""
        return FinalEvidence(self.seen, pose, reach_px)

    def under(self, lights: Lights) -> "FinalEvidence":
        """Return the evidence with other lights."""
        return replace(self, seen=replace(self.seen, lights=lights, samples=self.seen.samples.under(lights)))

    def refined(self, *, rounds: int) -> "FinalEvidence":
        """Return the evidence at the pose that explains it best, at most `self.reach_px` off.

        Shadows, edges, scales and weights are renewed each round, until the pose stays.
        """
        mesh, camera, here = self.seen.caster.mesh, self.seen.camera, self
        for index in range(rounds):
            before = here.pose
            how = here.terms, before, mesh.center_mm, here.steps(0.5)
            pose = settle(*how, steps=4 if index else 6, longest=3 if index else 10)
            here = here.renewed(pose, reach_px=max(NEAREST_PX, self.reach_px / 2 ** (index + 1)))
            if index and apart_px(mesh, camera, before, pose) < SETTLED_PX:
                break
        return here

    def steps(self, step_px: float) -> Array:
        """Return (6,) twists that move the scan's image by `step_px`; see `small_steps`."""
        return small_steps(self.seen.caster.mesh, self.seen.camera, self.pose, step_px=step_px)

    def covariance(self) -> Array:
        """Return (6, 6) of the twist about the scan's middle; zero along what cannot be seen.

        Where the edges lie farther inside or outside than they may, it is not understood what they show, and the
        covariance is inflated by the excess (Birge's ratio [Birge1932]).
        """
        scales = self.steps(1.0)
        inverse = np.linalg.pinv(self.weighed.information, rcond=1e-12, hermitian=True)
        excess = max(1.0, ((self.edges.bias_px - EDGE_BIAS_PX) / self._edge_doubt_px) ** 2)
        if self.seen.pictures is None:
            # Anywhere within its bounds, but alike over long stretches: their scatter does not tell it.
            excess = max(excess, MASK_PX**2 / 3 / self.edges.sigma_px**2)
        return UNMODELLED * excess * inverse * scales * scales[:, None]

    @property
    def _edge_doubt_px(self) -> float:
        return MASK_PX if self.seen.pictures is None else EDGE_DOUBT_PX

    def terms(self, pose: Pose) -> list[Term]:
        """Return outline, shading, and the outline's common offset, at a pose, in units of three sigma."""
        weighted = zip(self._terms(pose), self.weighed.weights, strict=True)
        return [replace(term, weight=weight) for term, weight in weighted]

    def _terms(self, pose: Pose) -> list[Term]:
        camera, edges = self.seen.camera, self.edges
        points = pose.apply(edges.on_scan)
        unit = 3 * edges.sigma_px
        # An object darkens toward its outline, and the steepest place of the blurred edge lies inside the true outline
        # by an amount that is much the same all round: an unknown of its own, known beforehand to some tenths of a
        # pixel. Taken for the outline, it would pass for depth; were it wholly unknown, depth would not be seen.
        offset = np.einsum("kp,kp->k", camera.project(points) - edges.pixels, edges.outward)
        pivot = View(self.seen.caster, camera, pose).pivot
        # A point of the outline may slide along the surface: across the outline that moves nothing, to first order.
        jacobian = np.einsum("kp,kpt->kt", edges.outward, image_flow(camera, points, pivot))
        pull = 1 / (1 + ((offset - edges.bias_px) / unit) ** 2) ** 2
        common, along = np.zeros(0), np.zeros((0, 6))
        if len(offset):
            common, along = np.atleast_1d(pull @ offset / pull.sum()), (pull @ jacobian / pull.sum())[None]
            jacobian, offset = jacobian - along, offset - common
        outline = Term(offset / unit, jacobian / unit, self.seen.patches(edges.pixels))
        doubt = 3 * self._edge_doubt_px
        bias = Term((common - EDGE_BIAS_PX) / doubt, along / doubt, np.zeros(len(common), np.int64), is_prior=True)
        return [outline, self.shading(pose), bias]

    def shading(self, pose: Pose) -> Term:
        """Return the shading's term at a pose."""
        if not self.used.any():
            return Term(np.zeros(0), np.zeros((0, 6)), np.zeros(0, np.int64))
        seen, at = self.seen, self if pose is self.pose else self.renewed(pose, reach_px=self.reach_px)
        points, normals = at.surface
        slopes = at.view.normal_slopes(seen.rays, points, normals)
        residuals, _, jacobian = explain(seen.samples, self.used, normals, at.lit, self.look, slopes)
        assert jacobian is not None
        unit = 3 * self.shading_sigma
        blocks = np.broadcast_to(seen.patches(seen.samples.pixels), self.used.shape)[self.used]
        return Term(residuals[self.used] / unit, jacobian[self.used] / unit, blocks)

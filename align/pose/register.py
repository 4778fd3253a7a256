"""The scan's place in front of the camera, found without clicks and refined on every frame."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.pose.appearance import free_normals
from align.pose.cast_shadows import shadow_scale
from align.pose.full_resolution import NEAREST_PX, FinalEvidence
from align.pose.motion import nudge
from align.pose.photographed import FEWEST, Photographs, shading_tells
from align.pose.scan_scale import check_distance, doubted_lengths, free_scale
from align.pose.search import FINALISTS, SURE, Found, compare_poses, search
from align.scan.smooth_normals import smooth_normals
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

WORST_MISFIT = 1.0
"""Above it the scan is refused."""
MIRROR_MISFIT = 0.4
"""Above it the mirrored scan is tried. Right scans of matte objects have 0.2 to 0.4, of metals 0.6; a metal's mirrored
one had 0.55."""
MIRRORED = 0.75
"""Of its normals' angle, what a mirrored scan must fit better by to be the right one."""
POOR_MISFIT = 0.95
"""Above it the pose is doubted."""
ASKED = 500
"""Pixels, about, whose best normals are looked for."""
NORMALS_DEG, OF_BESIDE, APART, OUTSIDE = 5.0, 0.55, 0.75, 0.35
"""The most that a right scan's normals are off, or as a share of what they are when it is turned; that its outline is
beside the edges; and what of its silhouette and the mask together may not be common to both: a mask may have taken in
the object's shadow."""
BESIDE_DEG = 8.0
"""By how much the scan is turned about each axis, to see what a wrong normal looks like on this material."""


class Fit(NamedTuple):
    """How well a pose explains the photographs, in terms that a wrong scan cannot meet."""

    overlap: float
    """Intersection over union of the scan's silhouette and the mask."""
    normals_deg: float
    """Median angle between the scan's normals and those that fit the photographs best, pixel by pixel, under the same
    lights, for the same material, and with the same samples."""
    beside_deg: float
    """The same, median, of the scan turned by `BESIDE_DEG` about each of the camera's axes, either way."""
    apart: float
    """Median distance from the outline to the edges in the photographs, in units of `ObservedObject.near_px`."""

    @property
    def misfit(self) -> float:
        """One number: a scan is refused above 1.

        A metal shows the table and itself, and its normals look wrong where they are right. So they do, then, and more
        so, where they are wrong by `BESIDE_DEG`: the angle is judged as a share of that one. A ball looks the same
        turned; an angle that is small is enough, then. Where no photographs tell the normals the outline judges alone.
        """
        shading = (
            0.0
            if np.isnan(self.normals_deg)
            else min(self.normals_deg / NORMALS_DEG, self.normals_deg / max(self.beside_deg, 1e-9) / OF_BESIDE)
        )
        return max(shading, self.apart / APART, (1 - self.overlap) / OUTSIDE)

    @property
    def words(self) -> str:
        told = (
            f"at the best pose the silhouette overlaps the mask by {100 * self.overlap:.1f} % (expected above "
            f"{100 * (1 - OUTSIDE):.0f} %), the scan's outline is {self.apart:.2g} (median) of a pixel, or in a "
            f"large picture of 0.5 % of the object, from the edges in the photographs (expected below {APART:g})"
        )
        shading = (
            f", and its normals are {self.normals_deg:.1f} degrees (median) from what the photographs show (expected "
            f"below {NORMALS_DEG:g}, or below {100 * OF_BESIDE:.0f} % of the {self.beside_deg:.1f} that they are when "
            f"it is turned by {BESIDE_DEG:g} degrees)"
        )
        return told + shading * (not np.isnan(self.normals_deg))


@dataclass(frozen=True)
class Registration:
    """Where the scan stands, and how well that is known."""

    pose: Pose
    """camera_from_scan, mm."""
    residual_px: float
    """Rms distance between the scan's outline and the edge in the photographs, inliers, after their common offset
    (`edge_bias_px` in the evidence: an object darkens toward its blurred outline, and looks a fraction of a pixel
    smaller)."""
    covariance: Array
    """(6, 6): of the twist (rotation vector in radians about the scan's middle, translation in mm), camera axes, see
    `align.pose.motion.nudge`, for the camera as given; without depth, where an orthographic one does not tell it."""
    evidence: dict[str, float]
    """What `Fit` has, and its misfit; shading (relative residual), rim_points, edge_bias_px,
    disagreement (of outline and shading: the variance is inflated by it); where shadows or near lights tell it, scale,
    scale_sigma and shadow_scale (see `shadow_scale`, `free_scale`); of the best pose and the next, where there is one:
    second_deviations (see `compare_poses`), second_angle_deg; where the focal length is not known:
    focal_shift_mm."""
    warnings: tuple[str, ...] = ()

    @property
    def focal_shift_mm(self) -> float:
        """How much farther away the scan stands with a focal length one sigma longer; 0 where that is known.

        It looks the same but for its perspective: fitted with the pose, the focal length was hardly better than from
        EXIF.
        """
        return self.evidence.get("focal_shift_mm", 0.0)

    @property
    def sigma_mm(self) -> float:
        """Standard deviation (rms length) of the position of the scan's middle, the focal length's part with it."""
        return float(np.sqrt(np.trace(self.covariance[3:, 3:]) + self.focal_shift_mm**2))

    @property
    def sigma_deg(self) -> float:
        """Standard deviation (rms angle) of the rotation."""
        return float(np.degrees(np.sqrt(np.trace(self.covariance[:3, :3]))))


def register(
    mesh: Mesh,
    photographs: Photographs,
    normals: NDArray | None,
    *,
    start: Pose | None = None,
    at_vertices: NDArray | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Registration:
    """Find the pose of a scan, from any orientation, and refine it on all frames.

    Every orientation is tried on silhouette and normals (`align.pose.start`); the best are rated and refined by mask
    and shading at low resolution (`align.pose.search`), the last few on the outline in the photographs and on the
    shading of all frames (`align.pose.full_resolution`), whatever the material (`align.pose.appearance`). A hypothesis
    test chooses (`align.pose.search.compare_poses`).

    Parameters
    ----------
    mesh : Mesh
        The scan, mm.
    photographs : Photographs
        Frames, camera, lights and the object's mask.
    normals : (H, W, 3) float, optional
        Photometric-stereo normals, camera frame, NaN where unknown; may be many degrees off.
    start : Pose, optional
        camera_from_scan, some pixels off: it is refined, and no other is looked for.
    at_vertices : (V, 3) float, optional
        The scan's normals without its noise, where they are known already; see `align.scan.smooth_normals`.
    executor : Executor, optional
        Runs the starts side by side.
    progress : callable, optional
        Called with (done, total).

    Raises
    ------
    AlignError
        The mask is empty, or the scan does not fit: another object, a mirrored scan, a wrong unit.
    """
    photographs.check(normals)
    caster = RayCaster(mesh, smooth_normals(mesh)[0] if at_vertices is None else at_vertices)
    found = search(caster, photographs, normals, start=start, executor=executor, progress=progress)
    evidence, pose = found.evidence, found.evidence.pose
    fit, distance = fit_of(evidence), -float(pose.apply(mesh.center_mm)[2])
    if fit.overlap > 1 - OUTSIDE:
        check_distance(photographs, distance)
    facts = {
        **fit._asdict(),
        "misfit": fit.misfit,
        "shading": evidence.shading_sigma,
        "rim_points": float(len(evidence.edges.pixels)),
        "edge_bias_px": evidence.edges.bias_px,
        "disagreement": evidence.weighed.disagreement,
    }
    warnings = []
    if fit.misfit > MIRROR_MISFIT and not np.isnan(fit.normals_deg):
        told = _refuse_mirrored(evidence, fit, lambda mirrored: search(mirrored, photographs, normals, most=FINALISTS))
        warnings += [told] if told else []
    if fit.misfit > WORST_MISFIT:
        raise AlignError(
            f"scan: it does not fit the photographs: {fit.words}. Is it the scan of this object, whole on the "
            f"side that the camera sees, and is the mask on the object?{doubted_lengths(photographs, distance)}"
            f"{photographs.cut_words}"
        )
    if fit.misfit > POOR_MISFIT:
        warnings.append(f"scan: it fits poorly: {fit.words}. Check the silhouette in the report.")
    if found.second is not None:
        facts["second_deviations"] = found.deviations
        facts["second_angle_deg"] = (pose.inverse() @ found.second).angle_deg()
        if found.deviations < SURE:
            warnings.append(
                f"scan: two poses fit nearly as well ({found.deviations:.1f} standard deviations), "
                f"{facts['second_angle_deg']:.0f} degrees apart: the object looks nearly symmetric. Check the "
                "silhouette and the shading in the report."
            )
    bias_px = evidence.edges.bias_px
    if abs(bias_px) > 1:
        warnings.append(
            f"scan: its outline lies {abs(bias_px):.1f} px {'outside' if bias_px > 0 else 'inside'} "
            "the edges in the photographs all round; expected a fraction of a pixel. Is the scan's unit, or the "
            "camera's focal length, a little off?"
        )
    shadow = shadow_scale(evidence, photographs)
    if shadow:
        facts["shadow_scale"] = shadow.scale
    if told := [free for free in (shadow, free_scale(evidence)) if free]:
        free = min(told, key=lambda free: free.sigma)
        facts["scale"], facts["scale_sigma"] = free.scale, free.sigma
        doubted = doubted_lengths(photographs, distance)
        # What surroundings may send back can make up for lights that are far off, but not for both.
        if free.warning and doubted:
            raise AlignError(free.warning + doubted)
        warnings += [free.warning] if free.warning else []
    if photographs.camera.focal_sigma and not photographs.camera.is_orthographic:
        facts["focal_shift_mm"] = photographs.camera.focal_sigma * distance
    found = Registration(pose, evidence.edges.residual_px, evidence.covariance(), facts)
    if np.isnan(fit.normals_deg):
        why = "of unknown lights" if photographs.lights.is_unknown else f"({FEWEST} are needed)"
        told = (
            f"scan: registered by the outline alone: with {len(photographs.frames)} photographs {why} shading tells "
            f"nothing. Its place is known to {found.sigma_mm:.2g} mm and its turn to {found.sigma_deg:.2g} degrees, "
            "if it is the right scan: a mirrored one, or one that looks alike, may fit as well. Check the outline in "
            "the report; shoot more flashes."
        )
        warnings = [told, *warnings]
    return replace(found, warnings=tuple(warnings))


def _refuse_mirrored(evidence: FinalEvidence, fit: Fit, search_for: Callable[[RayCaster], Found]) -> str | None:
    """Raise AlignError where the scan fits mirrored only; return what to say where it fits better so, else None."""
    caster, mirror = evidence.seen.caster, np.array([-1.0, 1.0, 1.0])
    mesh = caster.mesh
    flipped = replace(mesh, vertices=mesh.vertices * mirror, faces=mesh.faces[:, [0, 2, 1]])
    other = search_for(RayCaster(flipped, caster.normals * mirror)).evidence
    mirrored = fit_of(other)
    # Half a scan, or another object's, may fit better mirrored, and still not fit.
    if mirrored.misfit >= min(fit.misfit, WORST_MISFIT):
        return None
    # A scan that is its own mirror image may have stopped beside its best pose: its normals fit as well as mirrored.
    if mirrored.normals_deg < MIRRORED * fit.normals_deg:
        raise AlignError(
            f"scan: it fits mirrored only: {fit.words}; of its mirror image, {mirrored.words}. One axis of the scan "
            "is reversed: export it again from the scanner's program, or negate one coordinate."
        )
    # Nearly its own mirror image: both fit, and the same pixels are asked which one they show.
    better = compare_poses(replace(other, seen=replace(evidence.seen, caster=other.seen.caster)), evidence)
    if better < SURE:
        return None
    return (
        f"scan: its mirror image fits better, by {better:.1f} standard deviations (its normals are "
        f"{mirrored.normals_deg:.1f} degrees from what the photographs show, the scan's {fit.normals_deg:.1f}). Is one "
        "axis of the scan reversed? Export it again from the scanner's program, or negate one coordinate, and compare."
    )


def fit_of(evidence: FinalEvidence) -> Fit:
    """Return how well the evidence's pose fits."""
    pivot = evidence.pose.apply(evidence.seen.caster.mesh.center_mm)
    beside = []
    for turn in np.radians(BESIDE_DEG) * np.concatenate([np.eye(3), -np.eye(3)]):
        pose = nudge(evidence.pose, np.concatenate([turn, np.zeros(3)]), pivot)
        beside.append(normals_off_deg(evidence.renewed(pose, reach_px=NEAREST_PX)))
    return Fit(
        evidence.outline.overlap(evidence.seen.mask),
        normals_off_deg(evidence),
        float(np.median(beside)),
        evidence.edges.apart_px / evidence.seen.near_px,
    )


def normals_off_deg(evidence: FinalEvidence) -> float:
    """Return the median angle, degrees, between the scan's normals and those that photographs tell; nan: none does."""
    normals, samples, shown = evidence.surface[1], evidence.seen.samples, evidence.used.sum(0)
    # Of four photographs all must show a pixel; with more, one that only four show tells too little.
    asked = np.flatnonzero(shown > min(FEWEST, len(evidence.used) - 1))
    if not len(asked):
        return 90.0 if shading_tells(evidence.seen.lights) else float("nan")
    asked = asked[:: max(1, len(asked) // ASKED)]
    used, own = evidence.used[:, asked], normals[asked]
    values = np.where(used, samples.values[:, asked], 0) / samples.scale[asked]
    best = free_normals(values, used, own, evidence.lit.only(asked), evidence.look)
    return float(np.median(angular_error_deg(best, own)))

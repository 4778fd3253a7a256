"""The scan's place in front of the camera, found without clicks and refined on every frame."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.pose.cast_shadows import shadow_scale
from align.pose.fit import OUTSIDE, WORST_MISFIT, fit_of
from align.pose.mirror_image import refuse_mirrored
from align.pose.photographed import FEWEST, Photographs
from align.pose.scan_scale import check_distance, doubted_lengths
from align.pose.search import FINALISTS, SURE, search
from align.scan.smooth_normals import smooth_normals
from scene.errors import AlignError
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]

POOR_MISFIT = 0.95
"""Above it the pose is doubted."""


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
    """What `Fit` has, and its misfit; shading (relative residual), rim_points, edge_bias_px; where shadows tell it,
    shadow_scale and scale_sigma (see `shadow_scale`); of the best pose and the next, where there is one:
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
    }
    warnings = []
    if not np.isnan(fit.normals_deg):
        told = refuse_mirrored(evidence, fit, lambda mirrored: search(mirrored, photographs, normals, most=FINALISTS))
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
    if shadow := shadow_scale(evidence, photographs):
        facts["shadow_scale"], facts["scale_sigma"] = shadow.scale, shadow.sigma
        doubted = doubted_lengths(photographs, distance)
        if shadow.warning and doubted:
            raise AlignError(shadow.warning + doubted)
        warnings += [shadow.warning] if shadow.warning else []
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

"""The scan's place in front of the camera, found without clicks and refined on every frame."""

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from align.pose.focal import LongerFocal, register_longer
from align.pose.free_scale import free_scale
from align.pose.full_resolution import Fit
from align.pose.search import FINALISTS, Found, search
from align.scan.smooth_normals import smooth_normals
from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.pose import Pose

Array = NDArray[np.float64]

WORST_MISFIT = 0.9
"""Above it the scan is refused. Right scans stay under 0.4 here, wrong and mirrored ones of like shape over 0.9."""
MIRROR_MISFIT = 0.45
"""Above it the mirrored scan is tried."""
POOR_MISFIT = 0.7
"""Above it the pose is doubted. Gloss and folds alone turned a real cat's normals to 0.6."""
SURE = 4.0
"""A second pose that explains the photographs worse by fewer standard deviations cannot be told from the best."""


@dataclass(frozen=True)
class Registration:
    """Where the scan stands, and how well that is known.

    Parameters
    ----------
    pose : Pose
        camera_from_scan, mm.
    residual_px : float
        Rms distance between the scan's outline and the edge in the photographs, inliers, after their common
        offset (`edge_bias_px` in the evidence: blurred limbs darken, and look a fraction of a pixel smaller).
    sigma_mm, sigma_deg : float
        Standard deviation (rms length) of the position of the scan's middle, and of the rotation. An
        orthographic camera does not tell depth: it is left out there.
    covariance : (6, 6) float64
        Of the twist (rotation vector in radians about `pivot_mm`, translation in mm), camera axes; see
        `align.pose.motion.nudge`. Where the focal length is not known, its part (`longer`) is in it, and in both
        sigmas.
    pivot_mm : (3,) float64
        The scan's middle, camera frame.
    evidence : dict
        overlap (intersection over union of silhouette and mask), normals_deg (median angle to the normals that
        fit the photographs best), outline_share (of the outline within a pixel of an edge), misfit (the two as
        one number, see `Fit`), shading (relative residual), rim_points, edge_bias_px, disagreement (of
        outline and shading: the variance is inflated by it); under near lights scale, scale_sigma (see
        `align.pose.free_scale`); of the best pose and the next, where there is one: cost,
        second_cost, second_deviations (see `align.pose.hypothesis_test`), second_angle_deg; where the focal length is
        not known: focal_sigma (relative), focal_turn_deg and focal_shift_mm (of the pose, over one sigma of it).
    warnings : tuple of str
    ambiguous : bool
        Another pose explains the photographs as well, within chance: a symmetric object.
    longer : LongerFocal or None
        The same with a focal length one sigma longer; None where the focal length is known.
    """

    pose: Pose
    residual_px: float
    sigma_mm: float
    sigma_deg: float
    covariance: Array
    pivot_mm: Array
    evidence: dict[str, float]
    warnings: tuple[str, ...] = ()
    ambiguous: bool = False
    longer: LongerFocal | None = None


def register(
    mesh: Mesh,
    camera: Camera,
    frames: Frames,
    lights: Lights,
    mask: NDArray[np.bool_],
    normals: NDArray,
    *,
    start: Pose | None = None,
    at_vertices: NDArray | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Registration:
    """Find the pose of a scan, from any orientation, and refine it on all frames.

    Every orientation is tried on silhouette and normals (`align.pose.start`); the best are refined on the same at
    growing resolution, the last few on the outline in the photographs and on the shading of all frames
    (`align.evidence`); the cost chooses.

    Parameters
    ----------
    mesh : Mesh
        The scan, mm.
    camera : Camera
    frames : Frames
    lights : Lights
        One a frame; near lights are taken at each point.
    mask : (H, W) bool
        The object.
    normals : (H, W, 3) float
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
        The mask is empty or cut by the image's border, or the scan does not fit: another object, a mirrored
        scan, a wrong unit.
    """
    _check_input(camera, frames, lights, mask, normals)
    if at_vertices is None:
        at_vertices = smooth_normals(mesh)[0]
    found = search(
        mesh, camera, frames, lights, mask, normals, at_vertices, start=start, executor=executor, progress=progress
    )
    pose, evidence = found.pose, found.evidence
    _check_distance(mesh, camera, lights, pose)
    fit = evidence.fit
    facts = {
        "overlap": fit.overlap,
        "normals_deg": fit.normals_deg,
        "outline_share": fit.outline_share,
        "misfit": fit.misfit,
        "shading": evidence.shading_sigma,
        "rim_points": float(len(evidence.edges)),
        "edge_bias_px": evidence.bias_px,
        "disagreement": evidence.disagreement,
    }
    warnings = []
    if fit.misfit > MIRROR_MISFIT:

        def search_for(other: Mesh, its_normals: Array) -> Found:
            return search(other, camera, frames, lights, mask, normals, its_normals, most=FINALISTS)

        _refuse_mirrored(mesh, at_vertices, fit, search_for)
    if fit.misfit > WORST_MISFIT:
        raise AlignError(
            f"scan: it does not fit the photographs: {fit.words}. Is it the scan of this object, whole on the "
            "side that the camera sees, and is the mask on the object?"
        )
    if fit.misfit > POOR_MISFIT:
        warnings.append(f"scan: it fits poorly: {fit.words}. Check the silhouette in the report.")
    ambiguous = False
    if found.second is not None and found.contest is not None:
        facts["cost"], facts["second_cost"] = found.contest.costs
        facts["second_deviations"] = found.contest.deviations
        facts["second_angle_deg"] = (pose.inverse() @ found.second).angle_deg()
        ambiguous = found.contest.deviations < SURE
    if ambiguous:
        warnings.append(
            f"scan: two poses fit nearly as well (cost {facts['cost']:.4f} and {facts['second_cost']:.4f}, "
            f"{facts['second_deviations']:.1f} standard deviations), {facts['second_angle_deg']:.0f} degrees apart: "
            "the object looks nearly symmetric. Check the silhouette and the shading in the report."
        )
    if abs(evidence.bias_px) > 1:
        warnings.append(
            f"scan: its outline lies {abs(evidence.bias_px):.1f} px {'outside' if evidence.bias_px > 0 else 'inside'} "
            "the edges in the photographs all round; expected a fraction of a pixel. Is the scan's unit, or the "
            "camera's focal length, a little off?"
        )
    free = free_scale(evidence)
    if free is not None:
        facts["scale"], facts["scale_sigma"] = free.scale, free.sigma
        # A scan that fits poorly tells nothing of its size.
        warnings += [free.warning] if free.warning and fit.misfit <= WORST_MISFIT else []
    covariance, longer = evidence.covariance(), register_longer(evidence)
    if longer is not None:
        covariance = covariance + longer.covariance
        facts["focal_sigma"] = camera.focal_sigma
        facts["focal_turn_deg"] = float(np.degrees(np.linalg.norm(longer.twist[:3])))
        facts["focal_shift_mm"] = float(np.linalg.norm(longer.twist[3:]))
    return Registration(
        pose,
        evidence.residual_px,
        float(np.sqrt(np.trace(covariance[3:, 3:]))),
        float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))),
        covariance,
        pose.apply(mesh.center_mm),
        facts,
        tuple(warnings),
        ambiguous,
        longer,
    )


def _check_input(camera: Camera, frames: Frames, lights: Lights, mask: NDArray, normals: NDArray) -> None:
    size = (camera.height, camera.width)
    if mask.shape != size or normals.shape != (*size, 3) or (frames.height, frames.width) != size:
        raise AlignError(
            f"align: camera {size[1]} x {size[0]} px, frames {frames.width} x {frames.height}, mask "
            f"{mask.shape[1]} x {mask.shape[0]}, normals {normals.shape[1]} x {normals.shape[0]}; all must agree."
        )
    if len(lights) != len(frames):
        raise AlignError(f"align: {len(lights)} lights for {len(frames)} frames; expected one each.")
    if mask.sum() < 200:
        raise AlignError(f"mask: {mask.sum()} pixels are too few to place a scan; expected some thousand.")
    known = mask & np.isfinite(normals).all(-1)
    if known.sum() < 0.2 * mask.sum():
        raise AlignError(
            f"align: normals are known at {known.sum()} of the mask's {mask.sum()} pixels; expected most. "
            "Is the mask on the object?"
        )
    rim = np.concatenate([mask[0], mask[-1], mask[1:-1, 0], mask[1:-1, -1]])
    # A nibble at the border may be a fault of the mask; a stretch of it is the object leaving the picture.
    if rim.sum() > max(4, 0.15 * math.sqrt(mask.sum())):
        raise AlignError(
            f"mask: {rim.sum()} of its pixels lie on the image's border: the object leaves the frame, and its "
            "outline cannot be matched with the scan's. Reshoot with the whole object in view."
        )


def _check_distance(mesh: Mesh, camera: Camera, lights: Lights, pose: Pose) -> None:
    distance = -float(pose.apply(mesh.center_mm)[2])
    expected = -float(lights.reference_point_mm[2])
    if not camera.is_orthographic and expected > 0 and not 0.4 < distance / expected < 2.5:
        raise AlignError(
            f"scan: it would have to stand {distance:.4g} mm from the camera to look as large as the object, but "
            f"the lights were calibrated about a point {expected:.4g} mm away: the scan is about "
            f"{distance / expected:.3g} times too large, or diameter_mm of the balls so much too small. Check "
            "scan_unit under [object], and [[spheres]]."
        )


def _refuse_mirrored(mesh: Mesh, at_vertices: Array, fit: Fit, search_for: Callable[[Mesh, Array], Found]) -> None:
    mirror = np.array([-1.0, 1.0, 1.0])
    flipped = replace(mesh, vertices=mesh.vertices * mirror, faces=mesh.faces[:, [0, 2, 1]])
    mirrored = search_for(flipped, at_vertices * mirror).evidence.fit
    # A scan that is its own mirror image may have stopped beside its best pose: its normals fit as well as mirrored.
    if mirrored.misfit < 0.5 * fit.misfit and mirrored.normals_deg < 0.9 * fit.normals_deg:
        raise AlignError(
            f"scan: it fits mirrored only: {fit.words}; of its mirror image, {mirrored.words}. One axis of the scan "
            "is reversed: export it again from the scanner's program, or negate one coordinate."
        )

"""The scan's place in front of the camera, found without clicks and refined on every frame."""

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from align.embree import RayCaster
from align.evidence import FinalEvidence, RoughEvidence, mean_picture, small_steps
from align.refine import descend
from align.shading import surface, take_samples
from align.start import Start, find_starts
from scene.camera import Camera
from scene.errors import AlignError
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose

Array = NDArray[np.float64]

STARTS = 20
"""Orientations that are refined at low resolution."""
FINALISTS = 3
"""Of these, how many are refined on the frames."""
LEAST_OVERLAP = 0.85
"""Silhouettes of the right scan overlap the mask better than this, unless a good part was not scanned."""
MOST_NORMAL_DEG = 30.0
"""Least-squares normals under gloss and shadows are up to 20 degrees off; a wrong scan's, 40 and more."""
NEARLY_EQUAL = 1.15
"""A second pose whose cost is within this factor of the best one's cannot be told from it."""


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
        `align.motion.nudge`.
    pivot_mm : (3,) float64
        The scan's middle, camera frame.
    evidence : dict
        overlap (intersection over union of silhouette and mask), normals_deg (median angle to the photometric
        normals), shading (relative residual), rim_points, rim_share (of the outline where an edge was seen),
        edge_bias_px, cost, second_cost, second_angle_deg.
    warnings : tuple of str
    """

    pose: Pose
    residual_px: float
    sigma_mm: float
    sigma_deg: float
    covariance: Array
    pivot_mm: Array
    evidence: dict[str, float]
    warnings: tuple[str, ...] = ()


def register(
    mesh: Mesh,
    camera: Camera,
    frames: Frames,
    lights: Lights,
    mask: NDArray[np.bool_],
    normals: NDArray,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Registration:
    """Find the pose of a scan, from any orientation, and refine it on all frames.

    Every orientation is tried on silhouette and normals (`align.start`); the best are refined on the same at
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
    total = STARTS + FINALISTS + 2
    tell = progress or (lambda done, total: None)
    caster = RayCaster(mesh)
    starts = find_starts(caster, camera, mask, normals, count=STARTS)
    tell(1, total)
    rough = _refine_roughly(caster, camera, mask, normals, starts, executor, lambda done: tell(1 + done, total))

    count = int(np.clip(600_000 / len(frames), 3000, 40_000))
    picture = mean_picture(frames, lights, mask)
    finalists = []
    for done, (pose, _) in enumerate(rough[:FINALISTS]):
        finalists.append(
            _finish(caster, camera, frames, lights, mask, picture, pose, count=count // 8, cells=160, rounds=2)
        )
        tell(2 + STARTS + done, total)
    finalists.sort(key=lambda item: item[1].cost)
    pose, evidence = _finish(
        caster, camera, frames, lights, mask, picture, finalists[0][0], count=count, cells=400, rounds=4
    )
    tell(total, total)

    covariance = evidence.covariance()
    facts = {
        "overlap": evidence.rim.overlap(mask),
        "normals_deg": _normals_deg(caster, camera, pose, mask, normals),
        "shading": evidence.shading_sigma,
        "rim_points": float(len(evidence.edges)),
        "rim_share": evidence.rim_share,
        "edge_bias_px": evidence.bias_px,
        "cost": finalists[0][1].cost,
    }
    warnings = []
    others = [(p, e) for p, e in finalists[1:] if _apart_px(caster.mesh, camera, finalists[0][0], p) > 5]
    if others:
        second, second_evidence = others[0]
        facts["second_cost"] = second_evidence.cost
        facts["second_angle_deg"] = (pose.inverse() @ second).angle_deg()
        if second_evidence.cost < NEARLY_EQUAL * facts["cost"]:
            warnings.append(
                f"scan: two poses fit nearly as well (cost {facts['cost']:.4f} and {second_evidence.cost:.4f}), "
                f"{facts['second_angle_deg']:.0f} degrees apart: the object looks nearly symmetric. Check the "
                "silhouette and the shading in the report."
            )
    _check_fit(mesh, camera, lights, mask, normals, pose, facts)
    if evidence.rim_share < 0.5:
        warnings.append(
            f"scan: only {100 * evidence.rim_share:.0f} % of its outline has an edge in the photographs; the pose "
            "rests on the shading."
        )
    if abs(evidence.bias_px) > 1:
        warnings.append(
            f"scan: its outline lies {abs(evidence.bias_px):.1f} px {'outside' if evidence.bias_px > 0 else 'inside'} "
            "the edges in the photographs all round; expected a fraction of a pixel. Is the scan's unit, or the "
            "camera's focal length, a little off?"
        )
    pivot = pose.apply(mesh.center_mm)
    return Registration(
        pose,
        evidence.residual_px,
        float(np.sqrt(np.trace(covariance[3:, 3:]))),
        float(np.degrees(np.sqrt(np.trace(covariance[:3, :3])))),
        covariance,
        pivot,
        facts,
        tuple(warnings),
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


def _refine_roughly(
    caster: RayCaster,
    camera: Camera,
    mask: NDArray[np.bool_],
    normals: NDArray,
    starts: list[Start],
    executor: Executor | None,
    tell: Callable[[int], None],
) -> list[tuple[Pose, float]]:
    """Refine starts by silhouette and normals in two rounds; return distinct poses, lowest cost first."""
    coarse = RoughEvidence.of(camera, mask, normals, cells=40, count=500)
    fine = RoughEvidence.of(camera, mask, normals, cells=90, count=2000)
    run = partial(_descend_roughly, caster, coarse, 6)
    found: list[tuple[Pose, float]] = []
    results: Iterator[tuple[Pose, float]] = (executor.map if executor else map)(run, [s.pose for s in starts])
    for done, item in enumerate(results):
        found.append(item)
        tell(done + 1)
    found = _distinct(caster.mesh, camera, found, apart_px=coarse.step_px)
    run = partial(_descend_roughly, caster, fine, 8)
    found = list((executor.map if executor else map)(run, [pose for pose, _ in found[: 2 * FINALISTS]]))
    return _distinct(caster.mesh, camera, found, apart_px=2 * fine.step_px)


def _descend_roughly(caster: RayCaster, evidence: RoughEvidence, steps: int, pose: Pose) -> tuple[Pose, float]:
    scales = small_steps(caster.mesh, evidence.camera, pose, step_px=evidence.step_px)
    pose, cost, _ = descend(
        partial(evidence.terms, caster, scales),
        pose,
        lambda p: p.apply(caster.mesh.center_mm),
        scales,
        steps=steps,
    )
    return pose, cost


def _distinct(
    mesh: Mesh, camera: Camera, found: list[tuple[Pose, float]], *, apart_px: float
) -> list[tuple[Pose, float]]:
    kept: list[tuple[Pose, float]] = []
    for pose, cost in sorted(found, key=lambda item: item[1]):
        if all(_apart_px(mesh, camera, pose, other) > 3 * apart_px for other, _ in kept):
            kept.append((pose, cost))
    return kept


def _apart_px(mesh: Mesh, camera: Camera, a: Pose, b: Pose) -> float:
    """Return the rms distance, in pixels, between the images of the scan at two poses."""
    points = mesh.vertices[:: max(1, len(mesh.vertices) // 500)]
    apart = np.linalg.norm(a.apply(points) - b.apply(points), axis=1)
    scale = 1.0 if camera.is_orthographic else max(-float(a.apply(mesh.center_mm)[2]), 1e-9)
    return float(np.sqrt(np.mean(apart**2)) * camera.fx / scale)


def _finish(
    caster: RayCaster,
    camera: Camera,
    frames: Frames,
    lights: Lights,
    mask: NDArray[np.bool_],
    picture: NDArray[np.float32],
    pose: Pose,
    *,
    count: int,
    cells: int,
    rounds: int,
) -> tuple[Pose, FinalEvidence]:
    """Refine on outline and shading; shadows, scales and weights are renewed each round."""
    samples = take_samples(frames, lights, mask, count=count)
    evidence = FinalEvidence.of(caster, camera, lights, mask, picture, samples, pose, cells=cells, reach_px=6.0)
    for index in range(rounds):
        scales = small_steps(caster.mesh, camera, pose, step_px=0.5)
        pose, _, _ = descend(evidence.terms, pose, lambda p: p.apply(caster.mesh.center_mm), scales, steps=6)
        evidence = evidence.renewed(pose, reach_px=4.0 if index == 0 else 2.5)
    return pose, evidence


def _normals_deg(caster: RayCaster, camera: Camera, pose: Pose, mask: NDArray[np.bool_], normals: NDArray) -> float:
    v, u = np.nonzero(mask & np.isfinite(normals).all(-1))
    pick = np.linspace(0, len(v) - 1, min(4000, len(v))).astype(int)
    _, rendered = surface(caster, camera, pose, np.stack([u, v], -1)[pick].astype(np.float64))
    error = angular_error_deg(rendered, normals[v[pick], u[pick]])
    return float(np.nanmedian(error)) if np.isfinite(error).any() else 180.0


def _check_fit(
    mesh: Mesh,
    camera: Camera,
    lights: Lights,
    mask: NDArray[np.bool_],
    normals: NDArray,
    pose: Pose,
    facts: dict[str, float],
) -> None:
    distance = -float(pose.apply(mesh.center_mm)[2])
    expected = -float(lights.reference_point_mm[2])
    if not camera.is_orthographic and expected > 0 and not 0.4 < distance / expected < 2.5:
        raise AlignError(
            f"scan: it would have to stand {distance:.4g} mm from the camera to look as large as the object, but "
            f"the lights were calibrated about a point {expected:.4g} mm away: the scan is about "
            f"{distance / expected:.3g} times too large. Check scan_unit under [object]."
        )
    if facts["overlap"] >= LEAST_OVERLAP and facts["normals_deg"] <= MOST_NORMAL_DEG:
        return
    found = (
        f"at the best pose the scan's silhouette overlaps the mask by {100 * facts['overlap']:.0f} % (expected "
        f"above {100 * LEAST_OVERLAP:.0f} %), and its normals are {facts['normals_deg']:.0f} degrees (median) from "
        f"the photographs' (expected below {MOST_NORMAL_DEG:.0f})"
    )
    mirrored = _fits_mirrored(mesh, camera, mask, normals, facts)
    if mirrored:
        raise AlignError(
            f"scan: it fits mirrored only: {found}; its mirror image reaches {100 * mirrored:.0f} %. One axis of the "
            "scan is reversed; export it again from the scanner's program, or negate one coordinate."
        )
    raise AlignError(
        f"scan: it does not fit the photographs: {found}. Is it the scan of this object, whole on the side that the "
        "camera sees, and is the mask on the object?"
    )


def _fits_mirrored(
    mesh: Mesh, camera: Camera, mask: NDArray[np.bool_], normals: NDArray, facts: dict[str, float]
) -> float:
    """Return the mirrored scan's overlap where that scan fits, else 0."""
    flipped = replace(mesh, vertices=mesh.vertices * [-1.0, 1.0, 1.0], faces=mesh.faces[:, [0, 2, 1]])
    caster = RayCaster(flipped)
    starts = find_starts(caster, camera, mask, normals, count=8)
    rough = _refine_roughly(caster, camera, mask, normals, starts, None, lambda done: None)
    fine = RoughEvidence.of(camera, mask, normals, cells=200, count=500)
    pose = rough[0][0]
    overlap = fine.rim(caster, pose).overlap(mask)
    good = overlap > max(LEAST_OVERLAP, facts["overlap"])
    return overlap if good and _normals_deg(caster, camera, pose, mask, normals) < MOST_NORMAL_DEG else 0.0

"""From a scan, a mask and a stack to a pose: every orientation, then fewer and finer."""

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial, reduce

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import FinalEvidence
from align.pose.hypothesis_test import Contest, compare_poses
from align.pose.last_rounds import refine
from align.pose.motion import apart_px
from align.pose.outline_edges import LimbPictures
from align.pose.refine import descend
from align.pose.rough import RoughEvidence, small_steps
from align.pose.shading import take_samples
from align.pose.sharp_picture import longer_side
from align.pose.start import Start, find_starts
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.rays import RayCaster

STARTS = 24
"""Orientations that are refined at low resolution; the right one is nearly always among the first five, but of a gear
with eight teeth sixteen are nearly right."""
CLOSE = 1.8
"""A pose whose rough cost is more times the best one's must win by `CLEAR`; right ones are mostly within 1.4."""
CLEAR = 4.0
"""Standard deviations."""
SAMPLES = 150_000
"""Pixels times frames that the last refinement looks at."""
ROUGH_SIZE = 500
"""Pixels across the object, at most, until the frames themselves are asked."""
FINALISTS = 3
"""Of these, how many are refined on the frames; more, up to three times as many, where others' costs are as close."""
APART_PX = 5.0
"""Poses that differ by less are one."""
STEPS = STARTS + 3 * FINALISTS + 2
"""What `progress` counts to."""


@dataclass(frozen=True)
class Found:
    """The best pose, with what speaks for it, and the next best; None where all starts led to one pose."""

    pose: Pose
    evidence: FinalEvidence
    second: Pose | None
    contest: Contest | None


def search(
    mesh: Mesh,
    camera: Camera,
    frames: Frames,
    lights: Lights,
    mask: NDArray[np.bool_],
    normals: NDArray,
    at_vertices: NDArray,
    *,
    start: Pose | None = None,
    most: int = 3 * FINALISTS,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Found:
    """Return the pose that explains the photographs best, whether well or not; see `align.pose.register.register`.

    `at_vertices` (V, 3): the scan's normals without its noise, which turns its own by degrees, more than a pose does.
    `most`: how many poses are refined on the frames, at most.
    """
    tell = progress or (lambda done, total: None)
    caster = RayCaster(mesh, at_vertices)
    small = _shrunken(camera, mask, normals)
    starts = find_starts(caster, *small, count=STARTS) if start is None else [Start(start, 1.0)]
    tell(1, STEPS)
    rough = _refine_roughly(caster, *small, starts, executor, lambda done: tell(1 + done, STEPS))

    # The more frames, the fewer pixels tell as much; neighbours err together, so that more of them tell little more.
    count = int(np.clip(SAMPLES / len(frames), 3000, 15_000))
    # The rough pose may be a pixel of the shrunken picture off.
    reach = max(6.0, 0.01 * (longer_side(mask) - 1))
    limbs = LimbPictures.of(frames, lights, mask)

    def look(pose: Pose, count: int, cells: int) -> FinalEvidence:
        samples = take_samples(frames, lights, mask, count=count)
        return FinalEvidence.of(caster, camera, lights, mask, limbs, samples, pose, cells=cells, reach_px=reach)

    finalists: list[tuple[Pose, FinalEvidence]] = []
    eligible = sum(cost < CLOSE * rough[0][1] for _, cost in rough)
    few = look(rough[0][0], count // 6, 160)
    for done, (pose, _) in enumerate(rough[: min(max(FINALISTS, eligible), most)]):
        # What the samples are does not depend on the pose: they are read once.
        finalists.append(refine(few if done == 0 else few.renewed(pose, reach_px=reach), rounds=3, reach_px=reach))
        tell(2 + STARTS + done, STEPS)
    best = 0
    for challenger in range(1, len(finalists)):
        needed = 0.0 if challenger < eligible else CLEAR
        if compare_poses(finalists[best][1], finalists[challenger][1]).deviations < -needed:
            best = challenger
    rivals = [
        (pose, compare_poses(finalists[best][1], evidence))
        for index, (pose, evidence) in enumerate(finalists)
        if index != best and apart_px(mesh, camera, finalists[best][0], pose) > APART_PX
    ]
    rivals.sort(key=lambda rival: rival[1].deviations)
    pose, evidence = refine(look(finalists[best][0], count, 400), rounds=8, reach_px=reach)
    tell(STEPS, STEPS)
    return Found(pose, evidence, *(rivals[0] if rivals else (None, None)))


def _shrunken(camera: Camera, mask: NDArray[np.bool_], normals: NDArray) -> tuple[Camera, NDArray[np.bool_], NDArray]:
    """Halve camera, mask and normals until the object is no larger than `ROUGH_SIZE`: the same scene, fewer pixels."""
    while longer_side(mask) > ROUGH_SIZE:
        camera = camera.halved()
        height, width = camera.height, camera.width
        quarters = [np.s_[row : 2 * height : 2, column : 2 * width : 2] for row in (0, 1) for column in (0, 1)]
        mask = np.stack([mask[part] for part in quarters]).sum(0) >= 2
        # One after the other: all four at once are another map of the full size, and their copies more.
        normals = unit(reduce(np.add, (np.nan_to_num(normals[part]) for part in quarters)))
    return camera, mask, normals


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
    found = _distinct(caster.mesh, camera, found, spacing_px=coarse.step_px)
    run = partial(_descend_roughly, caster, fine, 8)
    found = list((executor.map if executor else map)(run, [pose for pose, _ in found[: 3 * FINALISTS]]))
    return _distinct(caster.mesh, camera, found, spacing_px=2 * fine.step_px)


def _descend_roughly(caster: RayCaster, evidence: RoughEvidence, steps: int, pose: Pose) -> tuple[Pose, float]:
    scales = small_steps(caster.mesh, evidence.camera, pose, step_px=evidence.step_px)
    pose, cost, _ = descend(
        partial(evidence.terms, caster),
        pose,
        lambda p: p.apply(caster.mesh.center_mm),
        scales,
        steps=steps,
    )
    return pose, cost


def _distinct(
    mesh: Mesh, camera: Camera, found: list[tuple[Pose, float]], *, spacing_px: float
) -> list[tuple[Pose, float]]:
    kept: list[tuple[Pose, float]] = []
    for pose, cost in sorted(found, key=lambda item: item[1]):
        if all(apart_px(mesh, camera, pose, other) > 3 * spacing_px for other, _ in kept):
            kept.append((pose, cost))
    return kept

"""From a scan, a mask and a stack to a pose: every orientation, then fewer and finer."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import FinalEvidence, Observed, patches
from align.pose.motion import apart_px
from align.pose.outline_edges import EdgePictures
from align.pose.photographed import Photographs, Target, longer_side
from align.pose.rough import refine_roughly
from align.pose.start import find_starts
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
FINALISTS = 3
"""Of these, how many are refined on the frames; more, up to three times as many, where others' costs are as close."""
SURE = 4.0
"""A second pose that explains the photographs worse by fewer standard deviations cannot be told from the best."""
APART_PX = 5.0
"""Poses that differ by less are one."""
STEPS = STARTS + 3 * FINALISTS + 2
"""What `progress` counts to."""
BLOCKS = 14
"""Patches across the object: residuals in one patch err together."""
CHANCE = 0.002
"""Difference of the mean cost that the mask's own errors make."""
HIDDEN = 0.05
"""What a pixel that looks into a hole of the scan is charged."""
OUTLINE_CHANCE = 0.05
"""Difference of the outline's share without an edge that is chance."""


@dataclass(frozen=True)
class PoseTest:
    """How two poses compare."""

    costs: tuple[float, float]
    """Mean cost a pixel of the first and the second: 0 explained, 1 not at all."""
    deviations: float
    """By how many standard deviations the first is better."""


@dataclass(frozen=True)
class Found:
    """What speaks for the best pose, and the next best with its test; None where all starts led to one pose."""

    evidence: FinalEvidence
    second: Pose | None
    test: PoseTest | None


def search(
    caster: RayCaster,
    photographs: Photographs,
    normals: NDArray,
    *,
    start: Pose | None = None,
    most: int = 3 * FINALISTS,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Found:
    """Return the pose that explains the photographs best, whether well or not; see `align.pose.register.register`.

    The caster's normals are the scan's without its noise, which turns its own by degrees, more than a pose does.
    `most`: how many poses are refined on the frames, at most.
    """
    tell = progress or (lambda done, total: None)
    small = Target(photographs.camera, photographs.mask, normals).shrunken()
    starts = find_starts(caster, small, count=STARTS) if start is None else [start]
    tell(1, STEPS)
    rough = refine_roughly(
        caster, small, starts, most=3 * FINALISTS, executor=executor, tell=lambda done: tell(1 + done, STEPS)
    )

    # The more frames, the fewer pixels tell as much; neighbours err together, so that more of them tell little more.
    count = int(np.clip(SAMPLES / len(photographs.frames), 3000, 15_000))
    # The rough pose may be a pixel of the shrunken picture off.
    reach = max(6.0, 0.01 * (longer_side(photographs.mask) - 1))
    pictures = EdgePictures.of(photographs)
    finalists: list[FinalEvidence] = []
    eligible = sum(cost < CLOSE * rough[0][1] for _, cost in rough)
    few = Observed.of(caster, photographs, pictures, count=count // 6, cells=160)
    for done, (pose, _) in enumerate(rough[: min(max(FINALISTS, eligible), most)]):
        finalists.append(FinalEvidence.about(few, pose, reach_px=reach).refined(rounds=3, reach_px=reach))
        tell(2 + STARTS + done, STEPS)
    best = finalists[0]
    for index, challenger in enumerate(finalists[1:], 1):
        if compare_poses(best, challenger).deviations < -(0.0 if index < eligible else CLEAR):
            best = challenger
    rivals = [
        (other.pose, compare_poses(best, other))
        for other in finalists
        if other is not best and apart_px(caster.mesh, photographs.camera, best.pose, other.pose) > APART_PX
    ]
    rivals.sort(key=lambda rival: rival[1].deviations)
    many = Observed.of(caster, photographs, pictures, count=count, cells=400)
    evidence = FinalEvidence.about(many, best.pose, reach_px=reach).refined(rounds=8, reach_px=reach)
    tell(STEPS, STEPS)
    return Found(evidence, *(rivals[0] if rivals else (None, None)))


def compare_poses(one: FinalEvidence, two: FinalEvidence) -> PoseTest:
    """Compare two poses of the same frames, mask and samples, on the same pixels, with one scale for both.

    Each lit sample is compared with what the scan predicts at the pixel's best albedo, and samples where the scan turns
    from the light with darkness; the cost is r^2 / (1 + r^2) in units of three times the smaller sigma of the two. The
    scatter of the differences is taken from their patches' median deviation: two poses of a nearly symmetric object
    differ in few patches, and those are the evidence, not the scatter. The outline's share that has no edge in the
    photographs is held against a pose, too, in units of `OUTLINE_CHANCE`.

    A pixel that looks into a hole of the scan at either pose is not compared: where the hole lies does not tell how the
    object stands. The pose whose hole it is is charged a little, since it may hide there what it does not explain.
    """
    sigma = min(one.shading_sigma, two.shading_sigma)
    first, second = one.pixel_costs(sigma), two.pixel_costs(sigma)
    pixels = one.seen.samples.pixels
    size = float(np.ptp(pixels, axis=0).max()) + 1
    _, block = np.unique(patches(pixels, size / BLOCKS), return_inverse=True)
    outside = [evidence.outline.beyond(evidence.seen.mask) for evidence in (one, two)]
    holes = [~np.isfinite(cost) for cost in (first, second)]
    difference = np.where(holes[0] | holes[1], HIDDEN * (holes[1] * 1.0 - holes[0]), second - first)
    sums = np.bincount(block, difference)
    spread = 1.4826 * float(np.median(np.abs(sums - np.median(sums)))) * np.sqrt(len(sums)) / len(difference)
    better = (float(difference.mean()) + outside[1] - outside[0]) / float(np.hypot(spread, CHANCE))
    better += (one.fit.outline_share - two.fit.outline_share) / OUTLINE_CHANCE
    # Of a scan seen from its open side alone, nothing is explained.
    seen = (cost[~hole] if not hole.all() else np.ones(1) for cost, hole in zip((first, second), holes, strict=True))
    costs = [float(cost.mean()) + beyond for cost, beyond in zip(seen, outside, strict=True)]
    return PoseTest((costs[0], costs[1]), better)

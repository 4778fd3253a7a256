"""From a scan, a mask and a stack to a pose: every orientation, then fewer and finer."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.pose.full_resolution import NEAREST_PX, FinalEvidence, ObservedObject, patches
from align.pose.motion import apart_px
from align.pose.outline_edges import EdgePictures
from align.pose.photographed import FEWEST, Photographs, longer_side, shading_tells
from align.pose.scan_view import View
from align.pose.shading import cosines, explain
from align.pose.start import find_starts
from scene.pose import Pose
from scene.rays import RayCaster
from scene.robust import spread

Array = NDArray[np.float64]

STARTS, REFINED = 60, 12
"""Orientations that are rated by the shading as they are, and of these the ones that are refined at low resolution."""
FEW = 600
"""Pixels that the first two look at."""
REACH = 0.1
"""Of the object's size: how far off the first pose may be."""
CLEAR = 8.0
"""Standard deviations by which a pose must win at low resolution for the other not to be refined on the frames."""
ROUNDS, STAYED_PX = 20, 0.2
"""Of the refinement with the scan's own silhouette for a mask, until the scan's image moves by less."""
SAMPLES = 150_000
"""Pixels times frames that the last refinement looks at."""
FINALISTS = 3
"""Of a mirrored scan, how many are refined on the frames; of others three times as many, at most."""
SURE = 4.0
"""A second pose that explains the photographs worse by fewer standard deviations cannot be told from the best."""
APART_PX = 5.0
"""Poses that differ by less are one."""
BLOCKS = 14
"""Patches across the object: residuals in one patch err together."""
CHANCE = 0.002
"""Difference of the mean cost that the mask's own errors make."""
USUAL_SIGMA = 0.05
"""Of the shading, relative, by which poses are rated at first."""
ROUGH_ROUNDS = 4
HIDDEN = 0.05
"""What a pixel that looks into a hole of the scan is charged."""


@dataclass(frozen=True)
class Found:
    """What speaks for the best pose, and the next best, with the standard deviations by which it is worse.

    None and infinity where all starts led to one pose.
    """

    evidence: FinalEvidence
    second: Pose | None
    deviations: float


def search(
    caster: RayCaster,
    photographs: Photographs,
    normals: NDArray | None,
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
    camera, mask = photographs.camera, photographs.mask
    size, outline_alone = longer_side(mask), not shading_tells(photographs.lights)
    total = (STARTS if outline_alone else REFINED) + 3 * FINALISTS + 2
    rough = rough_poses(caster, photographs, normals, start=start, executor=executor, tell=lambda n: tell(n, total))
    # The more frames, the fewer pixels tell as much; neighbours err together, so that more of them tell little more.
    count = int(np.clip(SAMPLES / len(photographs.frames), 3000, 15_000))
    reach = max(6.0, 0.01 * (size - 1))
    # Of a few photographs, what is no shadow's edge is told by the mask.
    pictures = None if outline_alone else EdgePictures.of(photographs)

    def observed(pixels: int, cells: int, pose: Pose | None = None) -> ObservedObject:
        seen = None if pose is None or outline_alone else View(caster, camera, pose).silhouette()
        return ObservedObject.of(caster, photographs, pictures, count=pixels, cells=cells, silhouette=seen)

    finalists = [one for one in rough if compare_poses(rough[0], one) < CLEAR][:most]
    if len(finalists) > 1:
        few = observed(count // 6, 160)
        for done, one in enumerate(finalists):
            finalists[done] = FinalEvidence(few, one.pose, reach).refined(rounds=3)
            tell(total - 1 - len(finalists) + done, total)
    # Where one pose was left, it and the next are known at low resolution alone.
    found = finalists if len(finalists) > 1 else rough[:2]
    best, rivals = best_of(found)
    # The mask was where the object was looked for; now the scan tells where its outline is.
    pose = found[best].pose
    for _ in range(ROUNDS):
        before, seen = pose, observed(count // 6, 160, pose)
        pose = FinalEvidence(seen, pose, reach).refined(rounds=3).pose
        if apart_px(caster.mesh, camera, before, pose) < STAYED_PX:
            break
    many = observed(count, 400, pose)
    evidence = FinalEvidence(many, pose, reach).refined(rounds=8)
    tell(total, total)
    return Found(evidence, *(rivals[0] if rivals else (None, np.inf)))


def rough_poses(
    caster: RayCaster,
    photographs: Photographs,
    normals: NDArray | None,
    *,
    start: Pose | None,
    executor: Executor | None,
    tell: Callable[[int], None],
) -> list[FinalEvidence]:
    """Return distinct poses at low resolution, best first: all around, or near `start`; `tell`: how many are done."""
    size, outline_alone = longer_side(photographs.mask), not shading_tells(photographs.lights)
    coarse, reach = ObservedObject.of(caster, photographs, None, count=FEW, cells=40), REACH * size
    camera, mask = photographs.camera, photographs.mask
    starts = [start] if start else find_starts(caster, camera, mask, normals, count=STARTS)
    tell(1)
    rated = sorted((FinalEvidence(coarse, pose, reach) for pose in starts), key=unexplained)
    poses = []
    # An outline alone rates poses wrongly until they are refined.
    for pose in (executor.map if executor else map)(_roughly, rated if outline_alone else rated[:REFINED]):
        poses.append(pose)
        tell(1 + len(poses))
    least = max(NEAREST_PX, reach / 2**ROUGH_ROUNDS)
    rough = sorted((FinalEvidence(coarse, pose, least) for pose in poses), key=unexplained)
    kept: list[FinalEvidence] = []
    for one in rough:
        if all(apart_px(caster.mesh, camera, one.pose, other.pose) > reach / 2 for other in kept):
            kept.append(one)
    return kept


def unexplained(one: FinalEvidence) -> float:
    """Return the mean cost of the object's pixels and of the silhouette beyond them: 0 explained, 1 not at all."""
    cost = pixel_costs(one, USUAL_SIGMA)
    return float(np.nan_to_num(cost, nan=HIDDEN).mean()) + one.outline.beyond(one.seen.mask)


def best_of(found: list[FinalEvidence]) -> tuple[int, list[tuple[Pose, float]]]:
    """Return the number of the pose that explains the same photographs best, and the others, hardest to tell first.

    A pose within `APART_PX` of the best is the same.
    """
    best = 0
    for number in range(1, len(found)):
        if compare_poses(found[best], found[number]) < 0:
            best = number
    mesh, camera, pose = found[best].seen.caster.mesh, found[best].seen.camera, found[best].pose
    apart = [one for one in found if apart_px(mesh, camera, pose, one.pose) > APART_PX]
    rivals = [(one.pose, compare_poses(found[best], one)) for one in apart]
    return best, sorted(rivals, key=lambda rival: rival[1])


def _roughly(one: FinalEvidence) -> Pose:
    return one.refined(rounds=ROUGH_ROUNDS).pose


def pixel_costs(one: FinalEvidence, sigma: float) -> Array:
    """Return (P,) how badly the pose explains each pixel's samples, 0 to 1; NaN where it says nothing.

    A sample is predicted dark, too, where the scan turns from the light. Cast shadows say nothing: light falls
    through the holes of a scan.
    """
    (points, normals), samples = one.surface, one.seen.samples
    residuals, albedo, _ = explain(samples, one.used, normals, one.lit, one.look)
    dark = (cosines(one.lit.vectors, normals) < 0) & ~samples.clipped & np.isfinite(normals[:, 0])
    beside = samples.values / samples.scale - np.maximum(albedo * one.look.sent_back(normals), 0)
    relative = np.where(dark, beside, residuals) / (3 * sigma)
    counted = one.used | dark
    cost = (counted * relative**2 / (1 + relative**2)).sum(0) / np.maximum(counted.sum(0), 1)
    cost[one.used.sum(0) < FEWEST] = np.nan
    if not one.used.any():
        cost[np.isfinite(normals[:, 0])] = 0.0
    cost[~np.isfinite(points[:, 0])] = 1.0
    return cost


def compare_poses(one: FinalEvidence, two: FinalEvidence) -> float:
    """Return by how many standard deviations the first pose is better: same frames, mask, pixels, and one scale.

    Each lit sample is compared with what the scan predicts at the pixel's best albedo, and samples where the scan turns
    from the light with darkness; the cost is r^2 / (1 + r^2) in units of three times the smaller sigma of the two. The
    scatter of the differences is taken from their patches' median deviation: two poses of a nearly symmetric object
    differ in few patches, and those are the evidence, not the scatter.

    A pixel that looks into a hole of the scan at either pose is not compared: where the hole lies does not tell how the
    object stands. The pose whose hole it is is charged a little, since it may hide there what it does not explain.
    """
    sigma = min(one.shading_sigma, two.shading_sigma)
    first, second = pixel_costs(one, sigma), pixel_costs(two, sigma)
    pixels = one.seen.samples.pixels
    size = float(np.ptp(pixels, axis=0).max()) + 1
    _, block = np.unique(patches(pixels, size / BLOCKS), return_inverse=True)
    outside = [evidence.outline.beyond(evidence.seen.mask) for evidence in (one, two)]
    holes = [~np.isfinite(cost) for cost in (first, second)]
    difference = np.where(holes[0] | holes[1], HIDDEN * (holes[1] * 1.0 - holes[0]), second - first)
    sums = np.bincount(block, difference)
    scatter = spread(sums - np.median(sums)) * np.sqrt(len(sums)) / len(difference)
    return (float(difference.mean()) + outside[1] - outside[0]) / float(np.hypot(scatter, CHANCE))

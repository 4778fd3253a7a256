"""Hypothesis test of two poses on the same photographs: which explains them better, and is that more than chance?"""

from dataclasses import dataclass

import numpy as np

from align.pose.full_resolution import FinalEvidence, patches

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

"""Two poses, the same photographs: which explains them better, and is the difference more than chance?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.final import FinalEvidence

Array = NDArray[np.float64]

BLOCKS = 14
"""Patches across the object: residuals in one patch err together."""
CHANCE = 0.002
"""Difference of the mean cost that the mask's own errors make."""


@dataclass(frozen=True)
class Contest:
    """How two poses compare.

    Parameters
    ----------
    costs : tuple of float
        Mean cost a pixel of the first and the second: 0 explained, 1 not at all.
    deviations : float
        By how many standard deviations the first is better.
    """

    costs: tuple[float, float]
    deviations: float


def compare_poses(one: FinalEvidence, two: FinalEvidence) -> Contest:
    """Compare two poses on the same pixels, with one scale for both.

    Parameters
    ----------
    one, two : FinalEvidence
        Of the same frames, mask and samples.

    Notes
    -----
    Each pixel's samples, lit and in shadow, are compared with what the scan predicts at the pixel's best albedo; the
    cost is r^2 / (1 + r^2) in units of three times the smaller sigma of the two. Pixels that look into a hole of the
    scan at either pose say nothing. The scatter of the differences is taken from their patches' median deviation: two
    poses of a nearly symmetric object differ in few patches, and those are the evidence, not the scatter.
    """
    sigma = min(one.shading_sigma, two.shading_sigma)
    first, second = one.pixel_costs(sigma), two.pixel_costs(sigma)
    known = np.isfinite(first) & np.isfinite(second)
    if not known.any():
        return Contest((1.0, 1.0), 0.0)
    size = float(np.ptp(one.samples.pixels, axis=0).max()) + 1
    cell = (one.samples.pixels[known] / (size / BLOCKS)).astype(np.int64)
    _, block = np.unique(cell[:, 1] * 100_000 + cell[:, 0], return_inverse=True)
    sums = np.bincount(block, second[known] - first[known])
    spread = 1.4826 * float(np.median(np.abs(sums - np.median(sums)))) * np.sqrt(len(sums)) / known.sum()
    beyond = two.beyond_mask - one.beyond_mask
    gain = float(sums.sum()) / known.sum() + beyond
    costs = (float(first[known].mean()) + one.beyond_mask, float(second[known].mean()) + two.beyond_mask)
    return Contest(costs, float(gain / np.hypot(spread, CHANCE)))

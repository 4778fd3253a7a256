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
UNSEEN = 0.5
"""Cost of a pixel that looks into a hole of the scan: neither explained nor contradicted."""
OUTLINE_CHANCE = 0.05
"""Difference of the outline's share without an edge that is chance."""


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
    Each lit sample is compared with what the scan predicts at the pixel's best albedo, and samples where the scan turns
    from the light with darkness; the cost is r^2 / (1 + r^2) in units of three times the smaller sigma of the two. The
    scatter of the differences is taken from their patches' median deviation: two poses of a nearly symmetric object
    differ in few patches, and those are the evidence, not the scatter. The outline's share that has no edge in the
    photographs is held against a pose, too, in units of `OUTLINE_CHANCE`.

    A pixel that looks into a hole of the scan says nothing; but a pose may hide in a hole what it does not explain. So
    poses are compared twice, on the pixels that both explain and with holes at `UNSEEN`: both must agree.
    """
    sigma = min(one.shading_sigma, two.shading_sigma)
    first, second = one.pixel_costs(sigma), two.pixel_costs(sigma)
    known = np.isfinite(first) & np.isfinite(second)
    size = float(np.ptp(one.samples.pixels, axis=0).max()) + 1
    cell = (one.samples.pixels / (size / BLOCKS)).astype(np.int64)
    _, block = np.unique(cell[:, 1] * 100_000 + cell[:, 0], return_inverse=True)
    filled = tuple(np.where(np.isfinite(cost), cost, UNSEEN) for cost in (first, second))
    outside = [evidence.rim.beyond(evidence.mask) for evidence in (one, two)]
    beyond = outside[1] - outside[0]
    outline = (one.fit().outline_share - two.fit().outline_share) / OUTLINE_CHANCE
    both = [
        outline + _deviations(difference, block, beyond)
        for difference in (np.where(known, second - first, 0.0), filled[1] - filled[0])
    ]
    costs = (float(filled[0].mean()) + outside[0], float(filled[1].mean()) + outside[1])
    agree = both[0] * both[1] > 0
    return Contest(costs, float(np.sign(sum(both)) * (min(np.abs(both)) if agree else 1e-3)))


def _deviations(difference: Array, block: NDArray, beyond: float) -> float:
    sums = np.bincount(block, difference)
    spread = 1.4826 * float(np.median(np.abs(sums - np.median(sums)))) * np.sqrt(len(sums)) / len(difference)
    return (float(difference.mean()) + beyond) / float(np.hypot(spread, CHANCE))

"""Is the pose's stated doubt right: what half of the flashes and of the outline say alone, against the other half."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from align.pose.full_resolution import NEAREST_PX, FinalEvidence
from align.pose.photographed import FEWEST

ROUNDS = 2
"""Of each half's refinement, which begins where all evidence put the scan."""


class Halves(NamedTuple):
    """How far two poses lie apart, each of every second flash and of every second square of the picture's outline.

    Halves share no sample, but the scan, the camera, and what calibrating got wrong of all lights alike.
    """

    difference_deg: float
    stated_deg: float
    """The summed sigma of both."""
    difference_mm: float
    """Of the scan's middle."""
    stated_mm: float
    ratio: float
    """Of difference and stated sigma, rms over the pose's unknowns: above 1 the stated sigma is too small."""


def cross_validate(evidence: FinalEvidence) -> Halves | None:
    """Refine the pose on each half alone, and compare; None where half of the flashes tell no normal."""
    seen, pivot, scales = evidence.seen, evidence.view.pivot, evidence.steps(1.0)
    if seen.pictures is None or len(seen.lights) < 2 * FEWEST:
        return None
    poses, covariance = [], np.zeros((6, 6))
    for half in range(2):
        own = (np.arange(len(seen.lights)) % 2 == half)[:, None]
        samples = replace(seen.samples, usable=seen.samples.usable & own)
        asked = replace(seen, samples=samples, pictures=replace(seen.pictures, half=half))
        alone = FinalEvidence(asked, evidence.pose, NEAREST_PX).refined(rounds=ROUNDS)
        poses.append(alone.pose)
        covariance += alone.covariance()
    apart = poses[0] @ poses[1].inverse()
    twist = np.concatenate([Rotation.from_matrix(apart.rotation).as_rotvec(), apart.apply(pivot) - pivot])
    # An orthographic camera does not tell depth.
    told = scales > 0
    step, known = twist[told] / scales[told], (covariance[told][:, told] / scales[told]) / scales[told][:, None]
    ratio = np.sqrt(step @ np.linalg.pinv(known, hermitian=True) @ step / len(step))
    turn, shift = np.degrees(np.linalg.norm(twist[:3])), np.linalg.norm(twist[3:])
    stated = np.sqrt([np.trace(part) for part in (covariance[:3, :3], covariance[3:, 3:])])
    return Halves(*map(float, (turn, np.degrees(stated[0]), shift, stated[1], ratio)))

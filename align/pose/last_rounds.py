"""The last rounds: a pose refined on outline and shading until it stays."""

from align.pose.full_resolution import FinalEvidence
from align.pose.motion import apart_px
from align.pose.refine import descend, settle
from align.pose.rough import small_steps
from scene.pose import Pose

SETTLED_PX = 0.01
"""A round that moves the scan's image by less is the last."""
NEAREST_PX = 2.5
"""The outline's edges are looked for ever closer by, down to this."""


def refine(evidence: FinalEvidence, *, rounds: int, reach_px: float) -> tuple[Pose, FinalEvidence]:
    """Refine a pose; shadows, edges, scales and weights are renewed each round.

    Parameters
    ----------
    evidence : FinalEvidence
        At the start.
    rounds : int
        At most.
    reach_px : float
        How far off the start may be.

    Returns
    -------
    pose : Pose
    evidence : FinalEvidence
        At that pose.
    """
    mesh, camera, pose = evidence.caster.mesh, evidence.camera, evidence.pose
    for index in range(rounds):
        scales = small_steps(mesh, camera, pose, step_px=0.5)
        before = pose
        if index == 0:
            pose, _, _ = descend(evidence.terms, pose, lambda p: p.apply(mesh.center_mm), scales, steps=6)
        else:
            pose = settle(evidence.terms, pose, lambda p: p.apply(mesh.center_mm), scales, steps=4)
        evidence = evidence.renewed(pose, reach_px=max(NEAREST_PX, reach_px / 2 ** (index + 1)))
        if index and apart_px(mesh, camera, before, pose) < SETTLED_PX:
            break
    return pose, evidence

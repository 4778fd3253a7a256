"""Two poses against the same photographs."""

import numpy as np
import pytest

from align.contest import compare_poses
from align.embree import RayCaster
from align.final import FinalEvidence
from align.limb import LimbPictures
from align.motion import nudge
from align.shading import take_samples


@pytest.fixture(scope="module")
def evidence_at(world):
    caster = RayCaster(world.mesh)
    samples = take_samples(world.frames, world.lights, world.mask, count=1500)
    limbs = LimbPictures.of(world.frames, world.lights, world.mask)

    def at(pose):
        return FinalEvidence.of(
            caster, world.camera, world.lights, world.mask, limbs, samples, pose, cells=100, reach_px=6.0
        )

    return at


def test_the_true_pose_wins_from_either_side(world, evidence_at):
    true = evidence_at(world.pose)
    for degrees in (3, 20, 180):
        twist = [0, 0, np.radians(degrees), 0, 0, 0]
        other = evidence_at(nudge(world.pose, twist, world.pose.apply(world.mesh.center_mm)))
        won, lost = compare_poses(true, other), compare_poses(other, true)
        assert won.deviations > 4
        assert lost.deviations == pytest.approx(-won.deviations)
        assert won.costs == pytest.approx(lost.costs[::-1])
        assert won.costs[0] < won.costs[1]


def test_a_pose_does_not_differ_from_itself(world, evidence_at):
    true = evidence_at(world.pose)
    assert abs(compare_poses(true, true).deviations) < 0.01

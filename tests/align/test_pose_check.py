"""The check of a pose: silent at the best pose, loud beside it."""

import numpy as np
import pytest

from align.pose.motion import nudge, small_steps
from align.pose.pose_check import STEPS_PX, check_pose


@pytest.fixture(scope="module")
def best(world):
    """The best pose, as the truth's own refinement gives it, and its check."""
    return check_pose(world.mesh, world.pose, world.photographs)


def test_the_cost_is_lowest_at_the_true_pose_and_rises_on_both_sides(best):
    assert [row.axis[-1] for row in best.along] == ["x", "y", "z", "x", "y", "z"]
    for row in best.along:
        rising = row.cost[len(STEPS_PX) // 2 :]
        falling = row.cost[: len(STEPS_PX) // 2 + 1]
        assert (np.diff(rising) > 0).all(), row
        assert (np.diff(falling) < 0).all(), row
        assert abs(row.minimum_px) < 0.2
        assert 0 < row.sigma_px < 1


def test_refined_from_beside_it_the_pose_comes_back_and_the_residuals_with_it(best):
    assert min(best.started_px) > 3
    assert max(best.returned_px) < 0.3
    for before, after in zip(best.before, best.after, strict=True):
        assert after.outline_px < before.outline_px / 5
        assert after.shading < before.shading / 2
        assert after.normals_deg < before.normals_deg
        assert after.outline_px == pytest.approx(best.here.outline_px, abs=0.05)


@pytest.mark.full
@pytest.mark.parametrize("axis", [3])
def test_a_pose_that_is_not_the_best_is_found_out(world, axis):
    steps = small_steps(world.mesh, world.camera, world.pose, step_px=1.0)
    wrong = nudge(world.pose, np.eye(6)[axis] * steps, world.pose.apply(world.mesh.center_mm))
    found = check_pose(world.mesh, wrong, world.photographs)
    row = found.along[axis]
    assert STEPS_PX[int(np.argmin(row.cost))] == -1
    # The image moves by the step, or by a part of it where a turn's axis is near.
    assert np.ptp(found.returned_px) < 0.2
    assert 0.4 < np.mean(found.returned_px) < 1.3

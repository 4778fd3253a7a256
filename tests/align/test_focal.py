"""A focal length that is not known is part of the pose's uncertainty, and of the truth's."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose.photographed import Photographs
from align.pose.register import register
from align.truth import ground_truth
from scene.normals import angular_error_deg
from scene.pose import Pose

SIGMA = 0.04
RATIO = 1 + SIGMA


def deeper(pose, by):
    return Pose.from_rotation_translation(np.eye(3), [0, 0, by]) @ pose


def run(world, camera, lights, start):
    return register(world.mesh, Photographs(camera, world.frames, lights, world.mask), world.normals, start=start)


@pytest.fixture(scope="module")
def too_short(world):
    """The camera's focal length is one sigma too short, and everything stands nearer than it does by as much."""
    true = world.camera
    camera = replace(true, fx=true.fx / RATIO, fy=true.fy / RATIO, focal_sigma=SIGMA)
    nearer = np.array([0, 0, world.lights.reference_point_mm[2] * (1 / RATIO - 1)])
    lights = replace(
        world.lights,
        positions_mm=world.lights.positions_mm + nearer,
        reference_point_mm=world.lights.reference_point_mm + nearer,
    )
    middle = world.pose.apply(world.mesh.center_mm)
    return camera, lights, run(world, camera, lights, deeper(world.pose, middle[2] * (1 / RATIO - 1)))


def test_the_sigma_reaches_the_true_pose_with_the_focal_lengths_part(world, too_short):
    found = too_short[2]
    middle, true = found.pose.apply(world.mesh.center_mm), world.pose.apply(world.mesh.center_mm)
    gap = true - middle
    assert middle[2] == pytest.approx(true[2] / RATIO, rel=0.004)
    assert (found.pose.inverse() @ world.pose).angle_deg() < 0.15
    assert gap @ np.linalg.solve(found.covariance[3:, 3:], gap) > 100
    assert found.sigma_mm == pytest.approx(SIGMA * abs(middle[2]), rel=0.1)
    assert found.evidence["focal_shift_mm"] == found.focal_shift_mm == pytest.approx(np.linalg.norm(gap), rel=0.1)


def test_truth_turns_by_pose_and_camera_together(world, too_short):
    """Depth and focal length trade: taken for itself, the doubt of the depth would shift the picture by pixels."""
    camera, _, found = too_short
    with_part = ground_truth(world.mesh, found.pose, camera, covariance=found.covariance)
    without = ground_truth(world.mesh, found.pose, replace(camera, focal_sigma=0.0), covariance=found.covariance)
    farther = deeper(found.pose, SIGMA * found.pose.apply(world.mesh.center_mm)[2])
    there = ground_truth(world.mesh, farther, replace(camera, fx=camera.fx * RATIO, fy=camera.fy * RATIO))
    turned = np.sqrt(np.maximum(with_part.sigma_deg**2 - without.sigma_deg**2, 0))
    expected = angular_error_deg(with_part.normals, there.normals)
    both = np.isfinite(turned) & np.isfinite(expected)
    assert both.sum() > 500
    # Interpolated normals here, the same ones averaged over fine faces there.
    assert np.median(np.abs(turned - expected)[both]) < 0.1 * np.median(expected[both])
    depth = np.diag([0, 0, 0, 0, 0, found.focal_shift_mm**2])
    loose = ground_truth(world.mesh, found.pose, camera, covariance=found.covariance + depth)
    assert np.nanmedian(loose.sigma_deg) > 2 * np.nanmedian(with_part.sigma_deg)


def test_a_known_focal_length_adds_nothing(world):
    found = run(world, world.camera, world.lights, world.pose)
    assert found.focal_shift_mm == 0
    assert found.sigma_mm < 1
    assert not any(name.startswith("focal") for name in found.evidence)

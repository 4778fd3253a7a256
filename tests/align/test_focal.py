"""A focal length that is not known is part of the pose's uncertainty, and of the truth's."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from align.pose.photographed import Photographs
from align.pose.register import register
from align.pose.unknown_lengths import EXACT, register_longer
from align.truth import ground_truth
from scene.camera import Camera
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


def test_one_sigma_longer_is_the_true_camera_with_the_true_pose(world, too_short):
    camera, _, found = too_short
    longer = found.longer
    assert longer.camera.fx == pytest.approx(world.camera.fx)
    assert longer.camera.fy == pytest.approx(world.camera.fy)
    middle = world.pose.apply(world.mesh.center_mm)
    off = longer.pose.apply(world.mesh.center_mm) - middle
    assert np.abs(off[:2]).max() < 0.2
    assert abs(off[2]) < 0.003 * abs(middle[2])
    assert (longer.pose.inverse() @ world.pose).angle_deg() < 0.15
    # The camera in the registration is the one that was given, and 4 % of the depth are missing.
    seen = camera.project(found.pose.apply(world.mesh.vertices)) - world.camera.project(
        world.pose.apply(world.mesh.vertices)
    )
    assert np.sqrt(np.mean((seen**2).sum(1))) < 0.6
    assert found.pose.apply(world.mesh.center_mm)[2] == pytest.approx(middle[2] / RATIO, rel=0.004)


def test_the_covariance_reaches_the_true_pose_only_with_the_camera_s_part(world, too_short):
    found = too_short[2]
    middle = found.pose.apply(world.mesh.center_mm)
    gap = world.pose.apply(world.mesh.center_mm) - middle
    alone = (found.covariance - found.longer.covariance)[3:, 3:]
    assert gap @ np.linalg.solve(alone, gap) > 100
    assert gap @ np.linalg.solve(found.covariance[3:, 3:], gap) < 4
    assert found.sigma_mm == pytest.approx(SIGMA * abs(middle[2]), rel=0.1)
    assert found.evidence["focal_sigma"] == SIGMA
    assert found.evidence["focal_shift_mm"] == pytest.approx(np.linalg.norm(found.longer.twist[3:]))


def test_truth_turns_by_pose_and_camera_together(world, too_short):
    """Depth and focal length trade: taken for itself, the doubt of the depth would shift the picture by pixels."""
    camera, _, found = too_short
    known = {"covariance": found.covariance, "longer": found.longer}
    with_part = ground_truth(world.mesh, found.pose, camera, **known)
    own = found.covariance - found.longer.covariance
    without = ground_truth(world.mesh, found.pose, camera, covariance=own)
    loose = ground_truth(world.mesh, found.pose, camera, covariance=found.covariance)
    there = ground_truth(world.mesh, found.longer.pose, found.longer.camera)
    turned = np.sqrt(np.maximum(with_part.sigma_deg**2 - without.sigma_deg**2, 0))
    expected = angular_error_deg(with_part.normals, there.normals)
    both = np.isfinite(turned) & np.isfinite(expected)
    assert both.sum() > 500
    # Interpolated normals here, the same ones averaged over fine faces there.
    assert np.median(np.abs(turned - expected)[both]) < 0.1 * np.median(expected[both])
    assert np.nanmedian(loose.sigma_deg) > 2 * np.nanmedian(with_part.sigma_deg)


def test_a_known_focal_length_adds_nothing(world):
    found = run(world, replace(world.camera, focal_sigma=EXACT), world.lights, world.pose)
    assert found.longer is None
    assert found.sigma_mm < 1
    assert not any(name.startswith("focal") for name in found.evidence)


def test_an_orthographic_camera_has_no_depth_to_doubt():
    camera = Camera(160, 120, 0.6, 0.6, 80.0, 60.0, projection="orthographic", focal_sigma=0.05)
    assert register_longer(SimpleNamespace(seen=SimpleNamespace(camera=camera))) is None  # type: ignore[arg-type]

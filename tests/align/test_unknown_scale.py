"""A scan without a unit is as large as it must be at the distance of the lights' reference point."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose.motion import apart_px, nudge
from align.pose.register import register
from align.pose.scan_scale import register_unknown_scale, scaled_pose
from scene.camera import Camera
from scene.errors import AlignError


@pytest.fixture
def run(world):
    return lambda mesh, start: register(mesh, world.photographs, world.normals, start=start)


@pytest.mark.full
def test_the_scale_comes_out_of_the_distance(world, run):
    """In units of 25.4 mm, and 100 times too large in another frame."""
    for unit in (25.4, 0.01):
        small = replace(world.mesh, vertices=world.mesh.vertices / unit)
        mesh, found, scale = register_unknown_scale(small, world.photographs, run)
        # The reference point is where the object is; a third of a pixel of 30 is what edges leave open of the distance.
        assert scale == pytest.approx(unit, rel=1e-2)
        gap = world.camera.project(found.pose.apply(mesh.vertices)) - world.camera.project(
            world.pose.apply(world.mesh.vertices)
        )
        assert np.sqrt(np.mean((gap**2).sum(1))) < 0.15
        assert any("unit" in warning for warning in found.warnings)


@pytest.mark.full
def test_picks_in_the_files_unit_start_it(world, run, monkeypatch):
    """They were left aside, and then held against the pose in millimetres as if they lay far off."""
    monkeypatch.setattr("align.pose.search.find_starts", None)
    small = replace(world.mesh, vertices=world.mesh.vertices / 25.4)
    beside = nudge(world.pose, [0.02, -0.02, 0.03, 1.0, -1.0, 2.0], world.pose.apply(world.mesh.center_mm))
    picked = scaled_pose(beside, 1 / 25.4)
    mesh, found, scale = register_unknown_scale(small, world.photographs, run, start=picked)
    assert scale == pytest.approx(25.4, rel=1e-2)
    assert apart_px(mesh, world.camera, scaled_pose(picked, scale), found.pose) < 5


def test_an_orthographic_camera_cannot_tell(world):
    with pytest.raises(AlignError, match=r"orthographic.*scan_ball_diameter_mm"):
        photographs = replace(world.photographs, camera=Camera.orthographic(160, 120))
        register_unknown_scale(world.mesh, photographs, lambda *_: None)

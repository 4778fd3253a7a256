"""A scan that reaches into the table: the balls that stand on it tell."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose.unknown_lengths import on_table
from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.spheres import Sphere

CAMERA = Camera(900, 600, 2000.0, 2000.0, 449.5, 299.5)
UP = unit(np.array([0.1, 0.7, 1.0]))
OFFSET = -900.0
PLACES = ((-200, -150), (220, -100), (30, 180), (-150, 120), (200, 160))
RADII = (38.0, 30.0, 35.0, 20.0, 25.0)


def point(place, height):
    """A point of the camera frame so high over the table."""
    first = unit(np.cross(UP, [0.0, 0.0, 1.0]))
    return place[0] * first + place[1] * np.cross(UP, first) + (OFFSET + height) * UP


def ball(place, radius, *, lifted=0.0):
    center = point(place, radius + lifted)
    size = CAMERA.fx * radius / -center[2]
    return Sphere("chrome", CAMERA.project(center), size, 2 * radius, sigma_px=0.001 * size)


BALLS = [ball(place, radius) for place, radius in zip(PLACES, RADII, strict=True)]


@pytest.fixture(scope="module")
def standing():
    """A cone that stands on the table, its own frame elsewhere: the scan, and camera_from_scan."""
    import trimesh

    cone = trimesh.creation.cone(30.0, 60.0)
    first = unit(np.cross(UP, [0.0, 0.0, 1.0]))
    pose = Pose.from_rotation_translation(np.stack([first, np.cross(UP, first), UP], -1), point((20, 10), 0.0))
    return Mesh(np.array(cone.vertices), np.array(cone.faces, np.int64)), pose


def larger(mesh, pose, factor):
    """The same picture, `factor` times as far away."""
    there = Pose.from_rotation_translation(pose.rotation, factor * pose.translation)
    return replace(mesh, vertices=factor * mesh.vertices), there


def test_what_stands_on_the_table_lies_at_its_height(standing):
    found = on_table(*standing, BALLS, CAMERA)
    assert found.lowest_mm == pytest.approx(0, abs=1e-6)
    assert found.warning is None


@pytest.mark.parametrize("factor", [1.05, 25.4])
def test_a_scan_too_large_reaches_into_it_and_that_is_said(standing, factor):
    """A scan 5 % too large was registered 5 % too far away without a word: the picture is the same."""
    mesh, pose = larger(*standing, factor)
    found = on_table(mesh, pose, BALLS, CAMERA)
    assert found.lowest_mm == pytest.approx((factor - 1) * OFFSET, rel=1e-6)
    assert f"{-found.lowest_mm:.1f} mm under the table" in found.warning
    assert "scan_unit" in found.warning


def test_what_is_too_small_hangs_above_it_and_may(standing):
    found = on_table(*larger(*standing, 0.95), BALLS, CAMERA)
    assert found.lowest_mm == pytest.approx(-0.05 * OFFSET, rel=1e-6)
    assert found.warning is None


def test_three_balls_or_one_on_a_stand_tell_no_table(standing):
    assert on_table(*standing, BALLS[:3], CAMERA) is None
    assert on_table(*standing, [*BALLS[:4], ball(PLACES[4], RADII[4], lifted=40.0)], CAMERA) is None
    assert on_table(*standing, [*BALLS[:3], replace(BALLS[3], apart=True)], CAMERA) is None

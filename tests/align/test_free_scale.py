"""A scan of another size than the lights have it: told under near lights, and only there."""

from dataclasses import replace

import pytest

from align.pose.register import register
from scene.mesh import Mesh
from scene.pose import Pose


def registered(world, factor, lights=None):
    """The registration of a scan `factor` times too large, which then stands as many times as far away."""
    start = Pose.from_rotation_translation(world.pose.rotation, factor * world.pose.translation)
    mesh = Mesh(factor * world.mesh.vertices, world.mesh.faces)
    photographs = replace(world.photographs, lights=lights or world.lights)
    return register(mesh, photographs, world.normals, start=start)


def told(found):
    return [text for text in found.warnings if "diameter_mm" in text]


def test_a_right_scan_is_as_large_as_the_lights_have_it(world):
    found = registered(world, 1.0)
    assert found.evidence["scale"] == pytest.approx(1, abs=0.02)
    assert not told(found)


@pytest.mark.parametrize(
    ("factor", "scan", "balls"), [(1.1, "too large", "too small"), (0.9, "too small", "too large")]
)
def test_a_scan_a_tenth_too_large_or_small_is_named(world, factor, scan, balls):
    """It put the pose 100 mm off without a word: in one picture, a larger thing farther away looks the same."""
    found = registered(world, factor)
    assert found.evidence["scale"] * factor == pytest.approx(1, abs=0.06)
    (text,) = told(found)
    assert f"the scan is {scan} (scan_unit)" in text
    assert f"diameter_mm of all the balls is {balls}" in text


def test_distant_lights_tell_nothing_of_the_scale(world):
    found = registered(world, 1.0, replace(world.lights, positions_mm=None))
    assert "scale" not in found.evidence
    assert not told(found)

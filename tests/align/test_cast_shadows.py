"""A scan's scale by its shadow and the balls', on a table that neither touches."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose import cast_shadows
from align.pose.cast_shadows import ScanScale, shadow_scale
from align.pose.full_resolution import FinalEvidence, ObservedObject
from align.pose.register import register
from align.pose.scan_scale import scaled_pose
from align.pose.scan_view import View
from fixtures.mesh_scene import random_rotation
from fixtures.mesh_shapes import ball as mesh_of_ball
from scene.camera import Camera
from scene.mesh import Mesh
from scene.rays import RayCaster
from scene.spheres import Sphere
from tests.align.conftest import bumpy_mesh, make_world

RADIUS_MM = 12.0


@pytest.fixture(scope="module")
def beside_balls():
    """A scan's world, its photographs with three balls at unequal heights over the table."""
    camera, rotation = Camera(200, 150, 330.0, 330.0, 101.0, 73.0), random_rotation(np.random.default_rng(3))
    scan, ball = bumpy_mesh(4, subdivisions=4, radius_mm=24.0), mesh_of_ball(RADIUS_MM, 3)
    places = np.array([[-52.0, 24.0, -24.0], [50.0, 30.0, -12.0], [42.0, -44.0, -20.0]])
    vertices = [scan.vertices, *(ball.vertices + place @ rotation for place in places)]
    faces = [scan.faces, *(ball.faces + len(scan.vertices) + k * len(ball.vertices) for k in range(3))]
    world = make_world(Mesh(np.concatenate(vertices), np.concatenate(faces)), rotation, camera=camera, table=0.4)
    pose = world.pose
    centers = pose.apply(places @ rotation)
    spheres = tuple(
        Sphere("chrome", pixel, 330 * RADIUS_MM / -z, 2 * RADIUS_MM, 0.02)
        for pixel, z in zip(camera.project(centers), centers[:, 2], strict=True)
    )
    return replace(world, mesh=scan), spheres


def told(beside_balls, factor, monkeypatch, spheres=()):
    """What the shadows say of a scan `factor` times too large, which stands as many times as far away."""
    monkeypatch.setattr(cast_shadows, "SAMPLES", 350)
    world, own = beside_balls
    mask = View(RayCaster(world.mesh), world.camera, world.pose).silhouette()
    photographs = replace(world.photographs, mask=mask, spheres=spheres or own)
    caster = RayCaster(Mesh(factor * world.mesh.vertices, world.mesh.faces))
    seen = ObservedObject.of(caster, photographs, None, count=300, cells=40)
    return shadow_scale(FinalEvidence(seen, scaled_pose(world.pose, factor), 3.0), photographs)


@pytest.mark.parametrize("factor", [1.0, 1.05])
def test_a_scan_too_large_is_named_with_its_scale_and_a_right_one_is_not(beside_balls, factor, monkeypatch):
    found = told(beside_balls, factor, monkeypatch)
    assert found is not None
    assert abs(np.log(found.scale * factor)) < 4 * found.sigma < 0.02
    if factor == 1:
        assert found.warning is None
    else:
        assert found.warning is not None
        assert f"by its shadow on the table it is {1 / found.scale:.3f} times too large" in found.warning


def test_balls_of_unknown_size_tell_nothing(beside_balls, monkeypatch):
    unknown = tuple(replace(ball, diameter_mm=None) for ball in beside_balls[1])
    assert told(beside_balls, 1.0, monkeypatch, unknown) is None


@pytest.mark.parametrize(
    ("scale", "scan", "balls"), [(0.9, "too large", "too small"), (1.1, "too small", "too large"), (0.99, "", "")]
)
def test_which_length_may_be_wrong_is_said(scale, scan, balls):
    """A scan that must be smaller to cast its shadow is too large, or all the balls' diameters are too small."""
    told = ScanScale(scale, 0.002).warning
    if scan:
        assert f"the scan is {scan} (scan_unit)" in told
        assert f"diameter_mm of all the balls is {balls}" in told
    else:
        assert told is None


def test_a_registration_tells_the_scale(world, monkeypatch):
    shadow = ScanScale(0.9, 0.002)
    monkeypatch.setattr("align.pose.register.shadow_scale", lambda *seen: shadow)
    found = register(world.mesh, world.photographs, world.normals, start=world.pose)
    assert found.evidence["shadow_scale"] == 0.9
    assert shadow.warning in found.warnings

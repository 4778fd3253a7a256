"""What pixels see of the scan, and how it changes when the scan moves."""

import numpy as np
import pytest

from align.pose.motion import image_flow, nudge
from align.pose.scan_view import Probes
from scene.camera import Camera
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster


@pytest.fixture(scope="module")
def probed(world):
    caster = RayCaster(world.mesh)
    v, u = np.nonzero(world.mask)
    return caster, Probes.of(world.camera, np.stack([u, v], -1)[::4], step_px=0.5)


@pytest.mark.parametrize("axis", range(6))
def test_slopes_of_the_normals_are_what_moving_the_scan_shows(world, probed, axis):
    """Each sign and each axis: a turn the wrong way round, or a flow of the wrong sign, would correlate at -1 or 0."""
    caster, probes = probed
    points, normals = probes.surface(caster, world.pose)
    pivot = world.pose.apply(world.mesh.center_mm)
    slopes = probes.slopes(caster, world.pose, points, normals)[:, :, axis]
    twist = np.eye(6)[axis] * (1e-3 if axis < 3 else 0.1)
    after, before = (probes.surface(caster, nudge(world.pose, sign * twist, pivot))[1] for sign in (1, -1))
    real = (after - before) / (2 * twist[axis])
    known = np.isfinite(real).all(1) & (slopes != 0).any(1)
    assert known.mean() > 0.9
    assert np.corrcoef(real[known].ravel(), slopes[known].ravel())[0, 1] > 0.99
    assert np.median(np.abs(real[known] - slopes[known])) < 0.06 * np.median(np.abs(real[known]))


def test_the_flow_follows_the_points(world):
    camera = Camera(160, 120, 300.0, 310.0, 83.0, 57.0, distortion=(-0.1, 0.03, 0.001, -0.002, 0.0))
    points = world.pose.apply(world.mesh.vertices[::50])
    pivot = world.pose.apply(world.mesh.center_mm)
    twist = np.array([2e-4, -3e-4, 1e-4, 0.02, -0.03, 0.05])
    moved = nudge(Pose(np.eye(4)), twist, pivot).apply(points)
    expected = camera.project(moved) - camera.project(points)
    np.testing.assert_allclose(image_flow(camera, points, pivot) @ twist, expected, atol=2e-3 * np.abs(expected).max())


def test_through_a_hole_there_are_points_but_no_normals(world, probed):
    """The side that faces the camera is left out: what is seen is the other wall, from inside."""
    _, probes = probed
    mesh = world.mesh
    back = world.pose.rotate(mesh.face_normals)[:, 2] < 0
    points, normals = probes.surface(RayCaster(Mesh(mesh.vertices, mesh.faces[back])), world.pose)
    assert np.isfinite(points).all(1).mean() > 0.8
    assert np.isnan(normals[np.isfinite(points).all(1)]).mean() > 0.95

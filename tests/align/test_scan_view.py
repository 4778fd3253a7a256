"""What pixels see of the scan, and how it changes when the scan moves."""

from dataclasses import replace

import numpy as np
import pytest

from align.pose.motion import image_flow, nudge
from align.pose.scan_view import View, probe_rays, sample
from align.pose.shading import find_shadows
from scene.camera import Camera
from scene.mesh import Mesh
from scene.pose import Pose
from scene.rays import RayCaster


@pytest.fixture(scope="module")
def probed(world):
    v, u = np.nonzero(world.mask)
    return RayCaster(world.mesh), probe_rays(world.camera, np.stack([u, v], -1)[::4])


@pytest.mark.parametrize("axis", range(6))
def test_slopes_of_the_normals_are_what_moving_the_scan_shows(world, probed, axis):
    """Each sign and each axis: a turn the wrong way round, or a flow of the wrong sign, would correlate at -1 or 0."""
    caster, rays = probed
    here = View(caster, world.camera, world.pose)
    points, normals = here.surface(rays[0][0], rays[1][0])
    slopes = here.normal_slopes(rays, points, normals)[:, :, axis]
    twist = np.eye(6)[axis] * (1e-3 if axis < 3 else 0.1)
    moved = (replace(here, pose=nudge(world.pose, sign * twist, here.pivot)) for sign in (1, -1))
    after, before = (view.surface(rays[0][0], rays[1][0])[1] for view in moved)
    real = (after - before) / (2 * twist[axis])
    known = np.isfinite(real).all(1) & (slopes != 0).any(1)
    assert known.mean() > 0.9
    assert np.corrcoef(real[known].ravel(), slopes[known].ravel())[0, 1] > 0.99
    # Slopes are over a pixel to each side, which is coarse on so small a picture.
    assert np.median(np.abs(real[known] - slopes[known])) < 0.08 * np.median(np.abs(real[known]))


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
    origins, directions = probed[1]
    mesh = world.mesh
    back = world.pose.rotate(mesh.face_normals)[:, 2] < 0
    inside = View(RayCaster(Mesh(mesh.vertices, mesh.faces[back])), world.camera, world.pose)
    points, normals = inside.surface(origins[0], directions[0])
    assert np.isfinite(points).all(1).mean() > 0.8
    assert np.isnan(normals[np.isfinite(points).all(1)]).mean() > 0.95


def test_nothing_is_read_at_no_pixels():
    """An outline without any edge left the registration with the image library's own message."""
    image = np.arange(12, dtype=np.float32).reshape(3, 4)
    assert sample(image, np.zeros((0, 37, 2))).shape == (0, 37)
    np.testing.assert_allclose(sample(image, np.array([[0.5, 1.0], [3.0, 2.0]])), [4.5, 11.0])


def test_only_known_surface_is_asked_for_shadows(world, monkeypatch):
    """Points without a normal (the inside, through a hole) sent rays of NaN, a thousand times as slow as others."""
    pixels = np.argwhere(world.mask)[::7, ::-1].astype(float)
    view = View(RayCaster(world.mesh), world.camera, world.pose)
    points, normals = view.surface(*view.camera.rays(pixels))
    whole = find_shadows(view, world.lights, points, normals)
    assert 0.01 < whole.mean() < 0.5
    asked, blocked = [], RayCaster.blocked

    def listening(self, start, toward, far):
        asked.append(len(start))
        assert np.isfinite(start).all()
        return blocked(self, start, toward, far)

    monkeypatch.setattr(RayCaster, "blocked", listening)
    normals[::3] = np.nan
    points[1::5] = np.nan
    known = np.isfinite(normals[:, 0]) & np.isfinite(points[:, 0])
    found = find_shadows(view, world.lights, points, normals)
    assert set(asked) == {known.sum()}
    np.testing.assert_array_equal(found, whole & known)

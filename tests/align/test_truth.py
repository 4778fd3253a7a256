"""Ground truth against analytic spheres, and its laws."""

import numpy as np
import pytest

from align.truth import ground_truth
from fixtures.mesh_shapes import ball, over_grid
from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.spheres import Sphere

PERSPECTIVE = Camera(160, 120, 300.0, 300.0, 83.0, 57.0)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, (-0.2, 0.05, 0.002, -0.003, 0.0)])
def test_a_sphere_is_met_where_geometry_says(distortion):
    camera = Camera(160, 120, 300.0, 300.0, 83.0, 57.0, distortion)
    center = np.array([30.0, 20.0, -400.0])
    truth = ground_truth(ball(50.0), Pose.from_rotation_translation(np.eye(3), center), camera)
    sphere = Sphere("white", Camera.project(camera, center), camera.fx * 50 / 400, 100.0)
    # The ball's cone is exact for a pinhole: take its analytic normals through the same distorted rays.
    rays = camera.rays(camera.grid())[1]
    along = rays @ center
    square = along**2 - center @ center + 50.0**2
    points = rays * (along - np.sqrt(np.where(square > 0, square, np.nan)))[..., None]
    normals = (points - center) / 50
    known = np.isfinite(truth.normals[..., 0])
    # Facets of an icosphere of 5 subdivisions turn by 2 degrees; interpolation removes all but a trace.
    assert angular_error_deg(truth.normals, normals)[known].max() < 0.35
    assert np.abs(truth.depth_mm + points[..., 2])[known].max() < 0.1
    assert known.sum() > 0.9 * np.isfinite(points[..., 0]).sum()
    assert (truth.mask == np.isfinite(points[..., 0])).mean() > 0.998
    if not any(distortion):
        assert angular_error_deg(sphere.normals(camera, camera.grid())[0], normals)[known].max() < 1e-6
    # Axes: above the ball's middle the normals look up, right of it right.
    v, u = np.round(Camera.project(camera, center))[::-1].astype(int)
    assert truth.normals[v - 15, u, 1] > 0.2
    assert truth.normals[v, u + 15, 0] > 0.2
    assert truth.normals[v, u, 2] > 0.9


@pytest.mark.parametrize("z_mm", [-90, 0, 20, 500])
def test_orthographic_rays_are_parallel_wherever_the_scan_stands(z_mm):
    camera = Camera(160, 120, 1.5, 1.5, 83.0, 57.0, projection="orthographic")
    truth = ground_truth(ball(30.0), Pose.from_rotation_translation(np.eye(3), [5, -4, z_mm]), camera)
    u, v = camera.grid()[..., 0], camera.grid()[..., 1]
    x, y = (u - 83) / 1.5 - 5, -(v - 57) / 1.5 + 4
    z = np.sqrt(np.maximum(900 - x * x - y * y, 0))
    known = np.isfinite(truth.normals[..., 0])
    assert known.sum() > 0.9 * (z > 0).sum()
    assert angular_error_deg(truth.normals, np.stack([x, y, z], -1))[known].max() < 0.35


def test_the_tip_of_a_needle_is_in_the_truth():
    """One vertex of fifty thousand, far above all others: every row that sees the scan has its normals."""
    u, v = np.meshgrid(np.arange(250), np.arange(200))
    plane = over_grid(np.stack([u * 0.2 - 25, -v * 0.2 - 5, 0 * u], -1))
    needle = np.array([[-2.0, -5.0, 1.0], [0.0, 45.0, 1.0], [2.0, -5.0, 1.0]])
    mesh = Mesh(np.concatenate([plane.vertices, needle]), np.concatenate([plane.faces, [[50000, 50002, 50001]]]))
    assert len(mesh.vertices) // 20000 > 1
    truth = ground_truth(mesh, Pose.from_rotation_translation(np.eye(3), [0, 0, -400]), PERSPECTIVE)
    tip = PERSPECTIVE.project(np.array([0.0, 45.0, -399.0]))[1]
    assert np.flatnonzero(truth.mask.any(1)).min() <= tip + 12


def test_moving_the_scan_and_undoing_it_in_the_pose_changes_nothing(bumpy, rotations):
    pose = Pose.from_rotation_translation(rotations[0], [5, -3, -600])
    plain = ground_truth(bumpy, pose, PERSPECTIVE)
    # Far from the scan's origin: float32 alone would lose the surface's detail.
    motion = Pose.from_rotation_translation(rotations[1], [4000.0, -9000.0, 2500.0])
    moved = ground_truth(Mesh(motion.apply(bumpy.vertices), bumpy.faces), pose @ motion.inverse(), PERSPECTIVE)
    both = np.isfinite(plain.normals[..., 0]) & np.isfinite(moved.normals[..., 0])
    assert both.sum() > 0.995 * np.isfinite(plain.normals[..., 0]).sum()
    assert angular_error_deg(plain.normals, moved.normals)[both].max() < 0.05


def test_turning_scene_and_image_plane_together_turns_the_normals(bumpy, rotations):
    """A quarter turn about the viewing axis is a quarter turn of the picture."""
    camera = Camera(121, 121, 300.0, 300.0, 60.0, 60.0)
    pose = Pose.from_rotation_translation(rotations[0], [0, 0, -600])
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    plain = ground_truth(bumpy, pose, camera)
    turned = ground_truth(bumpy, Pose.from_rotation_translation(quarter, [0, 0, 0]) @ pose, camera)
    expected = np.rot90(plain.normals, 1) @ quarter.T
    both = np.isfinite(expected[..., 0]) & np.isfinite(turned.normals[..., 0])
    assert both.sum() > 0.99 * np.isfinite(expected[..., 0]).sum()
    assert angular_error_deg(expected, turned.normals)[both].max() < 0.05


def test_edges_holes_grazing_and_back_faces_are_unknown():
    grid = np.arange(-40, 41, 2.0)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    whole = over_grid(np.stack([x, y, 0 * x], -1))
    plane, faces = whole.vertices, whole.faces
    hole = (np.abs(plane[faces].mean(1)) < 5).all(1)
    # A second, smaller plane floats before the first: its border is a depth edge on both.
    faces = np.concatenate([faces[~hole], faces[hole] + len(plane)])
    vertices = np.concatenate([plane, plane * 1.0 + [20, 20, 10]])
    mesh = Mesh(vertices, faces)
    pose = Pose.from_rotation_translation(np.eye(3), [0, 0, -400])
    truth = ground_truth(mesh, pose, PERSPECTIVE)
    known = np.isfinite(truth.normals[..., 0])
    assert angular_error_deg(truth.normals[known], [0, 0, 1]).max() < 0.1
    seen = truth.mask
    depth = truth.depth_mm
    for axis in (0, 1):
        # Beyond the picture's last row the first one follows; neither shows anything.
        jump = ~(np.abs(depth - np.roll(depth, 1, axis)) < 5)
        assert not (known & (jump | np.roll(jump, -1, axis))).any()
    # In the hole nothing is seen, and its rim is unknown.
    v, u = np.round(PERSPECTIVE.project([0, 0, -400.0]))[::-1].astype(int)
    assert not seen[v, u]
    # From behind: seen, but unknown.
    behind = ground_truth(mesh, Pose.from_rotation_translation(np.diag([-1.0, 1, -1]), [0, 0, -400]), PERSPECTIVE)
    assert behind.mask.sum() > 1000
    assert not np.isfinite(behind.normals).any()
    # At 85 degrees: seen, but unknown.
    c, s = np.cos(np.radians(85)), np.sin(np.radians(85))
    tilted = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    grazing = ground_truth(mesh, Pose.from_rotation_translation(tilted, [0, 0, -400]), PERSPECTIVE)
    assert grazing.mask.any()
    assert not np.isfinite(grazing.normals).any()


@pytest.mark.full
def test_sigma_follows_pose_and_curvature(bumpy):
    """A shift of one sigma turns a sphere's normals by sigma / R; twice the sigma, twice the angle."""
    pose = Pose.from_rotation_translation(np.eye(3), [0, 0, -600])
    smooth = ball(40.0, 6)
    shift = np.diag([0, 0, 0, 0.5**2, 0, 0])
    sigma = ground_truth(smooth, pose, PERSPECTIVE, covariance=shift).sigma_deg
    v, u = np.round(PERSPECTIVE.project([0, 0, -560.0]))[::-1].astype(int)
    assert sigma[v, u] == pytest.approx(np.degrees(0.5 / 40), rel=0.1)
    double = ground_truth(smooth, pose, PERSPECTIVE, covariance=4 * shift).sigma_deg
    assert double[v, u] == pytest.approx(2 * sigma[v, u], rel=0.1)
    # Turning a sphere about its own middle shows nothing.
    turn = ground_truth(smooth, pose, PERSPECTIVE, covariance=np.diag([0.01**2, 0, 0, 0, 0, 0])).sigma_deg
    assert np.nanmedian(turn) < 0.1
    known = np.isfinite(sigma)
    assert (known == np.isfinite(ground_truth(smooth, pose, PERSPECTIVE).normals[..., 0])).all()


@pytest.mark.parametrize("noise_mm", [0.02, 0.1])
def test_scan_noise_is_measured_from_the_scan_and_taken_off(bumpy, noise_mm):
    generator = np.random.default_rng(10_002)
    noisy = Mesh(bumpy.vertices + noise_mm * generator.standard_normal(bumpy.vertices.shape), bumpy.faces)
    pose = Pose.from_rotation_translation(np.eye(3), [0, 0, -600])
    clean, dirty = (ground_truth(mesh, pose, PERSPECTIVE) for mesh in (bumpy, noisy))
    error = angular_error_deg(clean.normals, dirty.normals)
    known = np.isfinite(error)
    rms = np.sqrt(np.mean(error[known] ** 2))
    assert np.sqrt(np.mean(dirty.sigma_deg[known] ** 2)) == pytest.approx(rms, rel=0.5)
    assert 0.9 < (error < 2 * dirty.sigma_deg)[known].mean() <= 1
    # Each triangle with corners of its own has its own normal all over.
    apart = Mesh(noisy.vertices[noisy.faces].reshape(-1, 3), np.arange(noisy.faces.size).reshape(-1, 3))
    facets = np.repeat(noisy.face_normals, 3, axis=0), np.zeros(len(apart.vertices))
    plain = angular_error_deg(clean.normals, ground_truth(apart, pose, PERSPECTIVE, at_vertices=facets).normals)
    assert np.nanmedian(error) < 0.2 * np.nanmedian(plain)

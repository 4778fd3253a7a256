"""The mesh of a surface, as another library reads it."""

import numpy as np
import pytest

from scene.camera import Camera
from solve.surface.integration import surface_at
from solve.surface.surface_mesh import mesh_of

SIZE = 40
CAMERA = Camera(SIZE, SIZE, 90.0, 90.0, 18.0, 21.0)


@pytest.fixture
def stepped():
    """Two leaning plates, one 60 mm behind the other, and a hole of one pixel."""
    _, rays = CAMERA.rays(CAMERA.grid())
    normal = np.array([0.2, -0.3, 1.0])
    normal /= np.linalg.norm(normal)
    behind = np.arange(SIZE) >= 25
    along = np.where(behind, -660.0, -600.0) * normal[2] / (rays @ normal)
    points = rays * along[..., None]
    normals = np.broadcast_to(normal, points.shape).copy()
    points[8, 8], normals[8, 8] = np.nan, np.nan
    albedo = np.full(points.shape, 0.2)
    albedo[:20] *= [2, 1, 0.5]
    return points, normals, albedo


def test_the_file_opens_elsewhere_with_points_normals_and_colors(stepped, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    points, normals, albedo = stepped
    mesh = mesh_of(surface_at(points[..., 2], normals, CAMERA), normals, albedo, CAMERA)
    mesh.write(tmp_path / "surface.ply")
    read = trimesh.load(tmp_path / "surface.ply", process=False)
    known = np.isfinite(points[..., 2])
    np.testing.assert_allclose(read.vertices, points[known], rtol=1e-6)
    np.testing.assert_allclose(read.vertex_normals, normals[known], atol=1e-6)
    colors = np.asarray(read.visual.vertex_colors)[:, :3]
    assert (colors[0] > 0).all()
    assert colors[0, 0] > colors[0, 1] > colors[0, 2]
    assert (colors[-1] == colors[-1, 0]).all()
    # Counter-clockwise seen from the camera: every face looks to its side, and is the plane it lies in.
    np.testing.assert_allclose(read.face_normals, np.broadcast_to(normals[0, 0], (len(read.faces), 3)), atol=1e-3)


def test_no_face_bridges_a_step_or_a_hole_and_none_is_missing(stepped):
    points, normals, albedo = stepped
    mesh = mesh_of(surface_at(points[..., 2], normals, CAMERA), normals, albedo, CAMERA)
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max()
    assert longest < 2 * 1.5 * 660 / 90
    whole = 2 * (SIZE - 1) * (SIZE - 2)
    # The hole takes eight triangles away and leaves four corners cut off.
    assert len(mesh.faces) == whole - 8 + 4
    assert len(np.unique(np.sort(mesh.faces, 1), axis=0)) == len(mesh.faces)

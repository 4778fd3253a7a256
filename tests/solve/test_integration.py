"""Integration against surfaces that the test made: exact where it should be, torn where it must be; its mesh."""

import numpy as np
import pytest

from fixtures.lit_surfaces import ball_seen
from scene.camera import Camera
from scene.errors import SceneError
from solve.surface import integration
from solve.surface.grid_laplacian import solve_grid
from solve.surface.integration import integrate, surface_at
from solve.surface.surface_mesh import mesh_of, write_surface

SIZE = 60
PERSPECTIVE = Camera(SIZE, SIZE, 110.0, 110.0, 27.0, 33.5, (-0.06, 0.02, 0.001, -0.002, 0.0))
WHOLE = np.ones((SIZE, SIZE), bool)
ORTHOGRAPHIC = Camera(SIZE, SIZE, 2.0, 2.0, 27.0, 33.5, projection="orthographic")


def plane(camera, normal, z_mm=-600.0):
    """Points of the plane through (0, 0, z) and its unit normal."""
    normal = np.asarray(normal, float) / np.linalg.norm(normal)
    base, rays = camera.rays(camera.grid())
    along = ((np.array([0, 0, z_mm]) - base) @ normal) / (rays @ normal)
    return base + rays * along[..., None], np.broadcast_to(normal, base.shape)


def integrated(points, normals, mask=WHOLE, camera=PERSPECTIVE):
    """What is integrated from the normals, with the points' median depth."""
    return integrate(np.where(mask[..., None], normals, np.nan), camera, z_mm=float(np.median(points[mask][:, 2])))


@pytest.mark.parametrize("camera", [PERSPECTIVE, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("normal", [(0.5, 0, 1), (-0.5, 0, 1), (0, 0.5, 1), (0, -0.5, 1), (0.7, -0.4, 1)])
def test_a_plane_is_exact_whichever_way_it_leans(camera, normal):
    points, normals = plane(camera, normal)
    mask = WHOLE.copy()
    mask[10:20, 25:35] = False
    surface = integrated(points, normals, mask, camera)
    np.testing.assert_allclose(surface.z_mm[mask], points[mask][:, 2], atol=1e-3)
    np.testing.assert_allclose(surface.points_mm(camera)[mask], points[mask], atol=1e-3)
    assert np.isnan(surface.z_mm[~mask]).all()
    assert surface.torn_share() == 0


@pytest.mark.parametrize(("camera", "radius_mm", "atol"), [(PERSPECTIVE, 90.0, 1e-2), (ORTHOGRAPHIC, 11.0, 1e-3)])
def test_a_ball_is_exact_to_its_limb_and_weighing_the_sides_spoils_only_the_limb(camera, radius_mm, atol, monkeypatch):
    points, normals, mask = ball_seen(camera, (0.0, 0.0, -600.0), radius_mm, rim=0.2)
    with monkeypatch.context() as patch:
        patch.setattr(integration, "SHARPNESS", 0.0)
        plain = integrated(points, normals, mask, camera)
    np.testing.assert_allclose(plain.z_mm[mask], points[mask][:, 2], atol=atol)
    weighed = integrated(points, normals, mask, camera).z_mm - points[..., 2]
    inner = mask & (normals[..., 2] > 0.7)
    assert np.abs(weighed[inner]).max() < 1e-3 * radius_mm
    assert np.abs(weighed[mask]).max() < 1e-2 * radius_mm


def flap():
    """A plate whose right half is bent away from a hinge on: beside it the depth jumps, more and more."""
    flat, up = plane(PERSPECTIVE, (0, 0, 1))
    bent, lean = plane(PERSPECTIVE, (0, 0.5, 1))
    turn = (np.arange(SIZE) > SIZE // 2)[None] & (flat[..., 1] > 0)
    return np.where(turn[..., None], bent, flat), np.where(turn[..., None], lean, up), turn


def test_an_edge_of_depth_is_torn_and_its_sides_stay_what_they_are(monkeypatch):
    points, normals, turn = flap()
    found, jump = integrated(points, normals), np.ptp(points[..., 2])
    sharp = found.z_mm - points[..., 2]
    with monkeypatch.context() as patch:
        patch.setattr(integration, "SHARPNESS", 0.0)
        smooth = integrated(points, normals).z_mm - points[..., 2]
    assert np.abs(smooth).max() > 0.2 * jump
    assert np.abs(sharp).max() < 0.05 * jump
    torn = np.isfinite(found.gap_right) & (found.gap_right > 2)
    assert set(np.nonzero(torn)[1]) == {SIZE // 2}
    assert torn.sum() > 0.6 * turn[:, -1].sum()


def test_a_step_keeps_its_height_free():
    """Two level plates: no normal tells the step; a hint does, and moves nothing else."""
    _, normals = plane(PERSPECTIVE, (0, 0, 1))
    left = np.zeros((SIZE, SIZE), bool)
    left[:, : SIZE // 2] = True
    z_mm = np.where(left, -600.0, -640.0)
    noisy = z_mm + 5.0 * np.random.default_rng(0).standard_normal(z_mm.shape)
    surface = integrate(normals, PERSPECTIVE, z_mm=-620.0, hint=(noisy, np.full(z_mm.shape, 0.02)))
    assert abs(np.median(surface.z_mm[left]) + 600) < 1.5
    assert abs(np.median(surface.z_mm[~left]) + 640) < 1.5
    # A plate's relief is the hint's noise, much reduced.
    assert np.std(surface.z_mm[:, 5 : SIZE // 2 - 5]) < 0.2 * 5.0


def test_faults_are_named():
    normals = np.full((SIZE, SIZE, 3), np.nan)
    with pytest.raises(SceneError, match="no pixel"):
        integrate(normals, PERSPECTIVE, z_mm=-600.0)
    normals[:] = [0, 0, 1]
    with pytest.raises(SceneError, match="in front of the camera"):
        integrate(normals, PERSPECTIVE, z_mm=0.0)


def test_the_grid_solver_solves_its_equations_with_uneven_weights_and_cuts():
    rng = np.random.default_rng(0)
    right, down = rng.uniform(0.01, 1, (2, 70, 51))
    right[:, 20] = 1e-20
    right[:, -1], down[-1] = 0, 0
    shift = np.full((70, 51), 1e-9)
    x = rng.standard_normal((70, 51)).cumsum(0)
    rhs = shift * x
    for weight, axis in ((right[:, :-1], 1), (down[:-1], 0)):
        flow = weight * np.diff(x, axis=axis)
        pad = [(0, 0), (0, 0)]
        pad[axis] = (1, 1)
        rhs -= np.diff(np.pad(flow, pad), axis=axis)
    found = solve_grid(right, down, shift, rhs, np.zeros_like(x), tolerance=1e-10)
    gap = found - x
    for side in (gap[:, :21], gap[:, 21:]):
        assert np.ptp(side) < 1e-6


SIDE = 40
CAMERA = Camera(SIDE, SIDE, 90.0, 90.0, 18.0, 21.0)


@pytest.fixture(scope="module")
def stepped():
    """(points, normals, mesh) of two leaning plates, one 60 mm behind the other, and a hole of one pixel."""
    _, rays = CAMERA.rays(CAMERA.grid())
    normal = np.array([0.2, -0.3, 1.0])
    normal /= np.linalg.norm(normal)
    behind = np.arange(SIDE) >= 25
    along = np.where(behind, -660.0, -600.0) * normal[2] / (rays @ normal)
    points = rays * along[..., None]
    normals = np.broadcast_to(normal, points.shape).copy()
    points[8, 8], normals[8, 8] = np.nan, np.nan
    albedo = np.full(points.shape, 0.2)
    albedo[:20] *= [2, 1, 0.5]
    return points, normals, mesh_of(surface_at(points[..., 2], normals, CAMERA), normals, albedo, CAMERA)


def test_the_file_opens_elsewhere_with_points_normals_and_colors(stepped, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    points, normals, mesh = stepped
    write_surface(tmp_path / "surface.ply", mesh)
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
    mesh = stepped[2]
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max()
    assert longest < 2 * 1.5 * 660 / 90
    whole = 2 * (SIDE - 1) * (SIDE - 2)
    # The hole takes eight triangles away and leaves four corners cut off.
    assert len(mesh.faces) == whole - 8 + 4
    assert len(np.unique(np.sort(mesh.faces, 1), axis=0)) == len(mesh.faces)

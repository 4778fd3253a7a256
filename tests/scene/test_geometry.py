"""Laws of poses, meshes, spheres, lights and normals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fixtures.lit_surfaces import flashes_at
from scene.camera import Camera
from scene.mesh import Mesh
from scene.normals import angular_error_deg, unit
from scene.pose import Pose, rotation_from_vector
from scene.spheres import Sphere

number = st.floats(-3, 3)
twists = st.tuples(number, number, number, number, number, number)


@given(twists, twists, twists)
def test_poses_are_a_group(a, b, c):
    a, b, c = (Pose.from_rotation_translation(rotation_from_vector(one[:3]), one[3:]) for one in (a, b, c))
    np.testing.assert_allclose((a @ a.inverse()).matrix, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(((a @ b) @ c).matrix, (a @ (b @ c)).matrix, atol=1e-12)
    assert np.linalg.det(a.rotation) == pytest.approx(1)
    point = np.array([1.0, -2, 3])
    np.testing.assert_allclose((a @ b).apply(point), a.apply(b.apply(point)), atol=1e-12)
    np.testing.assert_allclose(a.rotate(point), a.apply(point) - a.apply([0, 0, 0]), atol=1e-12)


def test_mesh_normals_point_out_of_a_counter_clockwise_face():
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    np.testing.assert_array_equal(mesh.face_normals, [[0, 0, 1]])
    np.testing.assert_array_equal(mesh.vertex_normals, [[0, 0, 1]] * 3)


@given(st.integers(0, 10_000))
def test_angular_error_is_exact_for_small_and_large_angles(seed):
    rng = np.random.default_rng(seed)
    a = unit(rng.normal(size=3))
    side = unit(np.cross(a, rng.normal(size=3)))
    for angle in (1e-7, 1e-3, 30.0, 179.9999):
        b = np.cos(np.radians(angle)) * a + np.sin(np.radians(angle)) * side
        assert angular_error_deg(a, b) == pytest.approx(angle, rel=1e-6)


CAMERA = Camera(960, 640, 1333.0, 1333.0, 486.8, 314.9)


def test_sphere_cone_is_exact_under_perspective():
    """A ball far off axis: its outline's rays touch the sphere, and centre and radius come back."""
    center = np.array([-267.0, -155.0, -985.0])
    sphere = Sphere("chrome", CAMERA.project(center), CAMERA.fx * 38 / 985, 76.0)
    np.testing.assert_allclose(sphere.center_mm(CAMERA), center, atol=1e-9)
    _, rays = CAMERA.rays(sphere.outline(CAMERA))
    distance = np.linalg.norm(np.cross(rays, center), axis=-1)
    np.testing.assert_allclose(distance, 38.0, atol=1e-9)
    # Each point lies in the middle of its share of the turn: what is read at 72 and at 864 points is not turned.
    few, many = (sphere.outline(CAMERA, count) for count in (72, 864))
    np.testing.assert_allclose(many.reshape(72, 12, 2).mean(1), few, atol=0.002 * sphere.radius_px)


@pytest.mark.parametrize("camera", [CAMERA, Camera.orthographic(960, 640)])
def test_sphere_normals(camera):
    sphere = Sphere("white", np.array([300.0, 200.0]), 60.0, 70.0)
    pixels = sphere.center_px + [[0, 0], [30, 0], [0, -30], [61.5, 0]]
    normals, points = sphere.normals(camera, pixels)
    np.testing.assert_allclose(np.linalg.norm(normals[:3], axis=1), 1, atol=1e-12)
    assert normals[1, 0] > normals[0, 0] + 0.3
    assert normals[2, 1] > normals[0, 1] + 0.3
    assert np.isnan(normals[3]).all()
    np.testing.assert_allclose(np.linalg.norm(points[:3] - sphere.center_mm(camera), axis=1), 35, atol=1e-9)
    if not camera.is_orthographic:
        np.testing.assert_allclose(camera.project(points[:3]), pixels[:3], atol=1e-6)


def near_lights():
    positions = np.array([[300.0, 0, -400], [0, 300, -400], [-200, -200, -300], [0, 0, -100]])
    reference = np.array([0.0, 0, -1000])
    return flashes_at(positions, reference, np.random.default_rng(0).uniform(0.5, 1.5, (4, 3))).normalised()


def test_near_light_is_itself_at_the_reference_and_falls_off_by_the_square():
    lights = near_lights()
    at = lights.at(lights.reference_point_mm[None])[:, 0]
    np.testing.assert_allclose(at, lights.intensities[..., None] * lights.directions[:, None], atol=1e-12)
    middle = (lights.positions_mm[0] + lights.reference_point_mm) / 2
    assert np.linalg.norm(lights.toward(middle[None])[0]) == pytest.approx(4)


def test_seen_from_elsewhere_lights_the_scene_alike():
    lights = near_lights()
    points = np.random.default_rng(1).uniform([-80, -80, -1050], [80, 80, -950], (20, 3))
    moved = lights.seen_from([30.0, -20, -980])
    ratio = np.linalg.norm(moved.at(points), axis=-1) / np.linalg.norm(lights.at(points), axis=-1)
    np.testing.assert_allclose(ratio, np.broadcast_to(ratio[0, 0], ratio.shape), rtol=1e-9)
    np.testing.assert_allclose(moved.intensities.mean(0), 1)
    np.testing.assert_allclose(moved.seen_from(lights.reference_point_mm).intensities, lights.intensities)

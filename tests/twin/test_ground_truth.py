"""The true maps of a scene: closed forms, and shadows that fall where they must."""

from dataclasses import fields, replace

import numpy as np
import pytest

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from twin.description.description import TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, Measured, Principled, RoughPlastic, Texture
from twin.description.object_mesh import built_in
from twin.engines.film import film_for
from twin.ground_truth import ground_truth, lights_of, save_ground_truth

MIDDLE = np.array([-4.0, 6.0, -300.0])
CAMERA = Camera(96, 80, 150.0, 150.0, 53.4, 35.2)
FLAT = Camera(96, 80, 0.6, 0.6, 53.4, 35.2, projection="orthographic")
LENS = replace(CAMERA, distortion=(-0.2, 0.05, 0.004, -0.003, 0.0))


def placed(scale, at):
    matrix = np.diag([*np.broadcast_to(scale, 3), 1.0])
    matrix[:3, 3] = at
    return matrix


def lights(vectors, near=False):
    vectors = np.atleast_2d(np.array(vectors, float))
    names = tuple(f"flash_{i}" for i in range(len(vectors)))
    return Lights(names, unit(vectors), np.ones((len(vectors), 3)), MIDDLE + vectors if near else None, MIDDLE)


def scene(*objects, camera=CAMERA, given=None, **materials):
    materials = materials or {"m": Diffuse((0.2, 0.4, 0.6))}
    return TwinScene(camera, objects, materials, lights([0, 0, 1]) if given is None else given)


def ball_truth(camera, radius, center):
    origins, rays = camera.rays(camera.grid())
    offset = origins - center
    along = np.sum(rays * offset, -1)
    square = along**2 - np.sum(offset**2, -1) + radius**2
    points = origins + rays * (-along - np.sqrt(np.where(square > 0, square, np.nan)))[..., None]
    return (points - center) / radius, points


@pytest.mark.parametrize("camera", [CAMERA, FLAT, LENS], ids=["perspective", "orthographic", "lens"])
@pytest.mark.parametrize("mirrored", [1, -1])
def test_a_ball_has_its_closed_form(camera, mirrored):
    vectors = unit(np.random.default_rng(10004).normal(size=(11, 3)) + [0, 0, 0.8])
    for near in (False, True):
        given = lights(vectors * 200 if near else vectors, near)
        ball = TwinObject("ball", built_in("sphere"), "m", placed([60 * mirrored, 60, 60], MIDDLE))
        truth = ground_truth(scene(ball, camera=camera, given=given))
        normals, points = ball_truth(camera, 60.0, MIDDLE)
        seen = np.isfinite(normals[..., 0])
        assert (truth.mask != seen).mean() < 0.005
        inside = truth.mask & (np.nan_to_num(-np.sum(normals * camera.rays(camera.grid())[1], -1)) > 0.2)
        assert angular_error_deg(truth.normals[inside], normals[inside]).max() < 0.2
        assert np.abs(truth.z_mm - points[..., 2])[inside].max() < 0.1
        assert np.nanmin(truth.height_mm) == 0
        assert np.allclose((truth.height_mm - truth.z_mm)[truth.mask], -np.nanmin(truth.z_mm))
        shading = np.einsum("npx,px->np", given.toward(points[inside]), normals[inside])
        attached = lights_of(truth.attached, 11)[:, inside]
        clear = np.abs(shading) > 0.04 * np.linalg.norm(given.toward(points[inside]), axis=-1)
        assert np.array_equal(attached[clear], (shading < 0)[clear])
        # A convex body throws no shadow on itself.
        assert not lights_of(truth.cast, 11)[:, inside][clear].any()
        assert (truth.object[truth.mask] == 0).all()
        assert np.isnan(truth.normals[~truth.mask]).all()
        assert not truth.attached[~truth.mask].any()


def test_a_light_behind_a_wall_is_hidden_and_one_before_it_is_not():
    """What stands beyond a near light throws no shadow back."""
    wall = TwinObject("wall", built_in("square"), "m", placed(30, MIDDLE))
    roof = TwinObject("roof", built_in("square"), "m", placed(10, MIDDLE + [0, 60.0, 80]))
    before, beyond = np.array([0, 30.0, 40]), np.array([0, 90.0, 120])
    truth = ground_truth(scene(wall, roof, given=lights([before, beyond], near=True)))
    u, v = np.round(CAMERA.project(MIDDLE)).astype(int)
    assert truth.object[v, u] == 0
    assert list(lights_of(truth.cast, 2)[:, v, u]) == [False, True]


def test_materials_show_in_the_maps_in_the_pixels_unit():
    values = np.zeros((2, 2, 3), np.float32)
    values[0, 0], values[1, 1] = [0.9, 0.3, 0.1], [0.2, 0.4, 0.8]
    square = built_in("square")
    materials = {
        "picture": RoughPlastic(Texture(values, "clamp"), 0.3, 0.8),
        "metal": Conductor("Au", 0.2),
        "disney": Principled((0.5, 0.4, 0.2), 0.15, 0.25, 0.6),
        "measured": Measured(None),
        "matte": Diffuse((0.1, 0.2, 0.3)),
    }
    places = [[-60.0, 0], [-30, 0], [0, 0], [30, 0], [60, 0]]
    objects = [
        TwinObject(name, square, name, placed(12, [x, y, -300.0]))
        for name, (x, y) in zip(materials, places, strict=True)
    ]
    given = scene(*objects, **materials)
    white = np.array([0.4, 0.8, 1.6])
    given = replace(given, lights=replace(given.lights, white_value=white))
    truth = ground_truth(given)
    expected = [
        (None, 0.3, 0.8),
        ([0, 0, 0], 0.2, 1),
        ([0.375, 0.3, 0.15], 0.15, 0.6),
        ([np.nan] * 3, np.nan, np.nan),
        ([0.1, 0.2, 0.3], 1, 0),
    ]
    for number, (albedo, roughness, specularity) in enumerate(expected):
        here = truth.object == number
        assert here.sum() > 50
        if albedo is not None:
            wanted = np.array(albedo) * white / 0.8
            assert np.allclose(truth.albedo[here], wanted, equal_nan=True)
        assert np.allclose(truth.roughness[here], roughness, equal_nan=True)
        assert np.allclose(truth.specularity[here], specularity, equal_nan=True)
    for shift, value in ((-8.0, values[0, 0]), (8.0, values[1, 1])):
        u, v = np.round(CAMERA.project([-60 + shift, -shift, -300.0])).astype(int)
        assert np.allclose(truth.albedo[v, u], value * white / 0.8, rtol=1e-3, atol=0.02)


@pytest.mark.parametrize("camera", [CAMERA, FLAT, LENS], ids=["perspective", "orthographic", "lens"])
def test_maps_made_on_disk_are_those_made_in_memory(camera, tmp_path):
    """Byte for byte, so that a picture's size need not fit in memory."""
    ball = TwinObject("ball", built_in("sphere"), "m", placed(40, MIDDLE))
    given = scene(ball, camera=camera, given=lights([[0, 0.3, 1], [2, 0, 0.1]]))
    save_ground_truth(ground_truth(given), tmp_path / "memory")
    mapped = ground_truth(given, folder=tmp_path / "disk")
    assert all(isinstance(getattr(mapped, field.name), np.memmap) for field in fields(mapped))
    names = {path.name for path in (tmp_path / "memory").iterdir()}
    assert names == {path.name for path in (tmp_path / "disk").iterdir()}
    for name in names:
        assert (tmp_path / "memory" / name).read_bytes() == (tmp_path / "disk" / name).read_bytes(), name


def test_a_lens_is_undistorted_alike_in_bands(monkeypatch):
    monkeypatch.setattr("twin.engines.film.ROWS", 7)
    points = ball_truth(LENS, 40, MIDDLE)[1]
    points = points[np.isfinite(points[..., 0])]
    banded = film_for(LENS, points)
    monkeypatch.setattr("twin.engines.film.ROWS", 10_000)
    whole = film_for(LENS, points)
    assert banded.size[0] > 7
    assert banded.rendered == whole.rendered
    assert np.array_equal(banded.pixels, whole.pixels)


def test_normals_of_a_squeezed_and_turned_ball_are_an_ellipsoids():
    rng = np.random.default_rng(10005)
    linear = (
        np.linalg.qr(rng.normal(size=(3, 3)))[0] @ np.diag([30.0, 50, 40]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    )
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, MIDDLE
    truth = ground_truth(scene(TwinObject("egg", built_in("sphere"), "m", matrix)))
    points = CAMERA.rays(CAMERA.grid())[1]
    points = points * (truth.z_mm / points[..., 2])[..., None]
    inverse = np.linalg.inv(linear)
    gradient = unit((points - MIDDLE) @ inverse.T @ inverse)
    inside = truth.mask & (-np.sum(np.nan_to_num(gradient) * unit(points), -1) > 0.2)
    assert inside.sum() > 800
    assert angular_error_deg(truth.normals[inside], gradient[inside]).max() < 0.5


def test_what_is_seen_from_behind_faces_the_viewer():
    back = placed([20, 20, -20], MIDDLE)
    back[:3, :3] = np.diag([-20.0, 20, -20])
    given = lights([[0.3, 0, 1], [0.3, 0, -1]])
    truth = ground_truth(scene(TwinObject("back", built_in("square"), "m", back), given=given))
    assert np.allclose(truth.normals[truth.mask], [0, 0, 1], atol=1e-6)
    attached = lights_of(truth.attached, 2)[:, truth.mask]
    assert not attached[0].any()
    assert attached[1].all()

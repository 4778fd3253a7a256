"""The true maps of a scene: closed forms, and shadows that fall where they must."""

from dataclasses import fields, replace

import numpy as np
import pytest

from fixtures.lit_surfaces import ball_seen
from scene.camera import Camera
from scene.normals import angular_error_deg, unit
from tests.twin.twin_scenes import MIDDLE, lights, placed
from twin.description.description import TwinScene
from twin.description.materials import Conductor, Diffuse, Measured, Principled, RoughPlastic, Texture
from twin.engines.film import film_for
from twin.ground_truth import ground_truth, lights_of, save_ground_truth

CAMERA = Camera(96, 80, 150.0, 150.0, 53.4, 35.2)
LENS = replace(CAMERA, distortion=(-0.2, 0.05, 0.004, -0.003, 0.0))
CAMERAS = {"perspective": CAMERA, "lens": LENS,
           "orthographic": replace(CAMERA, fx=0.6, fy=0.6, projection="orthographic")}  # fmt: skip
OFF = np.array([-4.0, 6.0, 0.0])


def scene(*objects, camera=CAMERA, given=None, **materials):
    materials = materials or {"m": Diffuse((0.2, 0.4, 0.6))}
    return TwinScene(camera, objects, materials, lights([0, 0, 1]) if given is None else given)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@pytest.mark.parametrize("mirrored", [1, -1])
def test_a_ball_has_its_closed_form(camera, mirrored):
    vectors = unit(np.random.default_rng(10004).normal(size=(11, 3)) + [0, 0, 0.8])
    points, normals, seen = ball_seen(camera, MIDDLE + OFF, 60.0, rim=0)
    for near in (False, True):
        given = lights(*vectors * 200, near=near, middle=MIDDLE + OFF)
        ball = placed("ball", "sphere", "m", np.array([60 * mirrored, 60, 60]) * np.eye(3), OFF)
        truth = ground_truth(scene(ball, camera=camera, given=given))
        assert (truth.mask != seen).mean() < 0.005
        inside = truth.mask & seen & (-np.sum(normals * camera.rays(camera.grid())[1], -1) > 0.2)
        assert angular_error_deg(truth.normals[inside], normals[inside]).max() < 0.2
        assert np.abs(truth.z_mm - points[..., 2])[inside].max() < 0.1
        assert np.allclose((truth.height_mm - truth.z_mm)[truth.mask], -np.nanmin(truth.z_mm))
        shading = np.einsum("npx,px->np", given.toward(points[inside]), normals[inside])
        clear = np.abs(shading) > 0.04 * np.linalg.norm(given.toward(points[inside]), axis=-1)
        assert np.array_equal(lights_of(truth.attached, 11)[:, inside][clear], (shading < 0)[clear])
        # A convex body throws no shadow on itself.
        assert not lights_of(truth.cast, 11)[:, inside][clear].any()
        assert (truth.object[truth.mask] == 0).all()
        assert np.isnan(truth.normals[~truth.mask]).all()
        assert not truth.attached[~truth.mask].any()


def test_a_light_behind_a_wall_is_hidden_and_one_before_it_is_not():
    """What stands beyond a near light throws no shadow back."""
    wall, roof = placed("wall", "square", "m", 30, OFF), placed("roof", "square", "m", 10, OFF + [0, 60.0, 80])
    given = lights([0, 30.0, 40], [0, 90.0, 120], near=True, middle=MIDDLE + OFF)
    truth = ground_truth(scene(wall, roof, given=given))
    u, v = np.round(CAMERA.project(MIDDLE + OFF)).astype(int)
    assert truth.object[v, u] == 0
    assert list(lights_of(truth.cast, 2)[:, v, u]) == [False, True]


def test_materials_show_in_the_maps_in_the_pixels_unit():
    values, white = np.zeros((2, 2, 3), np.float32), np.array([0.4, 0.8, 1.6])
    values[0, 0], values[1, 1] = [0.9, 0.3, 0.1], [0.2, 0.4, 0.8]
    expected = {
        "picture": (RoughPlastic(Texture(values, "clamp"), 0.3, 0.8), None, 0.3, 0.8),
        "metal": (Conductor("Au", 0.2), [0, 0, 0], 0.2, 1),
        "disney": (Principled((0.5, 0.4, 0.2), 0.15, 0.25, 0.6), [0.375, 0.3, 0.15], 0.15, 0.6),
        "measured": (Measured(None), [np.nan] * 3, np.nan, np.nan),
        "matte": (Diffuse((0.1, 0.2, 0.3)), [0.1, 0.2, 0.3], 1, 0),
    }
    objects = [placed(name, "square", name, 12, [30 * k - 60, 0, 0]) for k, name in enumerate(expected)]
    materials = {name: material for name, (material, *_) in expected.items()}
    truth = ground_truth(scene(*objects, given=lights([0, 0, 1], white=white), **materials))
    for number, (_, albedo, roughness, specularity) in enumerate(expected.values()):
        here = truth.object == number
        assert here.sum() > 50
        if albedo is not None:
            assert np.allclose(truth.albedo[here], np.array(albedo) * white / 0.8, equal_nan=True)
        assert np.allclose(truth.roughness[here], roughness, equal_nan=True)
        assert np.allclose(truth.specularity[here], specularity, equal_nan=True)
    for shift, value in ((-8.0, values[0, 0]), (8.0, values[1, 1])):
        u, v = np.round(CAMERA.project([-60 + shift, -shift, -300.0])).astype(int)
        assert np.allclose(truth.albedo[v, u], value * white / 0.8, rtol=1e-3, atol=0.02)


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
def test_maps_made_on_disk_are_those_made_in_memory(camera, tmp_path):
    """Byte for byte, so that a picture's size need not fit in memory."""
    given = scene(placed("ball", "sphere", "m", 40, OFF), camera=camera, given=lights([0, 0.3, 1], [2, 0, 0.1]))
    save_ground_truth(ground_truth(given), tmp_path / "memory")
    mapped = ground_truth(given, folder=tmp_path / "disk")
    assert all(isinstance(getattr(mapped, field.name), np.memmap) for field in fields(mapped))
    made = ({path.name: path.read_bytes() for path in (tmp_path / one).iterdir()} for one in ("memory", "disk"))
    assert next(made) == next(made)


def test_a_lens_is_undistorted_alike_in_bands(monkeypatch):
    points, _, seen = ball_seen(LENS, MIDDLE, 40, rim=0)
    found = []
    for rows in (7, 10_000):
        monkeypatch.setattr("twin.engines.film.ROWS", rows)
        found.append(film_for(LENS, points[seen]))
    assert found[0].size[0] > 7
    assert found[0].rendered == found[1].rendered
    assert np.array_equal(found[0].pixels, found[1].pixels)


def test_normals_of_a_squeezed_and_turned_ball_are_an_ellipsoids_and_a_back_faces_the_viewer():
    rng = np.random.default_rng(10005)
    turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2)]
    linear = turns[0] @ np.diag([30.0, 50, 40]) @ turns[1]
    truth = ground_truth(scene(placed("egg", "sphere", "m", 1.0, OFF, linear)))
    rays = CAMERA.rays(CAMERA.grid())[1]
    points, inverse = rays * (truth.z_mm / rays[..., 2])[..., None], np.linalg.inv(linear)
    gradient = unit((points - MIDDLE - OFF) @ inverse.T @ inverse)
    inside = truth.mask & (-np.sum(np.nan_to_num(gradient) * rays, -1) > 0.2)
    assert inside.sum() > 800
    assert angular_error_deg(truth.normals[inside], gradient[inside]).max() < 0.5
    back = placed("back", "square", "m", 20.0, OFF, np.diag([-1.0, 1, -1]))
    truth = ground_truth(scene(back, given=lights([0.3, 0, 1], [0.3, 0, -1])))
    assert np.allclose(truth.normals[truth.mask], [0, 0, 1], atol=1e-6)
    attached = lights_of(truth.attached, 2)[:, truth.mask]
    assert (attached[0].any(), attached[1].all()) == (False, True)

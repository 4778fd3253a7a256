"""Frames and the output folder: what goes in comes out, whole or not at all."""

import errno
import os
from dataclasses import replace

import numpy as np
import pytest

from scene import files as files_module
from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.files import create_array, write_json, write_whole
from scene.frames import Frames
from scene.lights import Lights
from scene.pose import Pose, rotation_from_vector
from scene.spheres import Sphere
from scene.store import Store


@pytest.fixture
def images():
    return np.random.default_rng(0).uniform(-0.01, 1.0, (4, 9, 11, 3)).astype(np.float32)


def test_linear_values_survive_coding_with_noise_below_black(images):
    frames = Frames.from_linear(tuple("abcd"), images)
    np.testing.assert_allclose(frames.read(), images, atol=0.6 / 60000)
    assert frames.read().min() < 0


def test_clipped_samples_spread_over_the_reach_of_interpolation(images):
    images = np.minimum(images, 0.9)
    images[1, 4, 5, 0] = 1.2
    plain = Frames.from_linear(tuple("abcd"), images)
    assert np.argwhere(plain.saturated()).tolist() == [[1, 4, 5]]
    mosaic = Frames(plain.names, plain.codes, plain.gain, is_mosaic=True)
    assert mosaic.saturated()[1].sum() == 9
    assert mosaic.saturated()[1, 3:6, 4:7].all()
    for rows, columns in [(slice(3, 4), slice(6, 9)), (slice(5, 9), slice(0, 5)), (slice(0, 9), slice(0, 11))]:
        np.testing.assert_array_equal(mosaic.saturated(rows, columns=columns), mosaic.saturated()[:, rows, columns])


@pytest.mark.parametrize("is_mosaic", [False, True])
def test_single_pixels_are_those_of_the_whole(images, is_mosaic):
    frames = Frames.from_linear(tuple("abcd"), images + 0.3 * (images > 0.97), ambient=images[0] * 0.1)
    frames = replace(frames, gain=np.array([1.0, 2, 4, 0.5]), is_mosaic=is_mosaic)
    v, u = np.mgrid[0:9, 0:11].reshape(2, -1)
    for index in range(4):
        linear, clipped = frames.read_pixels(index, v, u)
        np.testing.assert_array_equal(linear, frames.frame(index)[v, u])
        np.testing.assert_array_equal(clipped, frames.saturated()[index][v, u])
        assert 0 < clipped.sum() < 99


def test_everything_comes_back(tmp_path, images):
    store = Store(tmp_path)
    camera = Camera(11, 9, 20.0, 21.0, 5.0, 4.5, (0.1, 0, 0, 0, 0.01), source="EXIF")
    store.save_camera(camera)
    assert store.load_camera() == camera

    frames = Frames.from_linear(tuple("abc"), images[:3], ambient=images[0])
    store.save_frames(frames)
    np.testing.assert_array_equal(store.load_frames().read(), frames.read())
    assert store.load_frames().names == frames.names

    lights = Lights(
        ("flash 1", "b", "c"),
        np.eye(3),
        np.arange(9.0).reshape(3, 3) + 1,
        np.arange(9.0).reshape(3, 3),
        np.array([1.0, 2, -3]),
        np.array([0.1, np.nan, 0.3]),
        flags=(("dim",), (), ()),
    )
    store.save_lights(lights)
    back = store.load_lights()
    for name in ("directions", "intensities", "positions_mm", "reference_point_mm", "direction_sigma_deg"):
        np.testing.assert_array_equal(getattr(back, name), getattr(lights, name))
    assert back.flags == lights.flags
    assert (tmp_path / "lights.lp").read_text().splitlines()[:2] == ["3", "flash 1 1.00000000 0.00000000 0.00000000"]
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "light_directions.txt"), np.eye(3))
    store.save_lights(lights, files=("a b.dng", "b.dng", "c.dng"))
    assert (tmp_path / "filenames.txt").read_text().splitlines() == ["a b.dng", "b.dng", "c.dng"]
    assert (tmp_path / "lights.lp").read_text().splitlines()[1] == "a b.dng 1.00000000 0.00000000 0.00000000"
    assert store.load_lights().names == lights.names

    spheres = [Sphere("white", np.array([3.0, 4.0]), 2.5, 70.0, 0.1, 0.9, diameter_sigma=0.03)]
    store.save_spheres(spheres, camera)
    assert store.load_spheres()[0].radius_px == 2.5
    assert store.read_json("spheres.json")[0]["center_mm"][2] == pytest.approx(-20 * 35 / 2.5)

    pose = Pose.from_rotation_translation(rotation_from_vector([0.1, 0.2, 0.3]), [4, 5, 6])
    store.save_pose(pose, residual_px=0.2, sigma_mm=0.1, sigma_deg=0.05)
    np.testing.assert_array_equal(store.load_pose().matrix, pose.matrix)

    mask = np.arange(99).reshape(9, 11) % 3 == 0
    store.save_mask(mask)
    np.testing.assert_array_equal(store.load_mask(), mask)

    normals = np.zeros((9, 11, 3), np.float32)
    normals[..., 2] = 1
    store.save_estimate(Estimate("ls", normals, normals, np.ones((9, 11), np.uint16)))
    np.testing.assert_array_equal(store.load_normals("ls"), normals)


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")

    def stop():
        raise KeyboardInterrupt

    for writing in (write_whole(path), create_array(path, (10, 10), np.uint16)):
        with pytest.raises(KeyboardInterrupt), writing as file:
            if hasattr(file, "write"):
                file.write(b"half")
            stop()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["file.txt"]


def test_a_full_disk_is_said_and_leaves_nothing(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files_module.os, "posix_fallocate", full)
    with pytest.raises(SceneError, match="disk is full"), create_array(tmp_path / "codes.npy", (10, 10), np.uint16):
        raise AssertionError("not reached")
    with pytest.raises(SceneError, match="disk is full"), write_whole(tmp_path / "b") as file:
        file.write(b"half")
        full()
    assert os.listdir(tmp_path) == []


def test_a_place_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "out").write_text("a file where the folder should be")
    with pytest.raises(SceneError, match="--out"):
        write_json(tmp_path / "out" / "a.json", {})

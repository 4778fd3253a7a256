"""The twin's folder: a session by the contract, in the lights' order, whole or not at all."""

import tomllib
from dataclasses import replace

import cv2
import numpy as np
import pytest
import rawpy

from scene.camera import Camera
from scene.errors import RenderError
from scene.frames import Frames
from scene.lights import Lights
from scene.store import Store
from twin.camera.virtual_camera import Sensor
from twin.twin_session import Shooting, write_session

NAMES = ("b_10", "a_2", "c [x]")
CAMERA = Camera(48, 32, 20.5, 20.25, 5.75, 3.5, (0.01, 0.0, 0.0, 0.0, 0.0))
LIGHTS = Lights(NAMES, np.eye(3), np.ones((3, 3)), np.eye(3) * 500, np.array([0, 0, -300.0]))
LINEAR = np.random.default_rng(1).uniform(0, 1, (3, 32, 48, 3))
MASK = np.arange(1536).reshape(32, 48) > 700
TRUTH = np.where(MASK[..., None], [0, 0, 1.0], np.nan).astype(np.float32)


def test_the_folder_holds_what_its_manifest_says(tmp_path):
    frames = Frames.from_linear(NAMES, LINEAR)
    told = []
    path = write_session(
        Store(tmp_path), frames, CAMERA, LIGHTS, MASK, TRUTH, progress=lambda done, total: told.append((done, total))
    )
    session = tomllib.loads(path.read_text())
    # Not the names' order: the lights'. Brackets are a glob's, so they are escaped.
    assert session["frames"]["flash"] == ["flash/b_10.png", "flash/a_2.png", "flash/c [[]x].png"]
    assert session["frames"]["linear"] is True
    assert session["camera"] == {
        "width": 48, "height": 32, "fx": 20.5, "fy": 20.25, "cx": 5.75, "cy": 3.5,
        "distortion": [0.01, 0.0, 0.0, 0.0, 0.0],
    }  # fmt: skip
    assert set(session["object"]) == {"mask", "normals"}
    for name, linear in zip(NAMES, LINEAR, strict=True):
        image = cv2.imread(str(tmp_path / "flash" / f"{name}.png"), cv2.IMREAD_UNCHANGED)
        assert image.dtype == np.uint16
        assert np.allclose(image[..., ::-1] / 65535, linear, atol=2e-5)
    lights = Store(tmp_path).load_lights()
    assert lights.names == NAMES
    assert np.allclose(lights.positions_mm, LIGHTS.positions_mm)
    assert np.array_equal(Store(tmp_path).load_mask(), MASK)
    assert np.array_equal(np.load(tmp_path / session["object"]["normals"]), TRUTH, equal_nan=True)
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert not list(tmp_path.rglob("*.tmp"))


def test_light_that_stands_still_is_photographed_without_flash(tmp_path):
    """Else who opens the session is asked for the ambient frame that a rendering could not take."""
    frames, still = Frames.from_linear(NAMES, LINEAR), LINEAR[0] / 4
    path = write_session(Store(tmp_path), frames, CAMERA, LIGHTS, MASK, TRUTH, ambient=still)
    assert tomllib.loads(path.read_text())["frames"]["ambient"] == "ambient/ambient.png"
    image = cv2.imread(str(tmp_path / "ambient" / "ambient.png"), cv2.IMREAD_UNCHANGED)
    assert np.allclose(image[..., ::-1] / 65535, still, atol=2e-5)


def test_brighter_than_white_is_white_and_below_black_is_black(tmp_path):
    linear = np.full((3, 32, 48, 3), 1.04)
    linear[:, :4] = -0.01
    write_session(Store(tmp_path), Frames.from_linear(NAMES, linear), CAMERA, LIGHTS, MASK, TRUTH)
    image = cv2.imread(str(tmp_path / "flash" / "a_2.png"), cv2.IMREAD_UNCHANGED)
    assert (image[:4] == 0).all()
    assert (image[4:] == 65535).all()


def test_the_virtual_camera_photographs_it_and_each_frame_has_its_own_noise(tmp_path):
    frames = Frames.from_linear(NAMES, np.broadcast_to(LINEAR[:1], LINEAR.shape))
    sensor = Sensor(blur_px=0)
    for folder in ("one", "again"):
        write_session(Store(tmp_path / folder), frames, CAMERA, LIGHTS, MASK, TRUTH, shooting=Shooting(sensor, seed=5))
    session = tomllib.loads((tmp_path / "one" / "session.toml").read_text())
    assert session["frames"]["flash"][0] == "flash/b_10.dng"
    assert "linear" not in session["frames"]
    mosaics = []
    for name in NAMES:
        with rawpy.imread(str(tmp_path / "one" / "flash" / f"{name}.dng")) as raw:
            mosaics.append(raw.raw_image.astype(float))
    assert np.abs((mosaics[0][::2, 1::2] - 512) / (16383 - 512) - LINEAR[0, ::2, 1::2, 1]).max() < 0.04
    assert not np.array_equal(mosaics[0], mosaics[1])
    first, again = (tmp_path / folder / "flash" / "a_2.dng" for folder in ("one", "again"))
    assert first.read_bytes() == again.read_bytes()


def test_an_orthographic_twin_has_no_camera_table(tmp_path):
    camera = Camera.orthographic(48, 32)
    path = write_session(Store(tmp_path), Frames.from_linear(NAMES, LINEAR), camera, LIGHTS, MASK, TRUTH)
    assert "camera" not in tomllib.loads(path.read_text())


def test_what_does_not_fit_together_is_named_and_nothing_is_written(tmp_path):
    frames = Frames.from_linear(NAMES, LINEAR)
    with pytest.raises(RenderError, match="one light a frame"):
        write_session(Store(tmp_path), frames, CAMERA, replace(LIGHTS, names=("a", "b", "c")), MASK, TRUTH)
    with pytest.raises(RenderError, match="must agree"):
        write_session(Store(tmp_path), frames, CAMERA, LIGHTS, MASK[:4], TRUTH)
    assert not list(tmp_path.iterdir())

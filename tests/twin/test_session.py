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


def png(path):
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)[..., ::-1]


def test_the_folder_holds_what_its_manifest_says(tmp_path):
    linear, told = np.concatenate([LINEAR[:2], LINEAR[2:] * 1.1 - 0.02]), []
    path = write_session(
        Store(tmp_path), Frames.from_linear(NAMES, linear), CAMERA, LIGHTS, MASK, TRUTH, ambient=LINEAR[0] / 4,
        progress=lambda done, total: told.append((done, total)),
    )  # fmt: skip
    session = tomllib.loads(path.read_text())
    # Not the names' order: the lights'. Brackets are a glob's, so they are escaped.
    assert session["frames"]["flash"] == ["flash/b_10.png", "flash/a_2.png", "flash/c [[]x].png"]
    # Else who opens the session is asked for the ambient frame that a rendering could not take.
    assert (session["frames"]["linear"], session["frames"]["ambient"]) == (True, "ambient/ambient.png")
    assert session["camera"] == {
        "width": 48, "height": 32, "fx": 20.5, "fy": 20.25, "cx": 5.75, "cy": 3.5,
        "distortion": [0.01, 0.0, 0.0, 0.0, 0.0],
    }  # fmt: skip
    for name, image in (*((f"flash/{name}", one) for name, one in zip(NAMES, linear, strict=True)),
                        ("ambient/ambient", LINEAR[0] / 4)):  # fmt: skip
        found = png(tmp_path / f"{name}.png")
        assert found.dtype == np.uint16
        # Brighter than white is white, and below black is black.
        assert np.allclose(found / 65535, np.clip(image, 0, 1), atol=2e-5)
    lights = Store(tmp_path).load_lights()
    assert lights.names == NAMES
    assert np.allclose(lights.positions_mm, LIGHTS.positions_mm)
    assert np.array_equal(Store(tmp_path).load_mask(), MASK)
    assert np.array_equal(np.load(tmp_path / session["object"]["normals"]), TRUTH, equal_nan=True)
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_the_virtual_camera_photographs_it_and_each_frame_has_its_own_noise(tmp_path):
    frames = Frames.from_linear(NAMES, np.broadcast_to(LINEAR[:1], LINEAR.shape))
    for folder in ("one", "again"):
        shooting = Shooting(Sensor(blur_px=0))
        write_session(Store(tmp_path / folder), frames, CAMERA, LIGHTS, MASK, TRUTH, shooting=shooting)
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


def test_an_orthographic_twin_has_no_camera_table_and_what_does_not_fit_together_is_named(tmp_path):
    frames, flat = Frames.from_linear(NAMES, LINEAR), Camera.orthographic(48, 32)
    with pytest.raises(RenderError, match="one light a frame"):
        write_session(Store(tmp_path), frames, CAMERA, replace(LIGHTS, names=("a", "b", "c")), MASK, TRUTH)
    with pytest.raises(RenderError, match="must agree"):
        write_session(Store(tmp_path), frames, CAMERA, LIGHTS, MASK[:4], TRUTH)
    assert not list(tmp_path.iterdir())
    assert "camera" not in tomllib.loads(write_session(Store(tmp_path), frames, flat, LIGHTS, MASK, TRUTH).read_text())

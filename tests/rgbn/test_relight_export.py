"""`rgbn export --format relight`: what a viewer makes of the files, by its own formula, against the photographs."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from compare.report.pictures import Exposure
from formats.picture_files import srgb_from_linear
from rgbn.relight_export import export_relight
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames, encode
from scene.lights import Lights
from scene.normals import unit
from scene.store import Store

COUNT = 16


def as_viewed(folder, light):
    """Return the picture (h, w, 3) of a light's direction (3,): the format's formula, channel by channel."""
    info = json.loads((folder / "info.json").read_text())
    x, y, _ = light
    assert info["type"] == "ptm"
    base = [1, x, y, x * x, x * y, y * y]
    material, picture = info["materials"][0], np.zeros((info["height"], info["width"], 3))
    assert info["nplanes"] == 3 * len(base) == len(material["scale"]) == len(material["bias"])
    for plane, weight in enumerate(base):
        codes = cv2.imread(str(folder / f"plane_{plane}.{info['format']}"), cv2.IMREAD_COLOR)[..., ::-1] / 255
        for channel in range(3):
            at = 3 * plane + channel
            decoded = (codes[..., channel] - material["bias"][at]) * material["scale"][at]
            picture[..., channel] += weight * decoded
    return np.clip(picture, 0, 1)


def directions(count=COUNT):
    zenith, azimuth = np.radians(15 + 50 * np.arange(count) / count), 2.399963 * np.arange(count)
    return np.stack([np.sin(zenith) * np.cos(azimuth), np.sin(zenith) * np.sin(azimuth), np.cos(zenith)], -1)


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A matte ball under near flashes of unlike power."""
    store = Store(tmp_path_factory.mktemp("relight") / "out")
    camera = Camera(80, 64, 400.0, 400.0, 39.5, 31.5)
    reference, rng = np.array([0.0, 0.0, -500.0]), np.random.default_rng(3)
    powers = rng.uniform(0.6, 1.4, (COUNT, 1)) * np.ones(3)
    places = reference + 900 * directions()
    lights = Lights(tuple(f"f{i}" for i in range(COUNT)), directions(), powers / powers.mean(0), places, reference)
    grid = camera.grid()
    x, y = (grid[..., 0] - 39.5) / 30, -(grid[..., 1] - 31.5) / 30
    inside = x * x + y * y < 0.95
    normals = unit(np.stack([x, y, np.sqrt(np.where(inside, 1 - x * x - y * y, 1))], -1))
    vectors = lights.at(camera.points_at_depth(grid.reshape(-1, 2), -500.0)).reshape(COUNT, 64, 80, 3, 3)
    shade = np.maximum(np.einsum("fhwci,hwi->fhwc", vectors, normals), 0) * inside[..., None]
    store.save_frames(Frames(lights.names, encode(0.5 * shade * [1.0, 0.8, 0.6]), np.ones(COUNT)))
    store.save_camera(camera)
    store.save_lights(lights)
    return store, lights


def test_a_session_is_relit_to_the_stated_error(session):
    store, lights = session
    paths, notes = export_relight(store, "ball")
    folder, camera = store.path("export", "relight"), store.load_camera()
    assert set(paths) == set(folder.iterdir())
    told = json.loads((folder / "info.json").read_text())["rgbn"]
    assert f"{100 * told['rms']:.1f} % of white" in notes[0]
    # 500 mm before a lens of 400 px.
    assert "pixelSize: 1.25 }" in (folder / "index.html").read_text()
    shown = np.stack([as_viewed(folder, light) for light in lights.directions])
    points = camera.points_at_depth(camera.grid().reshape(-1, 2), -500.0)
    fall_off = np.linalg.norm(lights.toward(points), axis=-1).reshape(COUNT, 64, 80, 1)
    frames = store.load_frames()
    exposure = Exposure.for_frames(frames, white_value=lights.white_value)
    even = frames.read() / fall_off / lights.intensities[:, None, None] / exposure.white / exposure.balance
    error = np.sqrt(np.mean((shown - srgb_from_linear(np.clip(even, 0, 1))) ** 2))
    assert error == pytest.approx(told["rms"], rel=0.01)
    assert told["rms"] < told["left_out_rms"] < 0.15


def test_right_is_right_and_up_is_up(session):
    store, _ = session
    export_relight(store, "ball")
    folder = store.path("export", "relight")
    for light, side in (((0.6, 0, 0.8), np.s_[32, 60]), ((-0.6, 0, 0.8), np.s_[32, 20]),
                        ((0, 0.6, 0.8), np.s_[12, 40]), ((0, -0.6, 0.8), np.s_[52, 40])):  # fmt: skip
        picture = as_viewed(folder, light).mean(-1)
        others = [picture[at] for at in (np.s_[32, 60], np.s_[32, 20], np.s_[12, 40], np.s_[52, 40]) if at != side]
        assert picture[side] > max(others) + 0.1


def test_lights_that_tell_too_little_are_refused(session, tmp_path):
    ring = unit(np.stack([np.cos(np.arange(12.0)), np.sin(np.arange(12.0)), np.ones(12)], -1))
    store, lights = session
    for few in (directions(6), ring):
        place = Store(tmp_path / str(len(few)))
        count = len(few)
        place.save_frames(store.load_frames().only(range(count)))
        place.save_camera(store.load_camera())
        place.save_lights(replace(lights.only(range(count)), directions=few, positions_mm=None))
        with pytest.raises(SceneError, match="do not tell"):
            export_relight(place, "ball")

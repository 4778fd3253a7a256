"""Exports as others read them: what a viewer makes of `relight` by its own formula; AliceVision's camera and lights."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from compare.report.pictures import Exposure
from fixtures.lit_surfaces import ball_seen, flashes_at, matte, spiral
from formats.light_files.light_formats import export_lights
from formats.picture_files import srgb_from_linear
from formats.sfm_data import write_sfm
from rgbn.relight_export import export_relight
from scene.camera import FROM_OPENCV, Camera
from scene.errors import CalibrationError, SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.store import Store

COUNT = 16
DIRECTIONS = spiral(np.cos(np.radians(15 + 50 * np.arange(COUNT) / COUNT)))


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


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """A matte ball under near flashes of unlike power."""
    store = Store(tmp_path_factory.mktemp("relight") / "out")
    camera = Camera(80, 64, 400.0, 400.0, 39.5, 31.5)
    reference, powers = np.array([0.0, 0.0, -500.0]), np.random.default_rng(3).uniform(0.6, 1.4, (COUNT, 1))
    lights = flashes_at(reference + 900 * DIRECTIONS, reference, powers / powers.mean() * np.ones(3))
    _, normals, inside = ball_seen(camera, reference, 37.5, rim=0.22)
    images = matte(lights, camera.points_at_depth(camera.grid(), -500.0), normals, [0.5, 0.4, 0.3])
    store.save_frames(Frames.from_linear(lights.names, images * inside[..., None]))
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
    store, lights = session
    for few in (DIRECTIONS[:6], spiral(np.full(12, 0.7), turn=1.0)):
        place = Store(tmp_path / str(len(few)))
        count = len(few)
        place.save_frames(store.load_frames().only(range(count)))
        place.save_camera(store.load_camera())
        place.save_lights(replace(lights.only(range(count)), directions=few, positions_mm=None))
        with pytest.raises(SceneError, match="do not tell"):
            export_relight(place, "ball")


CAMERA = Camera(640, 480, 900.0, 985.0, 330.7, 228.1, (0.1, -0.05, 0.0, 0.0, 0.02))


def as_projected(path, points):
    """Return pixels (P, 2) of points (P, 3) in the file's world, by the file's numbers, as AliceVision reads them.

    Before version 1.2.8 the type alone tells the model of the distortion. From 1.2.5 on pixelRatio is fy / fx. The
    principal point counts from width / 2, height / 2; whole numbers are centres of pixels.
    """
    data = json.loads(path.read_text())
    assert (1, 2, 5) <= tuple(map(int, data["version"])) < (1, 2, 8)
    (lens,), (pose,) = data["intrinsics"], data["poses"]
    rotation = np.array(pose["pose"]["transform"]["rotation"], float).reshape(3, 3)
    center = np.array(pose["pose"]["transform"]["center"], float)
    terms = {"pinhole": 0, "radial1": 1, "radial3": 3, "brown": 5}[lens["type"]]
    assert len(lens["distortionParams"]) == terms
    k1, k2, k3, t1, t2 = [*map(float, lens["distortionParams"]), 0, 0, 0, 0, 0][:5]
    focal = float(lens["focalLength"]) / float(lens["sensorWidth"]) * float(lens["width"])
    size, offset = np.array([float(lens["width"]), float(lens["height"])]), np.array(lens["principalPoint"], float)
    matrix = np.diag([focal, focal * float(lens["pixelRatio"]), 1.0])
    matrix[:2, 2] = offset + size / 2
    turn, move = cv2.Rodrigues(rotation)[0], -rotation @ center
    return cv2.projectPoints(points, turn, move, matrix, np.array([k1, k2, t1, t2, k3]))[0][:, 0]


@pytest.mark.parametrize("tangential", [(0.0, 0.0), (0.013, -0.008)])
def test_the_camera_projects_as_ours(tmp_path, tangential):
    camera = replace(CAMERA, distortion=(*CAMERA.distortion[:2], *tangential, CAMERA.distortion[4]))
    files = [tmp_path / f"flash_{index}.dng" for index in range(5)]
    notes = write_sfm(tmp_path / "out" / "cameras.sfm", camera, files)
    assert notes == ["cameras.sfm: its camera is from session.toml"]
    points = np.random.default_rng(1).uniform([-90, -70, -600], [90, 70, -400], (50, 3))
    seen = as_projected(tmp_path / "out" / "cameras.sfm", points @ FROM_OPENCV)
    np.testing.assert_allclose(seen, camera.project(points), atol=1e-6)


def test_the_lights_are_of_its_views(tmp_path):
    """A light before the object has z < 0 there, one above it y < 0; views count from 1 in the frames' order."""
    toward = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]])
    lights = Lights(("b", "a", "c"), toward, np.ones((3, 3)), 500 * toward)
    (path,), (note,) = export_lights(tmp_path, "meshroom", lights, CAMERA, files=("b.dng", "a.dng", "c.dng"))
    assert "no positions" in note
    rows = json.loads(path.read_text())["lights"]
    assert [(row["viewId"], row["name"], row["type"]) for row in rows] == [
        (1, "b", "directional"), (2, "a", "directional"), (3, "c", "directional")
    ]  # fmt: skip
    np.testing.assert_allclose([row["direction"] for row in rows], toward * [1, -1, -1])


def test_what_it_cannot_say_is_refused(tmp_path):
    parallel = Camera(640, 480, 1.0, 1.0, 320.0, 240.0, projection="orthographic")
    with pytest.raises(CalibrationError, match="orthographic"):
        write_sfm(tmp_path / "b.sfm", parallel, [])
    assert not (tmp_path / "b.sfm").exists()

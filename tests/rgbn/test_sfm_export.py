"""AliceVision's SfMData: its camera projects as ours does, its views are the lights'."""

import json
from dataclasses import replace

import numpy as np
import pytest

from formats.light_files.light_formats import export_lights
from formats.sfm_data import write_sfm
from scene.camera import FROM_OPENCV, Camera
from scene.errors import CalibrationError
from scene.lights import Lights

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
    local = (points - center) @ rotation.T
    x, y = (local[:, :2] / local[:, 2:]).T
    terms = {"pinhole": 0, "radial1": 1, "radial3": 3, "brown": 5}[lens["type"]]
    assert len(lens["distortionParams"]) == terms
    k1, k2, k3, t1, t2 = [*map(float, lens["distortionParams"]), 0, 0, 0, 0, 0][:5]
    square = x * x + y * y
    factor = 1 + k1 * square + k2 * square**2 + k3 * square**3
    focal = float(lens["focalLength"]) / float(lens["sensorWidth"]) * float(lens["width"])
    size, offset = np.array([float(lens["width"]), float(lens["height"])]), np.array(lens["principalPoint"], float)
    u = focal * (x * factor + t2 * (square + 2 * x * x) + 2 * t1 * x * y)
    v = focal * float(lens["pixelRatio"]) * (y * factor + t1 * (square + 2 * y * y) + 2 * t2 * x * y)
    return np.stack([u, v], 1) + offset + size / 2


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

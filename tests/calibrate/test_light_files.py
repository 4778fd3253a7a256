"""Others' light files: axes, origins and units by files written by hand, then everything there and back."""

import json

import numpy as np
import pytest
import scipy.io

from calibrate.known_lights.read_known import lacks_intensities, read_lights
from formats.light_files.light_formats import WRITTEN, export_lights
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.lights import Lights

NAMES = ("right", "above", "front")
# To the right of the camera, above it, beside its axis: each fails for one wrong sign and for swapped axes.
DIRECTIONS = np.array([[0.6, 0.0, 0.8], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]])
OPENCV = DIRECTIONS * [1, -1, -1]
CAMERA = Camera(500, 400, 1000.0, 1000.0, 260.0, 190.0)


def alicevision(path, lights):
    path.write_text(json.dumps({"lights": lights}))
    return path


def as_boost_writes(direction, **keys):
    """Boost's property tree writes every number as a string."""
    strings = [str(number) for number in direction]
    return {**keys, "type": "directional", "direction": strings, "intensity": ["1", "2", "4"]}


def dome(path, **keys):
    data = {"lightConfiguration": "directional", "imageWidth": 0, "directions": [], "ledAdjust": [], **keys}
    path.write_text(json.dumps(data))
    return path


def xyz(rows):
    return [{"x": x, "y": y, "z": z} for x, y, z in np.asarray(rows, float).tolist()]


def test_alicevision_looks_along_z_with_y_down(tmp_path):
    """A light before the object has z < 0 there, one above it y < 0."""
    rows = [as_boost_writes(row, lightId=str(i)) for i, row in enumerate(OPENCV)]
    lights = read_lights(alicevision(tmp_path / "lights.json", rows), NAMES)
    np.testing.assert_allclose(lights.directions, DIRECTIONS)
    np.testing.assert_allclose(lights.intensities, 1)
    assert all("order" in flags[-1] for flags in lights.flags)
    shuffled = read_lights(alicevision(tmp_path / "lights.json", rows[::-1]), NAMES)
    np.testing.assert_allclose(shuffled.directions, DIRECTIONS, err_msg="by lightId, not by place")


def test_alicevision_views_are_found_by_their_sfm_or_refused(tmp_path):
    """View ids are hashes, and the file is sorted by them: its order is nobody's."""
    views = {"right": 905, "above": 17, "front": 377}
    order = sorted(range(3), key=lambda i: views[NAMES[i]])
    rows = [as_boost_writes(OPENCV[i], viewId=str(views[NAMES[i]])) for i in order]
    path = alicevision(tmp_path / "lights.json", rows)
    with pytest.raises(CalibrationError, match=r"view 17.*cameraInit\.sfm"):
        read_lights(path, NAMES)
    sfm = {"views": [{"viewId": str(view), "path": f"/shots/{name}.dng"} for name, view in views.items()]}
    (tmp_path / "cameraInit.sfm").write_text(json.dumps(sfm))
    lights = read_lights(path, NAMES)
    np.testing.assert_allclose(lights.directions, DIRECTIONS)
    assert not any(lights.flags)


def test_a_dome_is_about_what_the_middle_of_the_picture_shows(tmp_path):
    """1000 px of focal length, 500 px wide: 400 mm are seen 800 mm away, and the middle's ray goes 10.5 px aside."""
    middle = np.array([(249.5 - 260) * 0.8, -(199.5 - 190) * 0.8, -800.0])
    offset = np.array([[300.0, 0, 400], [0, 600, 800], [0, 0, 900]])
    path = dome(tmp_path / "l.dome", lightConfiguration="lights3d", imageWidth=400, positions3d=xyz(offset))
    lights = read_lights(path, NAMES, camera=CAMERA)
    assert lights.model == "near"
    np.testing.assert_allclose(lights.reference_point_mm, middle)
    np.testing.assert_allclose(lights.positions_mm, middle + offset)
    np.testing.assert_allclose(lights.directions, DIRECTIONS)
    for camera in (None, Camera.orthographic(500, 400)):
        distant = read_lights(path, NAMES, camera=camera)
        assert distant.model == "distant"
        np.testing.assert_allclose(distant.directions, DIRECTIONS)
        assert any("not used" in flag for flag in distant.flags[0])


def test_a_dome_adjusts_the_pixels_not_the_lamps(tmp_path):
    """A lamp twice as strong as the others wants its pixels halved."""
    adjust = [{"r": 1, "g": 1, "b": 1}, {"r": 0.5, "g": 0.5, "b": 0.5}, {"r": 1, "g": 1, "b": 1}]
    path = dome(tmp_path / "l.dome", directions=xyz(DIRECTIONS), ledAdjust=adjust)
    np.testing.assert_allclose(read_lights(path, NAMES).intensities[:, 0], np.array([1, 2, 1]) / (4 / 3))


def test_near_ps_is_opencvs_frame_in_mm(tmp_path):
    """Lamps about the camera, object 700 mm before it: the lamp on the right has x > 0, the one above y < 0."""
    positions = np.array([[300.0, 0, 100], [0, -300, 100], [0, 0, -200]])
    scipy.io.savemat(tmp_path / "light.mat", {"S": positions, "Phi": np.array([[2.0], [2.0], [9.0]])})
    lights = read_lights(tmp_path / "light.mat", NAMES)
    np.testing.assert_allclose(lights.positions_mm, positions * [1, -1, -1])
    np.testing.assert_allclose(lights.reference_point_mm, [0, 0, -700])
    assert "700 mm" in lights.flags[0][0]
    # Phi is power: what arrives falls off with the square of 671, 671 and 900 mm.
    arriving = np.array([2 / 450000, 2 / 450000, 9 / 810000])
    np.testing.assert_allclose(lights.intensities[:, 1], arriving / arriving.mean())
    scipy.io.savemat(tmp_path / "light.mat", {"S": positions, "mu": np.array([[0.0], [1.5], [0]])})
    lights = read_lights(tmp_path / "light.mat", NAMES)
    assert lacks_intensities(lights)
    assert any("mu up to 1.5" in flag for flag in lights.flags[2])


def random_lights(rng, near):
    directions = rng.normal(size=(7, 3)) * [1, 1, 0.3] + [0, 0, 1]
    directions[:, 2] = np.abs(directions[:, 2]) + 0.1
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reference = rng.normal(size=3) * 40 + [0, 0, -900] if near else np.zeros(3)
    positions = reference + directions * rng.uniform(500, 1200, (7, 1)) if near else None
    names = tuple(f"shot {i:02d}" for i in range(7))
    intensities = rng.uniform(0.5, 1.5, (7, 3))
    return Lights(names, directions, intensities, positions, reference, white_value=np.ones(3)).normalised()


@pytest.mark.parametrize("near", [False, True])
@pytest.mark.parametrize("name", WRITTEN)
@pytest.mark.parametrize("seed", range(3))
def test_there_and_back(tmp_path, name, near, seed):
    """The light that falls on any point is the same, up to the unit of each channel."""
    lights = random_lights(np.random.default_rng(10000 + seed), near)
    files = tuple(f"{name}.dng" for name in lights.names)
    paths, notes = export_lights(tmp_path, name, lights, CAMERA, files=files)
    assert all(path.is_file() for path in paths)
    # In another order than written: names are kept.
    names = lights.names[::-1]
    back = read_lights(paths[0], names, camera=CAMERA)
    keeps_positions = near and name == "dome"
    assert (back.model == "near") == keeps_positions
    assert any("no positions" in note for note in notes) == (near and not keeps_positions)
    assert not any(flag for flags in back.flags for flag in flags if not flag.endswith("has no intensities"))
    points = np.random.default_rng(seed).normal(size=(5, 3)) * 60 + [0, 0, -900]
    if not keeps_positions:
        points = lights.reference_point_mm[None]
    want, found = lights.at(points)[::-1], back.at(points)
    if name == "lp":
        want = lights.toward(points)[::-1, :, None] * np.ones((1, 1, 3, 1))
    scale = np.sum(want * found, axis=(0, 1, 3)) / np.sum(found**2, axis=(0, 1, 3))
    np.testing.assert_allclose(found * scale[:, None], want, atol=3e-7)
    if not near:
        np.testing.assert_allclose(scale, 1, atol=1e-6)


KNOWN = ("flash_000", "flash_001", "flash_002")
TOWARD = np.array([[0.6, 0.0, 0.8], [0.0, -0.6, 0.8], [-0.36, 0.48, 0.8]])


@pytest.mark.parametrize("skipped", [(0,), (1,), (2,)])
def test_a_file_without_names_counts_the_skipped_frames(tmp_path, skipped):
    np.savetxt(tmp_path / "light_directions.txt", TOWARD)
    names = tuple(name for i, name in enumerate(KNOWN) if i not in skipped)
    lights = read_lights(tmp_path / "light_directions.txt", names, skipped=skipped)
    np.testing.assert_allclose(lights.directions, np.delete(TOWARD, skipped, 0))
    with pytest.raises(CalibrationError, match="3 lights for 2"):
        read_lights(tmp_path / "light_directions.txt", names)


def test_diligent_reads_intensities_beside(tmp_path):
    np.savetxt(tmp_path / "light_directions.txt", TOWARD)
    np.savetxt(tmp_path / "light_intensities.txt", [[2, 2, 2], [4, 3, 2], [6, 4, 2]])
    (tmp_path / "filenames.txt").write_text("flash_002.png\nflash_000.png\nflash_001.png\n")
    lights = read_lights(tmp_path / "light_directions.txt", KNOWN)
    np.testing.assert_allclose(lights.directions, TOWARD[[1, 2, 0]])
    np.testing.assert_allclose(lights.intensities, np.array([[4, 3, 2], [6, 4, 2], [2, 2, 2]]) / [4, 3, 2])
    assert not any(lights.flags)
    (tmp_path / "light_intensities.txt").unlink()
    assert lacks_intensities(read_lights(tmp_path / "light_directions.txt", KNOWN))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("l.lp", "2\na 0 0 1\nb 0 1 1\n", "2 lights for 3 flash frames"),
        ("l.lp", "4\na 0 0 1\n", "line 1 says 4 lights, but 1 follow"),
        ("l.lp", "flash_000 0 0 1\n", "number of lights"),
        ("l.lp", "3\na 0 0 0\nb 0 1 1\nc 1 0 1\n", "no direction"),
        ("l.lp", "3\na 0 x 1\nb 0 1 1\nc 1 0 1\n", "float: 'x'"),
        ("l.lp", "3\na 0 nan 1\nb 0 1 1\nc 1 0 1\n", "not a finite number"),
        ("l.lp", "3\nflash_000 0 0 1\nflash_001 0 1 1\nother 1 0 1\n", "no light for the frame 'flash_002'"),
        ("l.txt", "0 0 1\n0 1\n1 0 1\n", "line 2 is '0 1'"),
        ("l.txt", "", "empty"),
        ("l.json", json.dumps({"lights": []}), "holds no lights"),
        ("l.json", "{", "not JSON"),
        ("l.json", "[1]", "holds a list"),
        ("l.json", "{}", r"its keys are none\)\. Expected frames"),
        ("l.xyz", "", "not known"),
        ("a.json", {"lights": [{"viewId": 1, "type": "SH", "direction": [0] * 9, "intensity": [1] * 3}]}, "type 'SH'"),
        ("a.json", {"lights": [{"lightId": 1, "direction": [0, 0, "up"], "intensity": [1] * 3}]}, "with viewId"),
        ("a.json", {"lights": [{"lightId": 1, "intensity": [1] * 3}]}, "KeyError: 'direction'"),
        ("a.json", {"lights": [{"lightId": 1, "direction": [0, 0, -1], "intensity": [1, 0, 1]}]}, "must be positive"),
        ("a.json", {"frames": [{"name": "a", "direction": [0, 0, float("nan")], "intensity": [1] * 3}]}, "light 1 has"),
        ("a.json", {"model": "near", "frames": [{"name": name, "direction": [0, 0, 1], "position_mm": None,
                                                 "intensity": [1] * 3} for name in KNOWN]}, "position_mm: found the"),
        ("a.dome", {"lightConfiguration": "ring", "directions": []}, "'ring', expected directional"),
        ("a.dome", {"lightConfiguration": "lights3d"}, "KeyError: 'positions3d'"),
        ("a.dome", {"directions": xyz([[0, 0, 1]]), "ledAdjust": [{"r": 1, "g": 1, "b": 1}] * 2}, "1 lights, but 2"),
        ("a.dome", {"directions": xyz([[0, 0, 1]]), "ledAdjust": [{"r": 1, "g": 0, "b": 1}]}, "ledAdjust must be"),
        ("a.dome", {"directions": []}, "holds no lights"),
    ],
)  # fmt: skip
def test_refusals_name_file_and_fault(tmp_path, name, content, message):
    (tmp_path / name).write_text(content if isinstance(content, str) else json.dumps(content))
    with pytest.raises(CalibrationError, match=message) as caught:
        read_lights(tmp_path / name, KNOWN)
    assert name in str(caught.value)

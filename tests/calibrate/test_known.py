"""Lights from files: three formats, one frame of reference, and clear refusals."""

import json

import numpy as np
import pytest

from calibrate.known_lights.read_known import lacks_intensities, read_lights
from scene.errors import CalibrationError
from scene.lights import Lights
from scene.store import Store

NAMES = ("flash_000", "flash_001", "flash_002")
DIRECTIONS = np.array([[0.6, 0.0, 0.8], [0.0, -0.6, 0.8], [-0.36, 0.48, 0.8]])


def test_lp_is_in_the_camera_frame_already(tmp_path):
    path = tmp_path / "lights.lp"
    path.write_text("3\nflash_000.jpg 0.6 0 0.8\nraw\\flash_001.jpg 0 -0.6 0.8\nflash_002.jpg -0.72 0.96 1.6\n")
    lights = read_lights(path, NAMES)
    np.testing.assert_allclose(lights.directions, DIRECTIONS)
    np.testing.assert_array_equal(lights.intensities, 1)
    assert lights.names == NAMES
    assert set(lights.flags) == {("lights.lp has no intensities",)}


def test_lp_finds_frames_by_name_in_any_order_and_with_spaces(tmp_path):
    path = tmp_path / "lights.lp"
    path.write_text("3\nmy c.png -0.36 0.48 0.8\nmy a.png 0.6 0 0.8\nmy b.png 0 -0.6 0.8\n")
    np.testing.assert_allclose(read_lights(path, ("my a", "my b", "my c")).directions, DIRECTIONS)


def test_foreign_names_are_taken_in_order_and_flagged(tmp_path):
    path = tmp_path / "lights.lp"
    path.write_text("3\nx 0.6 0 0.8\ny 0 -0.6 0.8\nz -0.36 0.48 0.8\n")
    lights = read_lights(path, NAMES)
    np.testing.assert_allclose(lights.directions, DIRECTIONS)
    assert all("order" in flags[-1] for flags in lights.flags)


def test_rows_without_names_are_in_order_even_where_frames_are_named_by_number(tmp_path):
    np.savetxt(tmp_path / "light_directions.txt", DIRECTIONS)
    np.testing.assert_allclose(read_lights(tmp_path / "light_directions.txt", ("1", "2", "3")).directions, DIRECTIONS)
    two = read_lights(tmp_path / "light_directions.txt", ("1", "2"), skipped=(2,))
    np.testing.assert_allclose(two.directions, DIRECTIONS[:2])


@pytest.mark.parametrize("skipped", [(0,), (1,), (2,)])
def test_a_file_without_names_counts_the_skipped_frames(tmp_path, skipped):
    np.savetxt(tmp_path / "light_directions.txt", DIRECTIONS)
    names = tuple(name for i, name in enumerate(NAMES) if i not in skipped)
    lights = read_lights(tmp_path / "light_directions.txt", names, skipped=skipped)
    np.testing.assert_allclose(lights.directions, np.delete(DIRECTIONS, skipped, 0))
    with pytest.raises(CalibrationError, match="3 lights for 2"):
        read_lights(tmp_path / "light_directions.txt", names)


def test_diligent_reads_intensities_beside(tmp_path):
    np.savetxt(tmp_path / "light_directions.txt", DIRECTIONS)
    np.savetxt(tmp_path / "light_intensities.txt", [[2, 2, 2], [4, 3, 2], [6, 4, 2]])
    (tmp_path / "filenames.txt").write_text("flash_002.png\nflash_000.png\nflash_001.png\n")
    lights = read_lights(tmp_path / "light_directions.txt", NAMES)
    np.testing.assert_allclose(lights.directions, DIRECTIONS[[1, 2, 0]])
    np.testing.assert_allclose(lights.intensities, np.array([[4, 3, 2], [6, 4, 2], [2, 2, 2]]) / [4, 3, 2])
    assert not any(lights.flags)
    (tmp_path / "light_intensities.txt").unlink()
    assert lacks_intensities(read_lights(tmp_path / "light_directions.txt", NAMES))


@pytest.mark.parametrize("near", [False, True])
def test_own_json_comes_back_whole(tmp_path, near):
    rng = np.random.default_rng(0)
    lights = Lights(
        NAMES,
        DIRECTIONS,
        rng.uniform(0.5, 1.5, (3, 3)),
        1000 * DIRECTIONS if near else None,
        np.array([1.0, 2.0, -900.0]) if near else np.zeros(3),
        np.array([0.1, 0.2, np.nan]),
        white_value=np.ones(3),
        flags=(("odd",), (), ()),
    ).normalised()
    Store(tmp_path).save_lights(lights)
    back = read_lights(tmp_path / "lights.json", NAMES)
    np.testing.assert_allclose(back.directions, lights.directions)
    np.testing.assert_allclose(back.intensities, lights.intensities)
    np.testing.assert_allclose(back.white_value, lights.white_value)
    np.testing.assert_array_equal(back.direction_sigma_deg, lights.direction_sigma_deg)
    assert back.model == lights.model
    assert back.flags == lights.flags
    if near:
        np.testing.assert_allclose(back.positions_mm, lights.positions_mm)


@pytest.mark.parametrize(
    ("name", "text", "message"),
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
    ],
)
def test_refusals_name_the_fault(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(CalibrationError, match=message):
        read_lights(tmp_path / name, NAMES)


def test_missing_file(tmp_path):
    with pytest.raises(CalibrationError, match="no such file"):
        read_lights(tmp_path / "gone.lp", NAMES)

"""`session.toml` and DiLiGenT folders: every fault at once, nothing guessed."""

import json
from typing import get_args

import numpy as np
import pytest

from capture.session.manifest import SessionObjectTable
from capture.session.session import load_session
from fixtures.bad_input.samples import NAMES, write_layout
from scene.camera import Camera
from scene.errors import SessionError
from scene.files import write_png
from scene.length_units import UNITS_MM


@pytest.fixture
def folder(tmp_path):
    """A folder with frames flash_2, flash_9, flash_10, an ambient frame and a ball shot apart."""
    for name in ("flash_2", "flash_9", "flash_10", "dusk", "ball_1", "ball_2", "ball_3", "mask"):
        write_png(tmp_path / f"{name}.png", np.full((4, 6), 9, np.uint8))
    (tmp_path / "object.ply").write_text("ply")
    (tmp_path / "lights.lp").write_text("0")
    (tmp_path / "a.dng").write_bytes(b"x")
    return tmp_path


def load(folder, text):
    (folder / "session.toml").write_text(text)
    return load_session(folder)


def faults_of(folder, text):
    with pytest.raises(SessionError) as caught:
        load(folder, text)
    message = str(caught.value)
    assert len(message) < 3000
    return message


FLASH = '[frames]\nflash = "flash_*.png"\n'


def test_two_lines_are_enough(folder):
    session = load(folder, FLASH)
    assert session.names == ("flash_2", "flash_9", "flash_10")
    assert session.name == folder.name
    assert session.encoding == "linear"
    assert not session.encoding_stated
    assert session.camera is None
    assert load_session(folder / "session.toml") == session


def test_every_key_arrives(folder):
    session = load(
        folder,
        """
        version = 1
        name = "penguin"
        [frames]
        flash = ["flash_10.png", "flash_[29].png"]
        ambient = "dusk.png"
        gamma = 1.8
        half = true
        skip = ["flash_2"]
        [camera]
        width = 6
        height = 4
        fx = 7
        fy = 7.5
        cx = 2.5
        cy = 1.5
        distortion = [0.1, 0, 0, 0, 0]
        [[spheres]]
        kind = "chrome"
        diameter_mm = 76
        center_px = [1, 2.5]
        radius_px = 3
        [[spheres]]
        kind = "white"
        mask = "mask.png"
        frames = "ball_*.png"
        [lights]
        file = "lights.lp"
        [object]
        mask = "mask.png"
        scan = "object.ply"
        scan_unit = "m"
        """,
    )
    assert session.names == ("flash_10", "flash_9"), "the globs in their order, flash_2 skipped"
    assert session.kept == (0, 2)
    assert (session.photographed, session.encoding_stated) == (3, True)
    assert session.ambient == (folder / "dusk.png",)
    assert session.encoding == 1.8
    assert session.half
    assert session.camera == Camera(6, 4, 7, 7.5, 2.5, 1.5, (0.1, 0, 0, 0, 0))
    chrome, white = session.spheres
    assert (chrome.kind, chrome.diameter_mm, chrome.center_px, chrome.radius_px) == ("chrome", 76, (1, 2.5), 3)
    assert white.mask == folder / "mask.png"
    assert [path.name for path in white.frames] == ["ball_1.png", "ball_3.png"], "the skipped frame's is left out"
    assert (session.lights_file, session.scan, session.scan_unit) == (
        folder / "lights.lp",
        folder / "object.ply",
        "m",
    )


@pytest.mark.parametrize(
    ("scan", "unit", "expected"),
    [
        ("object.ply", None, "mm"),
        ("object.ply", "unknown", "unknown"),
        # GLB is in metres by its standard; who writes another unit knows that the file breaks it.
        ("object.glb", None, "m"),
        ("object.glb", "mm", "mm"),
    ],
)
def test_the_unit_of_a_scan_is_what_is_written_else_the_format_s(folder, scan, unit, expected):
    assert set(get_args(SessionObjectTable.model_fields["scan_unit"].annotation)) == set(UNITS_MM)
    (folder / scan).write_text("mesh")
    line = f'scan_unit = "{unit}"' if unit else ""
    assert load(folder, FLASH + f'[object]\nscan = "{scan}"\n{line}').scan_unit == expected


def test_a_board(folder):
    board = '{ squares = [11, 8], square_mm = 15, marker_mm = 11, dictionary = "D" }'
    text = f'[camera]\ncharuco = "ball_*.png"\nboard = {board}'
    session = load(folder, FLASH + text)
    assert (len(session.board_shots), session.camera.board.squares, session.camera.board.square_mm) == (3, [11, 8], 15)


def test_names_that_would_lead_elsewhere(folder):
    for name in ("", " ", ".", "..", "../other", "/tmp/x", "a/b", "a\\b", "C:x", "a\0b"):
        assert "name: found" in faults_of(folder, f"name = {json.dumps(name)}\n{FLASH}")
    assert load(folder, f'name = "Büste v1.2 (a..b)"\n{FLASH}').name == "Büste v1.2 (a..b)"


def test_all_faults_at_once(folder):
    message = faults_of(
        folder,
        """
        nme = "x"
        [frames]
        flsh = "flash_*.png"
        flash = "flash_*.png"
        ambient = "dawn_*.png"
        skip = ["flash_3"]
        [camera]
        fx = 100.0
        focal_mm = 50.0
        [[spheres]]
        kind = "crome"
        [object]
        mask = "msk.png"
        scan_unit = "mile"
        [lights]
        file = "lights.lp"
        """,
    )
    for part in (
        "nme: unknown key. Did you mean name?",
        "frames.flsh: unknown key. Did you mean flash?",
        'frames.ambient: "dawn_*.png" matches no file',
        'frames.skip: "flash_3" is none of the 3 flash frames. Did you mean flash_',
        "camera: found fx beside focal_mm. Both tell the focal length: keep one of them.",
        "spheres[0].kind: found 'crome'",
        "object.scan_unit: found 'mile'",
        "7 faults",
    ):
        assert part in message


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["frames: missing"]),
        ("[frames]\nlinear = true", ["frames.flash: missing"]),
        ('[frames]\nflash = "*.lp"', ["lights.lp is no photograph"]),
        ('[frames]\nflash = ["flash_*.png", "flash_2.png"]', ["flash_2.png a second time"]),
        (FLASH + "linear = true\ngamma = 2.2", ["frames.gamma", "Keep one"]),
        ('[frames]\nflash = "[af]*"', ["1 .dng and 3 .png"]),
        (FLASH + 'ambient = "*.dng"', ["of another kind"]),
        (FLASH + 'chart = "c.dng"', ["frames.chart: there is no file"]),
        (FLASH + '[[spheres]]\nkind = "chrome"\nreflectance = 0.9', ["reflectance: found with a mirror"]),
        ('[frames]\nflash = "a.dng"\nlinear = false', ["linear by themselves"]),
        (FLASH + 'skip = ["flash_2", "flash_9", "flash_10"]', ["leaves none"]),
        (FLASH + '[camera]\ncharuco = "ball_*.png"', ["camera.board: missing"]),
        (FLASH + '[camera]\ncharuco = "ball_*.png"\nboard = { squares = [9, 6] }', ["camera.board.marker_mm: missing"]),
        (FLASH + '[camera]\nchessboard = "ball_*.png"\nfx = 70', ["camera.board: missing", "found fx beside a board"]),
        (FLASH + "[camera]\nwidth = 6\nfx = 7", ["camera.height: missing", "go together"]),
        (FLASH + "[camera]\nfy = 7", ["camera.fx: missing"]),
        (FLASH + "[camera]\nfocal_mm = 50\nsensor_mm = 36\npixel_um = 4", ["found sensor_mm, pixel_um"]),
        (FLASH + "[camera]\nfocal_mm = 8333\nsensor_mm = 36", ["camera.focal_mm: found 8333", "1 to 3000"]),
        (FLASH + '[[spheres]]\nkind = "white"\nradius_px = 3', ["spheres[0].center_px: missing"]),
        (FLASH + '[[spheres]]\nkind = "white"\nframes = "ball_[12].png"', ["matches 2 files, frames.flash 3"]),
        (FLASH + '[lights]\nfile = "mask.png"', ["lights.file: mask.png cannot be read", ".lp, .json, .txt"]),
        (FLASH + '[object]\nscan = "mask.png"', ["object.scan: mask.png cannot be read", ".ply, .obj"]),
        (FLASH + '[object]\npicks = "mask.png"', ["object.picks: picks are points of a scan, and there is none"]),
        (FLASH + '[object]\nnormals = "object.ply"', ["object.normals: object.ply cannot be read", ".mat, .txt"]),
        (FLASH + "[object]\nscan_ball_diameter_mm = 0", ["object.scan_ball_diameter_mm: found 0"]),
        (FLASH + "[object]\ntolerance_deg = 0", ["object.tolerance_deg: found 0; expected greater than 0"]),
        (FLASH + "[object]\ntolerance_deg = 90", ["object.tolerance_deg: found 90; expected less than 90"]),
        (FLASH + '[object]\ntolerance_deg = "3deg"', ["object.tolerance_deg: found '3deg'; expected a number"]),
        ("version = 2\n" + FLASH, ["version: found 2"]),
    ],
)
def test_faults_say_where_and_what_to_do(folder, text, parts):
    message = faults_of(folder, text)
    for part in [*parts, "session.toml"]:
        assert part in message


def test_a_diligent_folder_is_a_session(tmp_path):
    write_layout(tmp_path)
    session = load_session(tmp_path)
    assert session.layout == "diligent"
    assert session.names == NAMES
    assert session.lights_file == tmp_path / "light_directions.txt"
    assert session.photographed == len(NAMES)
    assert (session.mask, session.normals) == (tmp_path / "mask.png", tmp_path / "normal.txt")
    assert session.encoding == "linear"


def test_a_diligent_folder_with_gaps(tmp_path):
    write_layout(tmp_path)
    (tmp_path / "flash_2.png").unlink()
    (tmp_path / "light_directions.txt").unlink()
    with pytest.raises(SessionError) as caught:
        load_session(tmp_path)
    for part in ("flash_2.png", "light_directions.txt", "2 faults"):
        assert part in str(caught.value)

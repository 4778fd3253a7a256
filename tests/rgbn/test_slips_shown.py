"""Slips that only the photographs, their EXIF or the scan tell: units, kinds, masks. One message, with a cure."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from align.mask.object_mask import find_object
from calibrate.detection.diameters import doubted_diameters
from capture.camera.exif import Exif
from capture.camera.focal_length import camera_from_lens
from capture.camera.session_camera import camera_of, fitted
from capture.session.requests import read_mask
from capture.session.session import load_session
from capture.session.session_types import Lens
from scene.camera import Camera
from scene.errors import SessionError
from scene.files import write_png
from scene.frames import Frames
from scene.spheres import Sphere

FIXTURE = Path(__file__).parents[2] / "fixtures" / "bumpy"
EXIF = Exif(focal_mm=50.0, pixels_per_mm=(160.0, 160.0), width_px=3760, camera="NIKON D7500")


@pytest.fixture
def session(tmp_path):
    folder = tmp_path / "session"
    shutil.copytree(FIXTURE, folder, symlinks=True, ignore=shutil.ignore_patterns("truth.*"))
    return folder


@pytest.fixture
def run(run_rgbn, session, tmp_path):
    """Change texts of session.toml, run a verb, and return exit code, messages, and the summary's warnings."""

    def changed(verb, *changes):
        text = (session / "session.toml").read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        (session / "session.toml").write_text(text)
        code, _, said = run_rgbn(verb, session, "--out", tmp_path / "out")
        summary = tmp_path / "out" / "summary.json"
        warnings = [] if code else [one["text"] for one in json.loads(summary.read_text())["warnings"]]
        return code, said, warnings

    return changed


# The photographs.


def test_the_flash_glob_matches_the_ambient_frame_that_nobody_listed(run):
    code, said, _ = run("check", ("raw/flash_*", "raw/*"), ('ambient = "raw/ambient_*.dng"\n', ""))
    assert code == 2
    (line,) = [line for line in said.splitlines() if line.startswith("rgbn: ")]
    assert line.startswith("rgbn: ambient_000: the flash did not fire")
    assert line.endswith("one that was shot without flash belongs under frames.ambient.")


def test_two_flash_frames_are_told_before_balls_are_sought(run):
    code, said, _ = run("calibrate", ("raw/flash_*", "raw/flash_00[01]"))
    assert code == 2
    assert said.endswith("rgbn: lights: found 2, photometric stereo needs at least 3. Shoot more flash frames.\n")


# The camera.


@pytest.mark.parametrize(
    ("lens", "key", "found"),
    [
        (Lens(focal_mm=5.0, sensor_mm=2.35), "focal_mm", "found 5, but the photographs' EXIF says 50 mm"),
        (
            Lens(focal_mm=50.0, sensor_mm=2.35),
            "sensor_mm",
            "found 2.35, but by the photographs' EXIF the sensor is 23.5",
        ),
        (Lens(focal_mm=1.97, pixel_um=0.5), "focal_mm", "found 1.97, but the photographs' EXIF says 50 mm"),
    ],
    ids=["both in cm", "sensor in cm", "focal length in inch"],
)
def test_lengths_of_the_camera_in_another_unit(lens, key, found):
    _, warnings = camera_from_lens(lens, [EXIF] * 3, 3760, 2506)
    assert [w for w in warnings if w.startswith(f"camera.{key}: {found}") and "Give millimetres" in w], warnings


@pytest.mark.parametrize("lens", [Lens(focal_mm=85.0, sensor_mm=23.5), Lens(focal_mm=35.0, crop_factor=1.5)])
def test_an_adapted_lens_is_no_slip(lens):
    _, warnings = camera_from_lens(lens, [EXIF] * 3, 3760, 2506)
    assert len(warnings) == 1


def test_a_principal_point_in_millimetres():
    stated = Camera(640, 480, 900.0, 900.0, 18.0, 12.0)
    camera, (text,) = camera_of(replace(load_session(FIXTURE), camera=stated), [], 640, 480)
    assert camera.cx == 18
    assert re.search(r"\(18, 12\) lies 47% of the width.*Give pixels of the photographs' size, not mm", text)


def test_pictures_that_a_viewer_turns(tmp_path):
    """EXIF's orientation is not applied: a size, or a mask, of the turned picture is named as turned."""
    with pytest.raises(SessionError, match=r"found 480 x 640, but the frames are 640 x 480.*not turned by EXIF"):
        fitted(Camera(480, 640, 900.0, 900.0, 228.0, 330.0), load_session(FIXTURE), 640, 480)
    write_png(tmp_path / "mask.png", np.eye(6, 4, dtype=np.uint8) * 255)
    with pytest.raises(SessionError, match=r"the mask is 4 x 6 px, the frames 6 x 4.*not turned by EXIF"):
        read_mask(tmp_path / "mask.png", 4, 6)


# The balls.


@pytest.mark.parametrize(("diameter", "times"), [(9.0, "0.099"), (3.54, "0.039"), (45.0, "0.5"), (2286.0, "25")])
def test_one_diameter_in_another_unit_or_the_radius(diameter, times):
    """Of 90 mm: in cm, in inch, its radius, in mm times 25.4."""
    balls = [Sphere("chrome", np.zeros(2), r, diameter_mm=100.0) for r in (45.3, 44.8)]
    white = Sphere("white", np.array([98.0, 366.0]), 41.0, diameter_mm=90.0)
    assert doubted_diameters([*balls, white]) == []
    (text,) = doubted_diameters([*balls, replace(white, diameter_mm=diameter)])
    assert text.startswith(
        f"the white ball at (98, 366) px: with a diameter of {diameter:g} mm it would stand {times} "
    )
    assert "1 cm = 10 mm, 1 inch = 25.4 mm), and not the radius" in text


@pytest.mark.full
def test_diameters_of_chrome_and_white_exchanged_in_a_real_session(run):
    changes = ("= 100.0", "= 9x.0"), ("= 90.0", "= 100.0"), ("= 9x.0", "= 90.0")
    code, _, (text,) = run("calibrate", *changes)
    assert code == 0
    # 90 mm, seen by lights of nine tenths of their distances.
    found = re.search(r"the white ball contradicts .* unless it is about ([\d.]+) mm across, not 100", text)
    assert found
    assert float(found[1]) == pytest.approx(90 * 0.9, rel=0.02)
    assert "Check diameter_mm of every ball" in text


# The mask and the scan.


def test_an_inverted_mask_is_named():
    mask = np.zeros((60, 80), bool)
    mask[15:45, 20:60] = True
    frames, camera = Frames.from_linear(("a", "b", "c"), np.full((3, 60, 80, 3), 0.3)), Camera.orthographic(80, 60)
    assert find_object(frames, camera, [], mask_given=mask).warnings == ()
    (text,) = find_object(frames, camera, [], mask_given=~mask).warnings
    assert text == "mask: 100% of the picture's border is white. White marks the object: is the mask inverted?"


@pytest.mark.full
def test_radii_given_for_diameters_where_there_is_a_scan(run):
    """The outline fits, the shading does not: it was asked whether this is the scan of another object."""
    code, said, _ = run("align", ("= 100.0", "= 50.0"), ("= 90.0", "= 45.0"))
    assert code == 2
    assert re.search(r"2 times as far from the camera as the balls.*diameter in millimetres, not the radius", said)

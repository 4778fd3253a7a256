"""Slips that only the photographs, their EXIF or the scan tell: units, kinds, masks. One message, with a cure."""

import json
import re
import shutil
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from align.mask.object_mask import find_object
from align.pose.scan_scale import check_distance, doubted_lengths
from calibrate.detection.balls import _match
from calibrate.detection.detect import Rejected
from calibrate.detection.diameters import doubted_diameters
from calibrate.silhouette.ball_silhouette import OutlineFit
from capture.camera.exif import Exif
from capture.camera.focal_length import camera_from_lens
from capture.camera.session_camera import camera_of, fitted
from capture.session.manifest import SessionCameraTable
from capture.session.requests import read_mask
from capture.session.session import load_session
from scene.camera import Camera
from scene.errors import AlignError, SessionError
from scene.files import write_png
from scene.frames import Frames
from scene.spheres import Sphere, SphereRequest
from tests.conftest import FIXTURE

EXIF = Exif(focal_mm=50.0, pixels_per_mm=(160.0, 160.0), width_px=3760, camera="NIKON D7500")
MIRROR = Rejected("chrome", np.array([92.0, 104.0]), 45.0, 0.9, 1.0, "a chrome ball")
BALLS = [Sphere("chrome", np.zeros(2), radius, diameter_mm=100.0) for radius in (45.3, 44.8)]
WHITE = Sphere("white", np.array([98.0, 366.0]), 41.0, diameter_mm=90.0)
MASK = np.pad(np.ones((30, 40), bool), ((15, 15), (20, 20)))


@pytest.mark.parametrize(
    ("verb", "changes", "code", "told"),
    [
        # The glob of the flash frames matches the ambient frame that nobody listed.
        (
            "check", [("raw/flash_*", "raw/*"), ('ambient = "raw/ambient_*.dng"\n', "")], 2,
            r"^rgbn: ambient_000: the flash did not fire.*belongs under frames\.ambient\.$",
        ),
        # Told before balls are sought; a scan would find its place by the outline.
        (
            "calibrate", [("raw/flash_*", "raw/flash_00[01]"), ('scan = "scan/object.ply"\nscan_unit = "mm"\n', "")], 2,
            r"^rgbn: lights: found 2, photometric stereo needs at least 3\. Shoot more flash frames\.$",
        ),
        # The outline fits, the shading does not: it was asked whether this is the scan of another object.
        pytest.param(
            "align", [("= 100.0", "= 50.0"), ("= 90.0", "= 45.0")], 2,
            r"^rgbn: .*2 times as far from the camera as the balls.*diameter in millimetres, not the radius",
            marks=pytest.mark.full,
        ),
        # Of chrome and white exchanged: 90 mm, seen by lights of nine tenths of their distances.
        pytest.param(
            "calibrate", [("= 100.0", "= 9x.0"), ("= 90.0", "= 100.0"), ("= 9x.0", "= 90.0")], 0,
            r"the white ball contradicts .* unless it is about (?:79|8[0-2])\S* mm across, not 100.*"
            "Check diameter_mm of every ball", marks=pytest.mark.full,
        ),
    ],
)  # fmt: skip
def test_what_the_photographs_tell_of_session_toml(run_rgbn, tmp_path, verb, changes, code, told):
    session = shutil.copytree(FIXTURE, tmp_path / "session", ignore=shutil.ignore_patterns("truth.*"))
    text = (session / "session.toml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (session / "session.toml").write_text(text)
    found, _, said = run_rgbn(verb, session, "--out", tmp_path / "out")
    assert found == code, said
    if code:
        (text,) = [line for line in said.splitlines() if line.startswith("rgbn: ")]
    else:
        (text,) = [one["text"] for one in json.loads((tmp_path / "out" / "summary.json").read_text())["warnings"]]
    assert re.search(told, text), said


def of_lens(**lens):
    return ["\n".join(camera_from_lens(SessionCameraTable(**lens), [EXIF] * 3, 3760, 2506)[1])]


def of_principal_point():
    stated = Camera(640, 480, 900.0, 900.0, 18.0, 12.0)
    camera, told = camera_of(replace(load_session(FIXTURE), camera=stated), [], 640, 480)
    assert camera.cx == 18
    return told


def of_balls(found, asked, rejected=()):
    """Return the warnings for balls found (kind, radius) where others were asked for (kind, diameter)."""
    warnings: list[str] = []
    balls = [OutlineFit(Sphere(kind, np.array([9.0, 9.0]), radius), np.eye(3), 0.1) for kind, radius in found]
    _match(balls, [SphereRequest(kind, diameter) for kind, diameter in asked], [], rejected, warnings)
    return warnings


def of_mask(mask):
    frames = Frames.from_linear(("a", "b", "c"), np.full((3, 60, 80, 3), 0.3))
    return find_object(frames, Camera.orthographic(80, 60), [], mask_given=mask).warnings


@pytest.mark.parametrize(
    ("told", "words"),
    [
        # The camera's lengths in cm and in inch; an adapted lens is none of these.
        (lambda: of_lens(focal_mm=5.0, sensor_mm=2.35), r"^camera\.focal_mm: found 5, but .* 50 mm.*Give millimetres"),
        (lambda: of_lens(focal_mm=50.0, sensor_mm=2.35), r"^camera\.sensor_mm: found 2\.35.* 23\.5.*Give millimetres"),
        (lambda: of_lens(focal_mm=1.97, pixel_um=0.5), r"^camera\.focal_mm: found 1\.97.* 50 mm.*Give millimetres"),
        (lambda: of_lens(focal_mm=85.0, sensor_mm=23.5), r"\A[^\n]*85 mm[^\n]*\Z"),
        (lambda: of_lens(focal_mm=35.0, crop_factor=1.5), r"\A[^\n]*35 mm[^\n]*\Z"),
        (of_principal_point, r"\(18, 12\) lies 47% of the width.*Give pixels of the photographs' size, not mm"),
        # A mirror that nobody listed, a ball that is not in the picture, one of two diameters.
        (
            lambda: of_balls([("chrome", 45.0), ("white", 41.0)], [("chrome", 100.0), ("white", 90.0)], (MIRROR,)),
            r'not list stands at \(92, 104\) px.*is kind wrong there\? A mirror is "chrome", a matte ball "white"\.',
        ),
        (
            lambda: of_balls([("chrome", 45.0), ("white", 41.0)], [("chrome", 100.0)] * 2 + [("white", 90.0)]),
            r"^2 chrome balls asked for, 1 found\. Give center_px and radius_px.*correct its kind, or drop it\.$",
        ),
        (
            lambda: of_balls([("chrome", 45.0), ("chrome", 44.8)], [("chrome", 100.0), ("chrome", None)]),
            "which of 100 mm each is cannot be told.*Give each its diameter_mm",
        ),
        # A diameter of 90 mm in cm, in inch, its radius, and in mm times 25.4.
        *(
            (
                lambda mm=mm: doubted_diameters([*BALLS, replace(WHITE, diameter_mm=mm)]),
                rf"^the white ball at \(98, 366\) px: with a diameter of {mm:g} mm it would stand {times} .*"
                r"1 cm = 10 mm, 1 inch = 25\.4 mm\), and not the radius",
            )
            for mm, times in ((9.0, r"0\.099"), (3.54, r"0\.039"), (45.0, r"0\.5"), (2286.0, "25"))
        ),
        (lambda: of_mask(~MASK), "^mask: 100% of the picture's border is white.*is the mask inverted"),
    ],
)  # fmt: skip
def test_a_slip_is_one_warning_with_its_cure(told, words):
    (text,) = told()
    assert re.search(words, text, re.MULTILINE), text


def test_what_is_no_slip_is_no_warning():
    assert doubted_diameters([*BALLS, WHITE]) == []
    assert of_mask(MASK) == ()
    assert "Give millimetres" not in of_lens(focal_mm=85.0, sensor_mm=23.5)[0]


def test_pictures_that_a_viewer_turns(tmp_path):
    """EXIF's orientation is not applied: a size, or a mask, of the turned picture is named as turned."""
    with pytest.raises(SessionError, match=r"found 480 x 640, but the frames are 640 x 480.*not turned by EXIF"):
        fitted(Camera(480, 640, 900.0, 900.0, 228.0, 330.0), load_session(FIXTURE), 640, 480)
    write_png(tmp_path / "mask.png", np.eye(6, 4, dtype=np.uint8) * 255)
    with pytest.raises(SessionError, match=r"the mask is 4 x 6 px, the frames 6 x 4.*not turned by EXIF"):
        read_mask(tmp_path / "mask.png", 4, 6)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (0.001, "1,000.0 times too small (m and mm exchanged?), or diameter_mm of the balls so much too large"),
        (0.1, "10.0 times too small (cm and mm exchanged?)"),
        (1 / 25.4, "25.4 times too small (inch and mm exchanged?)"),
        (25.8, "25.8 times too large (inch and mm exchanged?), or diameter_mm of the balls so much too small"),
        (4.0, "4.0 times too large, or diameter_mm"),
    ],
)
def test_a_scan_in_another_unit(factor, words):
    lights = SimpleNamespace(reference_point_mm=np.array([0.0, 0.0, -1000.0]))
    photographs: Any = SimpleNamespace(lights=lights, camera=Camera(64, 48, 90.0, 90.0, 32.0, 24.0), cut_words="")
    with pytest.raises(AlignError, match="scan_unit under") as told:
        check_distance(photographs, 1000 * factor)
    assert str(told.value).startswith(f"scan: about {words}")
    check_distance(photographs, 1100)
    assert doubted_lengths(photographs, 1100) == ""
    assert "2 times as far" in doubted_lengths(photographs, 2000)

"""Photographs and a session that nobody here made: what must hold without tuning on them."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from calibrate.calibrate import calibrate
from calibrate.skin import read_skin, shading_directions
from scene.camera import Camera
from scene.frames import Frames
from scene.normals import angular_error_deg
from scene.spheres import SphereRequest

SHARED = Path(__file__).parents[2] / ".." / "shared"


def _need(folder: Path) -> Path:
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent: it is handed out beside the repository")
    return folder


def _uw(name):
    folder = _need(SHARED / "real" / "uw_psm") / "png" / name
    images = [cv2.imread(str(folder / f"{name}.{i}.png"))[..., ::-1] / np.float32(255) for i in range(12)]
    return Frames.from_linear(tuple(f"{name}.{i}" for i in range(12)), np.stack(images))


def test_uw_psm_chrome_explains_gray():
    """Checked by eye, outlines drawn over the photographs; the numbers are the circles of the set's masks."""
    camera = Camera.orthographic(512, 340)
    result = calibrate(
        _uw("buddha"),
        camera,
        [SphereRequest("chrome", frames=_uw("chrome")), SphereRequest("white", frames=_uw("gray"))],
    )
    chrome, gray = (next(s for s in result.spheres if s.kind == kind) for kind in ("chrome", "white"))
    np.testing.assert_allclose([*chrome.center_px, chrome.radius_px], [253.3, 147.9, 119.4], atol=1.5)
    np.testing.assert_allclose([*gray.center_px, gray.radius_px], [244.5, 144.5, 108.2], atol=1.5)
    table = np.loadtxt(SHARED / "real" / "uw_psm" / "lights.txt", skiprows=1)
    given = table / np.linalg.norm(table, axis=1, keepdims=True)
    # lights.txt is the weaker reference (see the set's README): the gray ball judges.
    assert angular_error_deg(result.lights.directions, given).mean() < 4
    shaded, _ = shading_directions(read_skin(_uw("gray"), camera, gray))
    against_gray = np.median(angular_error_deg(shaded, result.lights.directions))
    assert against_gray < 3.5
    assert against_gray < np.median(angular_error_deg(shaded, given))
    np.testing.assert_allclose(result.lights.intensities, 1, atol=0.06)


def test_columbia_white_ball_on_a_pedestal():
    folder = _need(SHARED / "real" / "columbia_sphere_object")
    images = [cv2.imread(str(folder / f"sphere{i}.pgm"), cv2.IMREAD_GRAYSCALE) / np.float32(255) for i in (1, 2, 3)]
    frames = Frames.from_linear(("a", "b", "c"), np.repeat(np.stack(images)[..., None], 3, -1))
    result = calibrate(frames, Camera.orthographic(640, 480), [SphereRequest("white")])
    (ball,) = result.spheres
    np.testing.assert_allclose([*ball.center_px, ball.radius_px], [368, 220.5, 78.5], atol=1.5)
    # The pedestal of about 75 codes is found as ambient.
    assert result.lights.ambient == pytest.approx(np.full(3, 75 / 255), abs=0.03)
    # By eye: lit from below, from the right, from above.
    x, y, _ = result.lights.directions.T
    assert y[0] < -0.3
    assert x[1] > 0.3
    assert y[2] > 0.3


@pytest.mark.slow
def test_bunny_session():
    """Rendered by another program. Balls of 50 px, flashes at 0.8-1.15 m; goals of the issue: 1 degree, 3 %."""
    rawpy = pytest.importorskip("rawpy")
    folder = _need(SHARED / "sessions" / "bunny")
    truth = json.loads((folder / "truth.json").read_text())
    session = tomllib.loads((folder / "session.toml").read_text())

    def raw(path):
        with rawpy.imread(str(path)) as file:
            return file.postprocess(
                output_color=rawpy.ColorSpace.raw,
                no_auto_bright=True,
                gamma=(1, 1),
                output_bps=16,
                user_wb=[1, 1, 1, 1],
                adjust_maximum_thr=0,
                demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR,
            ) / np.float32(65535)

    files = sorted((folder / "raw").glob("flash_*.dng"))
    frames = Frames.from_linear(
        tuple(file.stem for file in files),
        np.stack([raw(file) for file in files]),
        ambient=raw(folder / "raw" / "ambient_000.dng"),
    )
    given = session["camera"]
    camera = Camera(*(given[key] for key in ("width", "height", "fx", "fy", "cx", "cy")))
    requests = [SphereRequest(ball["kind"], ball["diameter_mm"]) for ball in session["spheres"]]
    result = calibrate(replace(frames, is_mosaic=True), camera, requests)
    for ball in truth["spheres"]:
        mine = min(result.spheres, key=lambda s: np.hypot(*(s.center_px - ball["centre_px"])))
        assert mine.kind == ball["kind"]
        np.testing.assert_allclose(mine.center_px, ball["centre_px"], atol=0.25)
        assert mine.radius_px == pytest.approx(ball["radius_px"], abs=0.4)
    lights = result.lights.seen_from(truth["object_centre_mm"])
    angle = angular_error_deg(lights.directions, np.array(truth["directions_at_object"]))
    assert np.median(angle) < 0.5
    assert angle.max() < 1.0
    error = lights.intensities / np.array(truth["relative_intensity_rgb_at_object"]) - 1
    assert np.sqrt(np.mean(error**2)) < 0.015

"""Colours by a chart: known cameras and lights are found again, and pictures without a chart hold none."""

from dataclasses import replace
from datetime import datetime

import cv2
import numpy as np
import pytest

from capture.camera.colour_chart import camera_colours, fit_colours, maker_matrix, reference_colours
from capture.photographs.images import read_image
from capture.session.session_types import CaptureSession
from scene.errors import CaptureError
from scene.frames import Frames, decode, encode
from twin.camera.virtual_camera import Sensor, write_dng

CAMERA = np.array([[0.62, 0.3, 0.08], [0.2, 0.7, 0.1], [0.03, 0.27, 0.7]])
"""Camera RGB of linear sRGB: its filters overlap."""
LIGHTS = {"D65": (0.55, 1.0, 0.75), "A": (1.0, 0.8, 0.25), "flash": (0.65, 1.0, 0.6)}
"""The camera's RGB of white under each."""
PATCH, GAP = 40, 6


def photographed(corners, *, light="flash", white=0.7, seed=0, size=(640, 960), clutter=60):
    """Return a photograph (H, W, 3) of a chart with these corners (4, 2) on things of other colours."""
    rng, (height, width) = np.random.default_rng(seed), size
    scene = np.full((height, width, 3), 0.2, np.float32)
    for _ in range(clutter):
        low = rng.integers(0, [width, height])
        cv2.rectangle(
            scene, low.tolist(), (low + rng.integers(20, 200, 2)).tolist(), rng.uniform(0, 0.9, 3).tolist(), -1
        )
    chart = np.full((4 * PATCH + 5 * GAP, 6 * PATCH + 7 * GAP, 3), 0.03, np.float32)
    for place, colour in enumerate(reference_colours()):
        top, left = (GAP + at * (PATCH + GAP) for at in divmod(place, 6))
        chart[top : top + PATCH, left : left + PATCH] = colour
    across, down = chart.shape[1], chart.shape[0]
    plane = np.float32([[0, 0], [across, 0], [across, down], [0, down]])
    turn, how = cv2.getPerspectiveTransform(plane, np.float32(corners)), {"flags": cv2.INTER_AREA}
    inside = cv2.warpPerspective(np.ones((down, across), np.float32), turn, (width, height), **how)[..., None]
    scene = scene * (1 - inside) + cv2.warpPerspective(chart, turn, (width, height), **how) * inside
    linear = cv2.GaussianBlur(white * scene @ CAMERA.T * LIGHTS[light], (0, 0), 0.7)
    return linear + rng.normal(0, 1, linear.shape) * np.sqrt(np.maximum(linear, 1e-5) / 5000)


def seen(picture):
    return Frames(("a",), encode(picture)[None], np.ones(1), None, 0.98)


def session(tmp_path, picture):
    path = tmp_path / "chart.png"
    cv2.imwrite(str(path), np.round(65535 * np.clip(picture, 0, 1)).astype(np.uint16)[..., ::-1])
    return CaptureSession("s", tmp_path, (tmp_path / "a.png",), ("a",), (0,), chart=path)


def placed(turn_deg, tilt, width, center=(480, 320)):
    """Return the corners of a chart that is turned in the picture, and whose right side is nearer by a share."""
    x, y = np.array([-0.5, 0.5, 0.5, -0.5]), np.array([-1, -1, 1, 1]) / 3
    near, angle = width / (1 - tilt * x), np.radians(turn_deg)
    turned = np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], 1)
    return turned * near[:, None] + center


@pytest.mark.parametrize("light", LIGHTS)
def test_a_known_camera_is_found_whatever_the_light_and_its_fall_off(light):
    rng, (v, u) = np.random.default_rng(3), np.divmod(np.arange(24), 6)
    patches = reference_colours() @ CAMERA.T * LIGHTS[light] * (1 + 0.3 * (u / 5 - 0.5) - 0.1 * (v / 3 - 0.5))[:, None]
    exact, noisy = fit_colours(0.37 * patches), fit_colours(patches * rng.normal(1, 0.005, patches.shape))
    assert exact.camera_to_srgb == pytest.approx(np.linalg.inv(0.37 * np.diag(LIGHTS[light]) @ CAMERA), rel=1e-6)
    assert exact.fall_off == pytest.approx(0.3, rel=1e-6)
    assert exact.median < 1e-6
    assert noisy.median < 0.5
    patches[18] = np.nan
    assert fit_colours(patches).used == 23
    # Colours in another order are no chart.
    assert fit_colours(rng.permutation(patches)).median > 10


@pytest.mark.parametrize(
    ("turn_deg", "tilt", "width"), [(0, 0, 420), (25, 0.15, 360), (100, 0.2, 300), (180, 0.1, 110)]
)
def test_a_chart_is_found_turned_tilted_and_small(tmp_path, turn_deg, tilt, width):
    picture = photographed(placed(turn_deg, tilt, width))
    known, warnings = camera_colours(session(tmp_path, picture), seen(picture))
    truth = np.linalg.inv(0.7 * np.diag(LIGHTS["flash"]) @ CAMERA)
    assert (known["source"], warnings) == ("chart", ())
    assert known["delta_e_2000"]["median"] < 1
    others = np.random.default_rng(1).uniform(0.05, 0.9, (200, 3))
    assert others @ np.linalg.inv(truth).T @ known["camera_to_srgb"].T == pytest.approx(others, abs=0.02)


def test_clipped_patches_are_left_out_and_named(tmp_path):
    bright = np.clip(photographed(placed(0, 0, 420), white=1.3), 0, 1)
    known, warnings = camera_colours(session(tmp_path, bright), seen(bright))
    assert known["patches"] < 24
    assert "clipped" in warnings[0]
    assert known["delta_e_2000"]["median"] < 1
    with pytest.raises(CaptureError, match="same size"):
        camera_colours(session(tmp_path, bright[:300]), seen(bright))


@pytest.mark.parametrize(
    ("white", "width", "channels", "said"),
    [
        (4, 420, (0, 1, 2), "read: .* patches are clipped"),
        (0.7, 420, (0, 1, 1), "has the median"),
        (0.7, 20, (0, 1, 2), "read: "),
    ],
)
def test_a_chart_that_cannot_be_used_is_refused(tmp_path, white, width, channels, said):
    picture = np.clip(photographed(placed(0, 0, width), white=white), 0, 1)[..., channels]
    with pytest.raises(CaptureError, match=said):
        camera_colours(session(tmp_path, picture), seen(picture))


def test_a_chart_in_a_flash_frame_is_read_there(tmp_path):
    picture = photographed(placed(0, 0, 420))
    made = session(tmp_path, np.zeros((8, 8, 3)))
    known, _ = camera_colours(replace(made, flash=(made.chart,)), seen(picture))
    assert (known["flash"], known["source"]) == (0, "chart")


def test_a_real_chart_gives_nearly_the_makers_matrix(shared, tmp_path):
    chart = shared("real/raw_dng/colorchart.dng")
    made = CaptureSession("s", tmp_path, (tmp_path / "a.dng",), ("a",), (0,), chart=chart)
    known, _ = camera_colours(made, seen(np.zeros((1156, 1734, 3))))
    assert known["delta_e_2000"]["median"] < 3
    # It is lit by a lamp and a window at once, and out of focus.
    own, by_chart = maker_matrix(chart), known["camera_to_srgb"]
    assert by_chart * np.linalg.solve(by_chart, np.ones(3)) == pytest.approx(own, abs=0.45)
    assert own.sum(1) == pytest.approx(1, abs=1e-3)


def test_the_makers_matrix_of_a_camera_that_sees_srgb_is_none(tmp_path):
    path = tmp_path / "a.dng"
    shot = {"exposure_s": 0.01, "iso": 100, "aperture": 8, "focal_mm": 50, "time": datetime(2026, 1, 1)}
    write_dng(path, np.full((64, 64), 600, np.uint16), Sensor(), **shot)
    assert maker_matrix(path) == pytest.approx(np.eye(3), abs=1e-3)


@pytest.mark.parametrize(
    "name",
    ["diligent/ballPNG/001.png", "uw_psm/png/owl/owl.0.png", "psdata_cat/Image_01.png", "ycbv/data/000001-color.png"],
)
def test_real_photographs_without_a_chart_hold_none(shared, tmp_path, name):
    picture = decode(read_image(shared(f"real/{name}"), "linear").codes)
    with pytest.raises(CaptureError, match="shows no ColorChecker"):
        camera_colours(session(tmp_path, picture), seen(picture))

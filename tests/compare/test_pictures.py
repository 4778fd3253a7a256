"""Pictures: axes, half pixels, unknown pixels, brightness."""

import cv2
import numpy as np
import pytest

from compare.report import pictures
from compare.report.pictures import Exposure, PixelBox
from scene.frames import Frames


def frames_of(linear):
    return Frames.from_linear(tuple(f"f{i}" for i in range(len(linear))), np.asarray(linear, np.float32))


def test_normals_are_red_to_the_right_green_upward_blue_toward_the_viewer():
    ball = pictures.legend_ball(101).astype(int)
    left, right, top, bottom, middle = ball[50, 3], ball[50, 97], ball[3, 50], ball[97, 50], ball[50, 50]
    assert right[0] > 240 > 20 > left[0]
    assert top[1] > 240 > 20 > bottom[1]
    assert middle.tolist() == [128, 128, 255]
    assert (ball[2, 2] == pictures.PAPER).all()


def test_shrinking_averages_the_known_and_leaves_the_unknown():
    image = np.array([[1.0, np.nan, np.nan, np.nan], [3.0, 5.0, np.nan, np.nan]])
    np.testing.assert_allclose(pictures.shrink(image, 2), [[3.0, np.nan]])
    three = np.repeat(image[..., None], 3, -1)
    np.testing.assert_allclose(pictures.shrink(three, 2)[0, 0], 3.0)
    assert pictures.shrink(image, 9).shape == image.shape


def test_the_error_colours_rise_evenly_in_lightness_and_stop_at_the_end():
    codes = pictures.error_picture(np.linspace(0, 12, 121)[None], 10.0)
    lightness = cv2.cvtColor(codes, cv2.COLOR_RGB2LAB)[0, :, 0].astype(int)
    assert (np.diff(lightness) >= -1).all()
    assert lightness[-1] - lightness[0] > 150
    # Even: no fifth of the scale takes less than half of its share of the lightness.
    assert np.diff(lightness[[0, 20, 40, 60, 80, 100]]).min() > 0.1 * (lightness[-1] - lightness[0])
    assert (codes[0, 100:] == codes[0, -1]).all()
    assert (pictures.error_picture(np.array([[np.nan]]), 10.0) == pictures.PAPER).all()


def test_one_exposure_for_all_frames_and_the_white_balls_colour():
    linear = np.full((2, 40, 60, 3), 0.2) * np.array([1.0, 0.8, 0.5])
    linear[1] *= 0.25
    frames = frames_of(linear)
    exposure = Exposure.for_frames(frames, white_value=np.array([1.0, 0.8, 0.5]))
    bright, dark = (exposure.develop(pictures.thumbnail(frames, i, 30)) for i in (0, 1))
    assert np.ptp(bright[10, 10].astype(int)) <= 1
    assert bright[10, 10, 0] > 250
    # sRGB of a quarter is 137.
    assert dark[10, 10, 0] == pytest.approx(137, abs=2)


def test_a_thumbnail_shows_the_cut_and_keeps_its_mean():
    rng = np.random.default_rng(0)
    linear = rng.uniform(0, 0.5, (1, 600, 800, 3))
    linear[0, :, 400:] += 0.4
    small = pictures.thumbnail(frames_of(linear), 0, 40, PixelBox(200, 100, 600, 500))
    assert small.shape == (40, 40, 3)
    assert small[:, 20:].mean() - small[:, :20].mean() == pytest.approx(0.4, abs=0.02)
    assert small[:, :20].mean() == pytest.approx(0.25, abs=0.02)

"""Photographs against their twins: PSNR and SSIM by their definitions, whatever the lamp's strength."""

import numpy as np
import pytest

from compare.statistics.frames_alike import frames_alike
from formats.picture_files import srgb_from_linear
from scene.frames import Frames

NAMES = ("a", "b", "c")


@pytest.fixture
def scene():
    rng = np.random.default_rng(1)
    v, u = np.mgrid[:90, :120]
    mask = np.hypot(u - 60, v - 45) < 35
    images = np.stack([0.2 + 0.3 * (np.cos(u / 9 + k) * np.sin(v / 7) + 1) / 2 for k in range(3)])[..., None] * [
        1,
        0.9,
        0.8,
    ]
    return images, mask, rng


def _frames(images):
    return Frames.from_linear(NAMES, images)


def test_a_copy_is_the_same_picture_whatever_its_strength(scene):
    images, mask, _ = scene
    dimmed = images * [0.5, 0.7, 0.6]
    # What lies beside the object does not count.
    dimmed[:, ~mask] = 0.9
    for row in frames_alike(_frames(images), _frames(dimmed), mask)["frames"]:
        assert row["psnr_db"] > 70
        assert row["ssim"] > 0.999


def test_noise_costs_what_its_square_says_and_shuffled_frames_are_told(scene):
    images, mask, rng = scene
    noisy = images + rng.normal(0, 0.02, images.shape)
    found = frames_alike(_frames(images), _frames(noisy), mask)
    rows = found["frames"]
    assert found["ssim"] == np.median([row["ssim"] for row in rows])
    assert [row["name"] for row in rows] == list(NAMES)
    white = np.quantile(images[:, mask], 0.999)
    shown = [srgb_from_linear(np.clip(one / white, 0, 1)) for one in (images[0], noisy[0])]
    assert rows[0]["psnr_db"] == pytest.approx(-10 * np.log10(np.mean((shown[0] - shown[1])[mask] ** 2)), abs=0.3)
    turned = frames_alike(_frames(images), _frames(images[[1, 2, 0]]), mask)["frames"]
    assert max(row["ssim"] for row in turned) < min(row["ssim"] for row in rows)


def test_nothing_is_told_of_no_pixels(scene):
    images, mask, _ = scene
    assert frames_alike(_frames(images), _frames(images), np.zeros_like(mask)) is None

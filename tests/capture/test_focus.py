"""A frame that is softer than the others: by a blur that the test makes, under light that moves."""

import cv2
import numpy as np
import pytest

from capture.audit.focus import SOFT_PX, blur_px, focus_warnings
from capture.audit.frame_facts import facts_of
from scene.frames import Frames

COUNT, BLURRED = 8, 5


def frames_of(blur, *, count=COUNT, seed=10_040):
    """Frames of a textured relief, each lit from its own side; one blurred before its noise."""
    rng = np.random.default_rng(seed)
    texture = cv2.GaussianBlur(rng.random((240, 320)).astype(np.float32), (0, 0), 2)
    texture = 0.3 + 0.5 * (texture > np.median(texture))
    texture = cv2.GaussianBlur(texture.astype(np.float32), (0, 0), 0.7)
    v, u = np.mgrid[:240, :320] / 320 - 0.5
    pictures = []
    for i in range(count):
        angle = 2 * np.pi * i / count
        picture = texture * (0.5 + 0.4 * (np.cos(angle) * u + np.sin(angle) * v)).astype(np.float32)
        if i == BLURRED and blur:
            picture = cv2.GaussianBlur(picture, (0, 0), blur)
        noise = rng.normal(0, 0.004, (*picture.shape, 3))
        pictures.append(picture[..., None] + noise)
    frames = Frames.from_linear(tuple(f"f{i}" for i in range(count)), np.array(pictures))
    return frames, [facts_of(codes) for codes in frames.codes]


@pytest.mark.parametrize("blur", [1.0, 1.5, 2.5])
def test_a_blur_is_measured_in_pixels_and_no_other_frame_is_soft(blur):
    found = blur_px(*frames_of(blur))
    assert found[BLURRED] == pytest.approx(blur, rel=0.25)
    assert np.abs(np.delete(found, BLURRED)).max() < 0.7


def test_a_soft_frame_is_named_and_sound_ones_are_not():
    assert focus_warnings(*frames_of(0.0)) == []
    (told,) = focus_warnings(*frames_of(2 * SOFT_PX))
    assert told.startswith(f"f{BLURRED}: is softer than the other frames")

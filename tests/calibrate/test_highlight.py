"""Highlights to a tenth of a pixel: discs that are blurred, clipped, noisy, and not alone."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from calibrate.coarse import shrink
from calibrate.highlight import find_spots
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Sphere

SIZE = 160
CAMERA = Camera.orthographic(SIZE, SIZE)
BALL = Sphere("chrome", np.array([80.0, 80.0]), 60.0)


def _disc(u, v, radius, oversample=8):
    step = (np.arange(SIZE * oversample) + 0.5) / oversample - 0.5
    fine = np.hypot(step[:, None] - v, step[None] - u) < radius
    return fine.reshape(SIZE, oversample, SIZE, oversample).mean((1, 3))


def _frames(places, radius, brightness, extra=None):
    rng = np.random.default_rng(0)
    images = []
    for u, v in places:
        image = 0.02 + brightness * gaussian_filter(_disc(u, v, radius), 0.8)
        if extra is not None:
            image = image + extra
        images.append(np.clip(image + 5e-4 * rng.normal(size=image.shape), 0, 1))
    return Frames.from_linear(tuple(str(i) for i in range(len(places))), np.repeat(np.stack(images)[..., None], 3, -1))


PLACES = [(60.2, 70.7), (95.45, 62.3), (80.0, 100.5), (101.9, 88.1), (66.3, 91.6)]


@pytest.mark.parametrize("radius", [0.6, 1.7, 4.0])
@pytest.mark.parametrize("brightness", [0.5, 20.0], ids=["within white", "20 times clipped"])
def test_centre_of_the_disc(radius, brightness):
    frames = _frames(PLACES, radius, brightness)
    spots = find_spots(frames, CAMERA, shrink(frames, CAMERA), BALL)
    error = spots.pixels[:, 0] - PLACES
    assert np.sqrt(np.mean(error**2)) < 0.09
    assert np.abs(error).max() < 0.15
    assert (spots.sigma_px[:, 0] < 0.4).all()


def test_what_stands_still_is_no_highlight():
    """A mirrored window is brighter than the flash, but it is there in every frame."""
    window = 0.9 * gaussian_filter(_disc(75.0, 55.0, 5.0), 0.8)
    frames = _frames(PLACES, 1.2, 0.6, extra=window)
    spots = find_spots(frames, CAMERA, shrink(frames, CAMERA), BALL)
    assert np.abs(spots.pixels[:, 0] - PLACES).max() < 0.3


def test_a_frame_without_flash_has_no_highlight():
    dark = _frames([*PLACES, (0.0, 0.0)], 1.2, 0.6)
    spots = find_spots(dark, CAMERA, shrink(dark, CAMERA), BALL)
    assert np.isfinite(spots.pixels[:5, 0]).all()
    assert np.isnan(spots.pixels[5]).all()

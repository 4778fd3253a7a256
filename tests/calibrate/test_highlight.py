"""Highlights to hundredths of a pixel: discs that are bent, blurred, clipped, noisy, mosaicked, and not alone."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from calibrate.detection.coarse import shrink
from calibrate.lights.agreement import agreed
from calibrate.lights.directions import Shading, mirrored_at, no_shading
from calibrate.lights.highlight import PEAKS, Peaks, find_peaks, find_spots
from calibrate.lights.reflected_disc import _image
from fixtures.ball_scene import flashes
from scene.camera import Camera
from scene.frames import PEDESTAL, WHITE, Frames
from scene.normals import unit
from scene.spheres import Sphere
from tests.calibrate.test_positions import CAMERA as SEEN
from tests.calibrate.test_positions import CENTERS, _spheres, fermat

SIZE = 160
CAMERA = Camera.orthographic(SIZE, SIZE)
BALL = Sphere("chrome", np.array([80.0, 80.0]), 60.0)
PLACES = [(60.2, 70.7), (95.45, 62.3), (80.0, 100.5), (101.9, 88.1), (66.3, 91.6)]
FINE = 8


def _mirrored(x, y):
    """Where an orthographic view is reflected to by a unit ball: doubled normal less view."""
    z = np.sqrt(np.maximum(1 - x * x - y * y, 0))
    return np.stack([2 * z * x, 2 * z * y, 2 * z * z - 1], -1)


def _disc(u, v, degrees, blur=0.8):
    """A round flash of an angular radius, centred where (u, v) looks; the lens blurs before the sensor samples."""
    half = 28
    left, top = int(u) - half, int(v) - half
    step = (np.arange(2 * half * FINE) + 0.5) / FINE - 0.5
    x, y = np.meshgrid((left + step - 80) / 60, (top + step - 80) / 60)
    flash = _mirrored(x, y) @ _mirrored(np.array((u - 80) / 60), np.array((v - 80) / 60)) > np.cos(np.deg2rad(degrees))
    fine = gaussian_filter((flash & (x * x + y * y < 1)).astype(np.float32), blur * FINE)
    image = np.zeros((SIZE, SIZE))
    image[top : top + 2 * half, left : left + 2 * half] = fine.reshape(2 * half, FINE, 2 * half, FINE).mean((1, 3))
    return image


def _frames(places, degrees, brightness, mosaic=False, colour=(1.0, 1.0, 1.0)):
    rng = np.random.default_rng(0)
    images = []
    for u, v in places:
        image = (0.02 + brightness * _disc(u, v, degrees))[..., None] * colour
        images.append(np.clip(image + 5e-4 * rng.normal(size=image.shape), 0, 1))
    names = tuple(str(i) for i in range(len(places)))
    if not mosaic:
        return Frames.from_linear(names, np.stack(images))
    codes = []
    for image in images:
        raw = image[..., 1].copy()
        raw[::2, ::2], raw[1::2, 1::2] = image[::2, ::2, 0], image[1::2, 1::2, 2]
        raw = np.round(raw * (WHITE - PEDESTAL) + PEDESTAL).astype(np.uint16)
        codes.append(cv2.demosaicing(raw, cv2.COLOR_BayerRGGB2RGB))
    return Frames(names, np.stack(codes), np.ones(len(names)), is_mosaic=True)


def _spots(frames):
    coarse = shrink(frames, CAMERA)
    peaks = find_peaks(frames, coarse, BALL)
    return find_spots(frames, CAMERA, coarse, BALL, peaks, np.zeros(len(frames), int))


def _errors(frames):
    spots = _spots(frames)
    return spots.pixels - PLACES, spots.sigma_px


@pytest.mark.parametrize("degrees", [1.0, 3.0, 8.0])
@pytest.mark.parametrize("brightness", [0.5, 20.0], ids=["within white", "20 times clipped"])
def test_the_pixel_that_mirrors_the_flash_centre(degrees, brightness):
    """At 8 degrees the spot's centroid lies 0.1 to 0.3 px beside it: the ball bends the disc."""
    error, sigma = _errors(_frames(PLACES, degrees, brightness))
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert np.abs(error).max() < 0.06
    assert (np.abs(error) < 3.5 * sigma[:, None]).all()
    assert (sigma < 0.06).all()


@pytest.mark.parametrize("brightness", [0.8, 30.0], ids=["within white", "30 times clipped"])
def test_a_mosaic_is_read_at_its_own_samples(brightness):
    error, sigma = _errors(_frames(PLACES, 1.5, brightness, mosaic=True, colour=(0.6, 1.0, 0.75)))
    assert np.sqrt(np.mean(error**2)) < 0.04
    assert (np.abs(error) < 3.5 * sigma[:, None]).all()


def test_a_frame_without_flash_has_no_highlight():
    dark = _frames([*PLACES, PLACES[0]], 2.0, 0.6)
    dark.codes[5] = _frames(PLACES[:1], 2.0, 0.0).codes[0]
    spots = _spots(dark)
    assert np.isfinite(spots.pixels[:5]).all()
    assert np.isnan(spots.pixels[5]).all()


def test_derivatives_of_the_model():
    rng = np.random.default_rng(1)
    offset, bend = rng.uniform(-6, 6, (50, 2)), 0.1 * rng.normal(size=(50, 2))
    x = np.array([0.3, -0.2, 1.2, 0.9, 0.7, 0.2, 0.3, 0.05, 0.01, -0.02, 0.4])
    image, slopes = _image(x, offset, bend)
    assert np.isfinite(image).all()
    for i in range(len(x)):
        step = 1e-6 * np.eye(len(x))[i]
        ends = [_image(y, offset, bend)[0] for y in (x + step, x - step)]
        difference = (ends[0] - ends[1]) / 2e-6
        np.testing.assert_allclose(slopes[:, i], difference, atol=2e-7, rtol=1e-5)


def test_a_streak_of_glare_does_not_draw_a_clipped_flash_along():
    """Scratches smear a flash to one side: the core's middle is taken, and that is said."""
    frames = _frames(PLACES, 8.0, 30.0)
    images = np.stack([frames.frame(f) for f in range(len(PLACES))])
    rows, columns = np.mgrid[:SIZE, :SIZE]
    for image, (u, v) in zip(images, PLACES, strict=True):
        along = np.maximum(rows - v, 0)
        streak = np.exp(-0.5 * ((columns - u - 0.3 * along) / 1.5) ** 2 - along / 8) * (rows > v)
        image += (24 * streak)[..., None].astype(image.dtype)
    streaked = Frames.from_linear(frames.names, np.clip(images, 0, 1))
    spots = _spots(streaked)
    error = np.linalg.norm(spots.pixels - PLACES, axis=1)
    assert spots.glare.all()
    assert (error < 2.5 * spots.sigma_px).all()
    assert not _spots(frames).glare.any()


def test_what_the_flash_lights_is_one_place_beside_the_flash():
    """A table's gloss is mirrored larger and as bright; a clipped plateau is one place, however many pixels it has."""
    frames = _frames(PLACES, 2.0, 30.0)
    images = np.stack([frames.frame(f) for f in range(len(PLACES))])
    gloss = _disc(80.0, 50.0, 12.0)[..., None].astype(images.dtype)
    images[1::2] = np.clip(images[1::2] + 30 * gloss, 0, 1)
    glossy = Frames.from_linear(frames.names, images)
    peaks = find_peaks(glossy, shrink(glossy, CAMERA), BALL)
    for f, places in enumerate(peaks.pixels):
        assert np.isfinite(places[:, 0]).sum() == 1 + f % 2
        assert np.nanmin(np.linalg.norm(places - PLACES[f], axis=1)) < 5


def _flashes(camera, balls, peaks, shading):
    """Return the places (S, F, 2) that are taken for the flash."""
    chosen = agreed(camera, balls, peaks, shading)
    return [one.pixels[np.arange(len(which)), which] for one, which in zip(peaks, chosen, strict=True)]


@pytest.mark.parametrize("stated", [True, False], ids=["diameters stated", "no diameter"])
def test_of_bright_places_that_is_the_flash_on_which_the_balls_agree(stated):
    """In a third of all frames each of three balls shows something brighter; the balls stand 2.5 % apart in depth."""
    lights = flashes(8, seed=3)
    shown = np.array([[fermat(center, light) for light in lights] for center in CENTERS])
    rng, balls = np.random.default_rng(3), _spheres(3)
    other = np.stack([b.center_px + 0.6 * b.radius_px * rng.uniform(-1, 1, (len(lights), 2)) for b in balls])
    first = rng.random((3, len(lights))) < 1 / 3
    first[:, first.sum(0) > 1] = False
    places = np.full((3, len(lights), PEAKS, 2), np.nan)
    places[:, :, 0] = np.where(first[..., None], other, shown)
    places[:, :, 1] = np.where(first[..., None], shown, other)
    strength = np.where(np.isfinite(places[..., 0]), np.array([1.0, 0.6, np.nan]), np.nan)
    peaks = [Peaks(*one) for one in zip(places, strength, strict=True)]
    spheres = balls if stated else [Sphere("chrome", b.center_px, b.radius_px) for b in balls]
    assert first.any(1).all()
    for ball, pixels in enumerate(_flashes(SEEN, spheres, peaks, no_shading(len(lights)))):
        np.testing.assert_array_equal(pixels, shown[ball])
    # One ball alone cannot know: its brightest place stays. A white ball beside it tells.
    (alone,) = _flashes(SEEN, spheres[:1], peaks[:1], no_shading(len(lights)))
    np.testing.assert_array_equal(alone, places[0, :, 0])
    white = Shading(unit(lights - CENTERS[1])[None], np.full((1, len(lights)), 0.3), CENTERS[None, 1])
    (beside,) = _flashes(SEEN, balls[:1], peaks[:1], white)
    np.testing.assert_array_equal(beside, shown[0])


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_a_fainter_place_on_which_balls_agree_is_no_flash_where_nothing_is_known_of_the_camera(count):
    """An orthographic camera stands for an unknown one: it does not know where each ball sees near flashes."""
    lights = flashes(8, seed=3) + [0, 0, 1000]
    turn = np.arange(count) * 2 * np.pi / count
    balls = [Sphere("chrome", 80 + 30 * np.array([np.cos(a), np.sin(a)]), 6.0, 40.0) for a in turn]
    near = [mirrored_at(CAMERA, ball, lambda x: unit(lights - x)) for ball in balls]
    far = [mirrored_at(CAMERA, ball, lambda x: unit(lights[::-1] * [1, 1, 20])) for ball in balls]
    strength = np.tile([1.0, 0.3], (len(lights), 1))
    peaks = [Peaks(np.stack(one, 1), strength) for one in zip(near, far, strict=True)]
    for pixels, flash in zip(_flashes(CAMERA, balls, peaks, no_shading(len(lights))), near, strict=True):
        np.testing.assert_array_equal(pixels, flash)

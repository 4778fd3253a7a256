"""Frames that the others contradict: exactly these are named, with the cause, or corrected; sound ones are not."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, dome, even_cap, gloss, lights_along, matte
from scene.camera import Camera
from solve.frame_intensities import corrected
from solve.frames_at_odds import at_odds

SIZE = 48
CAMERA = Camera.orthographic(SIZE, SIZE)
NORMALS, MASK = dome(SIZE)
FLAT = np.broadcast_to([0.1, -0.2, np.sqrt(0.95)], NORMALS.shape)


def ball(count=10, *, seed=0, normals=NORMALS):
    """Images of a ball with gloss and noise, and its lights, in an order that goes around by chance."""
    rng = np.random.default_rng(seed)
    ways = rng.permutation(even_cap(count, 50.0))
    lights = lights_along(ways, rng.uniform(0.7, 1.4, (count, 3))).normalised()
    images = matte(lights, normals, normals, 0.3 + 0.1 * np.sin(np.arange(SIZE) / 2.5)[:, None])
    shine = 0.2 * gloss(normals, ways, 60)[..., None] + 0.002 * rng.standard_normal(images.shape)
    return images + lights.intensities[:, None, None] * shine, lights


# Intensities: what is stated and what is seen.


def shadowed(count, *, seed=0, normals=NORMALS):
    """Frames of the ball with a cast shadow in each, and its lights."""
    rng = np.random.default_rng(seed)
    images, lights = ball(count, seed=seed, normals=normals)
    for image in images:
        row, column = rng.integers(0, SIZE - 14, 2)
        image[row : row + 14, column : column + 10] *= 0.05
    return as_floats(lights, np.maximum(images, 0)), lights


def stated(lights, factor):
    """The lights as stated where the frames are so many times brighter than that."""
    return replace(lights, intensities=lights.intensities / np.asarray(factor)[:, None]).normalised()


@pytest.mark.parametrize(
    ("count", "off", "by", "word"),
    [
        (12, [4], 0.8, "darker"),
        (12, [0], 1.3, "brighter"),
        (32, list(range(1, 32, 4)), 1.22, "brighter"),
        (32, [31], 0.9, "darker"),
    ],
)
def test_the_frames_whose_intensity_is_off_are_named_and_corrected_and_no_others(count, off, by, word):
    frames, lights = shadowed(count)
    factor = np.ones(count)
    factor[off] = by
    given = stated(lights, factor)
    found, (said,) = corrected(frames, given, CAMERA, MASK)
    ratio = (found.intensities / given.intensities).mean(1)
    np.testing.assert_allclose(ratio, factor, rtol=0.025)
    right = np.setdiff1d(np.arange(count), off)
    np.testing.assert_allclose(ratio[right], 1, rtol=1e-12)
    assert word in said
    assert said.startswith(lights.names[off[0]])
    assert ("and 4 more" in said) == (len(off) == 8)


@pytest.mark.parametrize("count", [12, 24])
@pytest.mark.parametrize("seed", [0, 1])
def test_intensities_that_are_right_or_off_smoothly_or_mostly_are_not_touched(count, seed):
    frames, lights = shadowed(count, seed=seed)
    x, y, _ = lights.directions.T
    wild = np.exp(0.3 * np.random.default_rng(5).standard_normal(count))
    for factor in (np.ones(count), np.full(count, 1.3), 1 + 0.2 * x - 0.1 * y, wild):
        given = stated(lights, factor)
        assert corrected(frames, given, CAMERA, MASK) == (given, [])


def test_nobody_is_accused_where_nothing_tells():
    frames, lights = shadowed(12, normals=FLAT)
    unknown = replace(lights, directions=np.full((12, 3), np.nan))
    for given in (stated(lights, [0.7] + 11 * [1.0]), unknown):
        assert corrected(frames, given, CAMERA, MASK) == (given, [])


# Frames that differ in more than their strength.


def said(images, lights):
    metal, found = at_odds(as_floats(lights, np.maximum(images, 0)), lights, CAMERA, MASK)
    assert metal is None
    return found


@pytest.mark.parametrize("seed", range(4))
def test_sound_frames_are_not_named_however_bright_the_room_is_in_all(seed):
    images, lights = ball(8 + 3 * seed, seed=seed)
    assert said(images, lights) == []
    assert said(3 * images, lights) == []
    assert said(images + 0.1 * lights.intensities[:, None, None], lights) == [], "all frames share it"
    assert said(images[:5], lights.only(slice(5))) == [], "five frames cannot tell"


@pytest.mark.parametrize("odd", [[1], [0, 4], [2, 5, 9]])
def test_frames_of_which_half_the_object_lies_in_shadow_are_named_and_no_others(odd):
    images, lights = ball()
    lit_side = np.sign(lights.directions[odd, 0])[:, None, None]
    images[odd] *= np.where(NORMALS[..., 0] * lit_side > 0, 0.05, 1)[..., None]
    (told,) = said(images, lights)
    assert [name for name in lights.names if name in told] == [lights.names[f] for f in odd]
    assert "stood in the flash's way" in told


def test_a_second_light_that_shines_once_is_named_and_is_no_lamp():
    images, lights = ball()
    images[6] += images[2] * lights.intensities[6] / lights.intensities[2]
    (told,) = said(images, lights)
    assert told.startswith(f"{lights.names[6]}: ")
    assert "second light" in told


@pytest.mark.parametrize("first", [3, 5, 7])
@pytest.mark.parametrize("word", ["on", "off"])
def test_a_lamp_that_is_switched_is_told_with_its_frame(first, word):
    images, lights = ball()
    lamp = 0.1 * np.maximum(NORMALS @ [0.6, 0.0, 0.8], 0)[..., None]
    shines = (np.arange(len(images)) >= first) == (word == "on")
    (told,) = said(images + lamp * shines[:, None, None, None], lights)
    assert told.startswith(f"{lights.names[first]}: from about here on")
    assert f"switched {word} after {lights.names[first - 1]}" in told


def test_photographs_of_a_real_cat_are_sound_until_a_lamp_is_added(shared):
    real = shared("real/diligent/catPNG")
    ways = np.loadtxt(real / "light_directions.txt")[::7]
    powers = np.loadtxt(real / "light_intensities.txt")[::7]
    files = [real / f"{number:03d}.png" for number in range(1, 97, 7)]
    images = np.stack([cv2.imread(str(file), cv2.IMREAD_UNCHANGED)[..., ::-1] / 65535 for file in files])
    mask = cv2.imread(str(real / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    lights = lights_along(ways, powers)
    camera = Camera.orthographic(*mask.shape[::-1])
    assert at_odds(as_floats(lights, images), lights, camera, mask) == (None, [])
    order = np.random.default_rng(1).permutation(len(ways))
    images, lights = images[order], lights.only(order)
    images[8:] += 0.2 * images[1]
    _, (told,) = at_odds(as_floats(lights, images), lights, camera, mask)
    assert "a lamp was switched on" in told
    # Wrong coding and the like look so, too: what was warned of before is not forgotten.
    _, (doubted,) = at_odds(as_floats(lights, images), lights, camera, mask, warned=True)
    assert "unless what is warned of photographs and balls makes it" in doubted
    assert "unless" not in told

"""Frames that the others contradict over a large part of the object are named, with the cause; sound ones are not."""

from pathlib import Path

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, even_cap, lights_along, matte
from scene.camera import Camera
from solve.frames_at_odds import at_odds

SIZE = 48
CAMERA = Camera.orthographic(SIZE, SIZE)
V, U = (np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2) / (0.46 * SIZE)
MASK = U**2 + V**2 < 0.9
REAL = Path(__file__).parents[3] / "shared" / "real" / "diligent" / "catPNG"


def ball(count=10, seed=0):
    """Images of a ball with gloss and noise, and its lights, in an order that goes around by chance."""
    rng = np.random.default_rng(seed)
    normals = np.stack([U, -V, np.sqrt(np.maximum(1 - U**2 - V**2, 0.05))], -1)
    ways = rng.permutation(even_cap(count, 50.0))
    lights = lights_along(ways, rng.uniform(0.7, 1.4, (count, 3))).normalised()
    images = matte(lights, np.zeros((SIZE, SIZE, 3)), normals, 0.3 + 0.1 * np.sin(9 * U)[..., None])
    half = lights.directions + [0.0, 0.0, 1.0]
    shine = np.maximum(np.einsum("hwi,fi->fhw", normals, half / np.linalg.norm(half, axis=1, keepdims=True)), 0) ** 60
    images += (0.2 * shine[..., None] + 0.002 * rng.standard_normal(images.shape)) * lights.intensities[:, None, None]
    return images, lights


def said(images, lights):
    return at_odds(as_floats(lights, np.maximum(images, 0)), lights, CAMERA, MASK)


@pytest.mark.parametrize("seed", range(4))
def test_sound_frames_are_not_named_however_bright_the_room_is_in_all(seed):
    images, lights = ball(8 + 3 * seed, seed)
    assert said(images, lights) == []
    assert said(3 * images, lights) == []
    assert said(images + 0.1 * lights.intensities[:, None, None], lights) == [], "all frames share it"
    assert said(images[:5], lights.only(slice(5))) == [], "five frames cannot tell"


@pytest.mark.parametrize("odd", [[1], [0, 4], [2, 5, 9]])
def test_frames_of_which_half_the_object_lies_in_shadow_are_named_and_no_others(odd):
    images, lights = ball()
    lit_side = np.sign(lights.directions[odd, 0])[:, None, None, None]
    images[odd] *= np.where(U[..., None] * lit_side > 0, 0.05, 1)
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
@pytest.mark.parametrize(("word", "backwards"), [("on", False), ("off", True)])
def test_a_lamp_that_is_switched_is_told_with_its_frame(first, word, backwards):
    images, lights = ball()
    lamp = 0.1 * np.maximum(0.6 * U + 0.8 * np.sqrt(np.maximum(1 - U**2 - V**2, 0)), 0)[..., None]
    changed = images + lamp * (np.arange(len(images)) >= first)[:, None, None, None] * (-1 if backwards else 1)
    changed += lamp * backwards
    (told,) = said(changed, lights)
    assert told.startswith(f"{lights.names[first]}: from about here on")
    assert f"switched {word} after {lights.names[first - 1]}" in told


@pytest.mark.skipif(not REAL.is_dir(), reason=f"{REAL} is not there")
def test_photographs_of_a_real_cat_are_sound_until_a_lamp_is_added():
    import cv2

    ways = np.loadtxt(REAL / "light_directions.txt")[::7]
    powers = np.loadtxt(REAL / "light_intensities.txt")[::7]
    files = [REAL / f"{number:03d}.png" for number in range(1, 97, 7)]
    images = np.stack([cv2.imread(str(file), cv2.IMREAD_UNCHANGED)[..., ::-1] / 65535 for file in files])
    mask = cv2.imread(str(REAL / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    lights = lights_along(ways, powers)
    camera = Camera.orthographic(*mask.shape[::-1])
    assert at_odds(as_floats(lights, images), lights, camera, mask) == []
    order = np.random.default_rng(1).permutation(len(ways))
    images, lights = images[order], lights.only(order)
    images[8:] += 0.2 * images[1]
    (told,) = at_odds(as_floats(lights, images), lights, camera, mask)
    assert "a lamp was switched on" in told
    # Wrong coding and the like look so, too: what was warned of before is not forgotten.
    (doubted,) = at_odds(as_floats(lights, images), lights, camera, mask, warned=True)
    assert "unless what is warned of photographs and balls makes it" in doubted
    assert "unless" not in told

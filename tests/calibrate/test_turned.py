"""Known lights with the usual mistakes: named, by balls or by the object alone; not a word where there is none."""

import numpy as np
import pytest

from calibrate.calibrate import calibrate
from calibrate.known_lights.with_known import contradiction
from fixtures.lit_surfaces import dome, lights_along, matte
from scene.camera import Camera
from scene.frames import Frames
from scene.normals import unit


def directions(count=12, seed=0):
    rng = np.random.default_rng(seed)
    tilt = np.radians(rng.uniform(15, 65, count))
    turn = rng.uniform(0, 2 * np.pi, count)
    return np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)


def names(rows):
    return tuple(f"flash_{i:03d}" for i in range(len(rows)))


def blurred(rows, degrees, seed=1):
    noise = np.random.default_rng(seed).normal(size=rows.shape) * np.radians(degrees)
    return (rows + noise) / np.linalg.norm(rows + noise, axis=1, keepdims=True)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        (lambda d: d * [1, -1, 1], "y flipped: is the file y-down"),
        (lambda d: d * [1, -1, -1], "OpenCV"),
        (lambda d: d * [1, 1, -1], "z-away"),
        (lambda d: d * [-1, 1, 1], "mirrored"),
        (lambda d: d * [-1, -1, 1], "upside down"),
        (lambda d: -d, "every sign"),
        (lambda d: d[:, [1, 0, 2]], "x and y exchanged"),
        (lambda d: d[:, [0, 2, 1]], "y and z exchanged"),
        (lambda d: d[:, [1, 0, 2]] * [1, -1, 1], "turned by 90 degrees to the left"),
        (lambda d: d[:, [1, 0, 2]] * [-1, 1, 1], "turned by 90 degrees to the right"),
        (lambda d: d[::-1], "reverse order"),
        (lambda d: np.roll(d, -1, 0), "1 frame later"),
        (lambda d: directions(seed=77), "no flip or roll"),
    ],
)
def test_the_mistake_is_named(mistake, words, seed):
    true = directions(seed=seed)
    told = contradiction("chrome ball 1", names(true), blurred(true, 1.0), mistake(true))
    assert words in told
    assert told.startswith("lights.file: chrome ball 1 sees its lights")


def test_two_exchanged_lights_are_named():
    """Two of twelve: the median does not see them."""
    true = directions(seed=1)
    a, b = np.unravel_index(np.argmin(true @ true.T), (12, 12))
    order = np.arange(12)
    order[[a, b]] = b, a
    told = contradiction("chrome ball 1", names(true), blurred(true, 1.0), true[order])
    assert told.startswith("lights.file: ")
    assert f"flash_{min(a, b):03d}, flash_{max(a, b):03d}" in told
    assert "exchanged" in told


@pytest.mark.parametrize("seed", range(5))
def test_coarse_but_right_is_no_mistake(seed):
    true = directions(seed=seed)
    seen = blurred(true, 2.0)
    seen[::4] = np.nan
    assert contradiction("x", names(true), seen, true) is None
    assert contradiction("x", names(true), np.full_like(true, np.nan), -true) is None


COUNT = 10


@pytest.fixture(scope="module")
def said():
    """Return what is said of lights in an order, of strengths other than told; the photographs' flashes differ too."""
    rng, (normals, _) = np.random.default_rng(4), dome(80, rim=0.1)
    ways = unit(rng.normal(size=(COUNT, 3)) * [1, 1, 0.2] + [0, 0, 1.6])
    lights = lights_along(ways, rng.uniform(0.7, 1.3, (COUNT, 1)))
    images = matte(lights, normals, normals, 0.5)
    frames = Frames.from_linear(lights.names, images + 0.002 * rng.standard_normal((COUNT, 80, 80, 1)))

    def warnings(order=range(COUNT), factor=1.0):
        told = lights_along(ways[list(order)], lights.intensities[list(order)] * factor).normalised()
        found = calibrate(frames, Camera.orthographic(80, 80), [], known_lights=told)
        return [text for text in found.warnings if text.startswith("lights.file")]

    return warnings


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (np.roll(np.arange(COUNT), -1), "1 frame later"),
        (np.arange(COUNT)[::-1], "in reverse order"),
        ([0, 1, 7, 3, 4, 5, 6, 2, 8, 9], "flash_002 and flash_007 exchanged"),
        ([4, 9, 2, 0, 7, 1, 8, 6, 3, 5], "do not belong to these photographs, or their order is lost"),
    ],
)
def test_another_order_is_named(said, order, words):
    assert said() == []
    (text,) = said(order)
    assert words in text
    assert "Correct lights.file" in text


@pytest.mark.parametrize("odd", [np.where(np.arange(COUNT) % 3, 1, 2), 1 / np.linspace(0.4, 1.6, COUNT)])
def test_other_strengths_are_not_another_order(said, odd):
    """Some frames of half the exposure, which nothing tells: the lights' directions and order are not to blame."""
    (text,) = said(factor=odd[:, None])
    assert "if the flashes' strengths are others than the file's" in text
    assert not any(word in text for word in ("order", "belong", "axes"))

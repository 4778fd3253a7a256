"""Lights from a file in another order than the photographs, and no ball to tell: Lambert's law does."""

import numpy as np
import pytest

from calibrate.calibrate import calibrate
from fixtures.lit_surfaces import dome, lights_along, matte
from scene.camera import Camera
from scene.frames import Frames
from scene.normals import unit

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

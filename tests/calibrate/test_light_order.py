"""Lights from a file in another order than the photographs, and no ball to tell: Lambert's law does."""

import numpy as np
import pytest

from calibrate.calibrate import calibrate
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit

COUNT = 10
NAMES = tuple(f"flash_{i:03d}" for i in range(COUNT))


@pytest.fixture(scope="module")
def session():
    """Photographs of a round body whose flashes differ in power, and the true lights."""
    v, u = np.mgrid[:80, :80]
    x, y = (u - 40) / 36, (40 - v) / 36
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    normals = np.where((z > 0.1)[..., None], np.stack([x, y, z], -1), 0)
    rng = np.random.default_rng(4)
    lights = unit(rng.normal(size=(COUNT, 3)) * [1, 1, 0.2] + [0, 0, 1.6])
    power = rng.uniform(0.7, 1.3, COUNT)
    shade = np.maximum(np.einsum("hwk,fk->fhw", normals, lights), 0) * power[:, None, None] * 0.5
    shade += 0.002 * rng.standard_normal(shade.shape)
    return Frames.from_linear(NAMES, np.repeat(shade[..., None], 3, -1)), lights, power


def said(session, order):
    frames, lights, power = session
    known = Lights(NAMES, lights[order], np.repeat(power[order, None], 3, 1)).normalised()
    found = calibrate(frames, Camera.orthographic(80, 80), [], known_lights=known)
    return [text for text in found.warnings if text.startswith("lights.file")]


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (np.roll(np.arange(COUNT), -1), "1 frame later"),
        (np.arange(COUNT)[::-1], "in reverse order"),
        ([0, 1, 7, 3, 4, 5, 6, 2, 8, 9], "flash_002 and flash_007 exchanged"),
        ([4, 9, 2, 0, 7, 1, 8, 6, 3, 5], "do not belong to these photographs, or their order is lost"),
    ],
)
def test_another_order_is_named(session, order, words):
    assert said(session, np.arange(COUNT)) == []
    (text,) = said(session, np.array(order))
    assert words in text
    assert "Correct lights.file" in text


def test_other_strengths_are_not_another_order(session):
    """Some frames of half the exposure, which nothing tells: the lights' directions and order are not to blame."""
    frames, lights, power = session
    for odd in (np.where(np.arange(COUNT) % 3, 1, 2), 1 / np.linspace(0.4, 1.6, COUNT)):
        known = Lights(NAMES, lights, np.repeat((power * odd)[:, None], 3, 1)).normalised()
        found = calibrate(frames, Camera.orthographic(80, 80), [], known_lights=known)
        (text,) = [text for text in found.warnings if text.startswith("lights.file")]
        assert "if the flashes' strengths are others than the file's" in text
        assert not any(word in text for word in ("order", "belong", "axes"))

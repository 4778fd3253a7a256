"""Lights from a file, no balls: the object's own surface tells in which axes they are."""

import numpy as np
import pytest

from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from solve.axes import lights_in_other_axes

CAMERA = Camera.orthographic(110, 90)


@pytest.fixture(scope="module")
def body():
    """A lopsided round body (F, H, W, 3) under twelve lights, their directions, its mask."""
    v, u = np.mgrid[:90, :110]
    x, y = (u - 55) / 45, (44 - v) / 38
    square = x**2 + y**2
    mask = square < 0.97
    z = np.sqrt(np.maximum(1 - square, 1e-3)) + 0.08 * np.sin(4 * x + 1) * np.cos(3 * y) * (1 - square)
    p, q = np.gradient(z, axis=1) * 45, -np.gradient(z, axis=0) * 38
    normals = np.stack([-p * 45 / 41, -q * 38 / 41, np.ones_like(z)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    rng = np.random.default_rng(2)
    tilt, turn = np.radians(rng.uniform(20, 55, 12)), 2 * np.pi * (np.arange(12) + rng.uniform(0, 0.5, 12)) / 12
    lights = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)
    albedo = 0.5 + 0.1 * np.sin(9 * x) * np.cos(7 * y)
    shade = np.maximum(np.einsum("hwk,fk->fhw", normals, lights), 0) * albedo * mask
    shade += 0.002 * rng.standard_normal(shade.shape)
    return np.repeat(shade[..., None], 3, -1), lights, mask


def told(body, axes):
    images, lights, mask = body
    names = tuple(f"flash_{i:03d}" for i in range(12))
    known = Lights(names, lights @ np.array(axes, float).T, np.ones((12, 3)))
    return lights_in_other_axes(Frames.from_linear(names, images), known, CAMERA, mask)


def test_lights_in_the_right_axes_are_not_doubted(body):
    assert told(body, np.eye(3)) is None


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (np.diag([-1, 1, 1]), "(-x, y, z)"),
        (np.diag([1, -1, 1]), "(x, -y, z)"),
        (np.diag([-1, -1, 1]), "(-x, -y, z)"),
        (np.eye(3)[[0, 2, 1]], "(x, z, y)"),
        ([[0, -1, 0], [1, 0, 0], [0, 0, 1]], "(y, -x, z)"),
    ],
)
def test_the_change_that_puts_them_right_is_named(body, axes, words):
    """A flipped file was used without a word where no ball stood by."""
    text = told(body, axes)
    assert text
    assert text.startswith("lights.file: ")
    assert f"changed to {words};" in text


def test_a_hollow_may_be_one(body):
    """Its slopes are those of the lights as they are; that its rim points inward is no proof."""
    images, lights, mask = body
    names = tuple(f"flash_{i:03d}" for i in range(12))
    # A hollow is lit as the same body is from the other side.
    text = lights_in_other_axes(
        Frames.from_linear(names, images), Lights(names, lights * [-1, -1, 1], np.ones((12, 3))), CAMERA, mask
    )
    assert "points inward at its rim. Unless it is hollow, it makes sense if" in text
    assert "slope" not in text


def test_what_lamberts_law_does_not_fit_is_no_matter_of_axes(body):
    """Lights in another order make no surface either, in whichever axes; of that the order's test speaks."""
    images, lights, mask = body
    names = tuple(f"flash_{i:03d}" for i in range(12))
    for order in (np.roll(np.arange(12), 1), np.random.default_rng(0).permutation(12)):
        known = Lights(names, lights[order], np.ones((12, 3)))
        assert lights_in_other_axes(Frames.from_linear(names, images), known, CAMERA, mask) is None

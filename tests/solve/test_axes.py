"""Lights or normals in other axes, and no ball: the object's own surface tells, where it can; nothing is put right."""

from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import even_cap, gloss, lights_along, matte
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from solve.axes import lights_in_other_axes, relief_cautions
from solve.plausible_axes import AXES, INVERTED, axes_words
from solve.solve import solve

SIZE = 110
V, U = np.mgrid[:SIZE, :SIZE].astype(float)
X, Y = (U - SIZE / 2) / 48, (SIZE / 2 - V) / 48
ROUND = X**2 + Y**2 < 0.8
EVERYWHERE = np.ones((SIZE, SIZE), bool)


def surface(height):
    """Normals (H, W, 3) of a height (H, W) in pixels, x right, y up."""
    up, right = -np.gradient(height, axis=0), np.gradient(height, axis=1)
    return unit(np.stack([-right, -up, np.ones_like(height)], -1))


HILLS = surface(9 * np.sin(U / 12) * np.cos(V / 10) + 5 * np.sin((U + 2 * V) / 17))
"""A relief that fills its mask, which has no limb."""
LOPSIDED = 48 * np.sqrt(np.maximum(1 - X**2 - Y**2, 0.05)) + 4 * np.sin(4 * X + 1) * np.cos(3 * Y)


def shot(normals, mask=EVERYWHERE, *, glossy=0.0, noise=0.0, count=14):
    """(frames, lights, camera, mask) of a surface of two albedos, with gloss; lights of unlike strength, mixed."""
    rng = np.random.default_rng(731)
    lights = lights_along(rng.permutation(even_cap(count, 45)), rng.uniform(0.7, 1.3, (count, 1)))
    albedo = np.where(np.sin(U / 9) * np.sin(V / 8) > 0, 0.6, 0.35)[..., None]
    shine = lights.intensities[:, None, None] * gloss(normals, lights.directions, 40)[..., None]
    image = (matte(lights, normals, normals, albedo) + glossy * shine) * mask[..., None]
    image = np.maximum(image + noise * rng.normal(size=image.shape), 0)
    return Frames.from_linear(lights.names, image), lights, Camera.orthographic(SIZE, SIZE), mask


def test_the_48_axes_are_all_and_name_themselves():
    assert len({axes_words(matrix) for matrix in AXES}) == 48
    assert axes_words(AXES[0]) == "(x, y, z)"
    for matrix in AXES:
        np.testing.assert_array_equal(matrix @ matrix.T, np.eye(3))


@pytest.fixture(scope="module")
def told():
    """Return what says what is told of a round body's lights, their directions changed."""
    frames, lights, *rest = shot(surface(LOPSIDED), ROUND, noise=0.002)
    return lambda change: lights_in_other_axes(frames, replace(lights, directions=change(lights.directions)), *rest)


@pytest.mark.parametrize(
    ("axes", "words"),
    [
        (np.diag([-1, 1, 1]), "(-x, y, z)"),
        (np.diag([1, -1, 1]), "(x, -y, z)"),
        (np.diag([-1, -1, 1]), "(-x, -y, z)"),
        (np.eye(3)[[0, 2, 1]], "(x, z, y)"),
        (np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), "(y, -x, z)"),
    ],
)
def test_the_change_that_puts_lights_right_is_named(told, axes, words):
    """A flipped file was used without a word where no ball stood by."""
    assert told(lambda directions: directions) is None
    text = told(lambda directions: directions @ axes.T)
    assert text.startswith("lights.file: ")
    assert f"changed to {words};" in text


def test_a_hollow_may_be_one(told):
    """Its slopes are those of the lights as they are; that its rim points inward is no proof."""
    # A hollow is lit as the same body is from the other side.
    text = told(lambda directions: directions @ INVERTED)
    assert "points inward at its rim. Unless it is hollow, it makes sense if" in text
    assert "slope" not in text


def test_what_lamberts_law_does_not_fit_is_no_matter_of_axes(told):
    """Lights in another order make no surface either, in whichever axes; of that the order's test speaks."""
    for order in (np.roll(np.arange(14), 1), np.random.default_rng(0).permutation(14)):
        assert told(lambda directions: directions[order]) is None  # noqa: B023


@pytest.mark.parametrize(("glossy", "noise"), [(0.0, 0.0), (0.4, 0.01)], ids=["matte", "glossy, noisy"])
def test_an_inverted_relief_is_told_from_the_right_one(glossy, noise):
    frames, lights, *rest = shot(HILLS, glossy=glossy, noise=noise)
    assert not relief_cautions(HILLS, frames, lights, *rest)
    (said,) = relief_cautions(HILLS @ INVERTED, frames, lights, *rest)
    assert "convex for concave" in said
    # The inverted relief under the mirrored lights is right again: nothing but the lights tells.
    mirrored = replace(lights, directions=lights.directions @ INVERTED)
    assert not relief_cautions(HILLS @ INVERTED, frames, mirrored, *rest)
    assert relief_cautions(HILLS, frames, mirrored, *rest)
    assert not relief_cautions(HILLS @ INVERTED, frames, Lights.unknown(lights.names), *rest)


def test_a_surface_that_is_flat_tells_nothing():
    flat = surface(0.05 * np.sin(U / 9.0))
    for noise in (0.0, 0.01):
        assert not relief_cautions(flat @ INVERTED, *shot(flat, noise=noise))


def test_an_uncalibrated_method_that_inverts_says_so_and_keeps_its_own_sign():
    """A bowl that fills its mask to the rim: the outline, which is no limb, votes for a dome."""
    bowl = surface(-48 * np.sqrt(np.maximum(1 - X**2 - Y**2, 0.05)))
    found, right = (solve("ldr", *shot(normals, ROUND)) for normals in (bowl, bowl @ INVERTED))
    known = ROUND & np.isfinite(found.normals[..., 0])
    assert np.median(angular_error_deg(found.normals @ INVERTED, bowl)[known]) < 10
    assert any("convex for concave" in text for text in found.warnings)
    assert not any("convex for concave" in text for text in right.warnings)

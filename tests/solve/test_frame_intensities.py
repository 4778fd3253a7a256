"""Frames whose brightness contradicts the stated intensities: exactly these are named, and nothing that is smooth."""

from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import as_floats, even_cap, lights_along, matte
from scene.camera import Camera
from solve.frame_intensities import corrected

SIZE = 48
CAMERA = Camera.orthographic(SIZE, SIZE)


def glossy_ball(count, *, flat=False, seed=0):
    """Frames of a ball (or a plane) with gloss, cast shadows and noise, its lights, and its mask."""
    rng = np.random.default_rng(seed)
    v, u = (np.mgrid[:SIZE, :SIZE] - (SIZE - 1) / 2) / (0.46 * SIZE)
    mask = u**2 + v**2 < 0.9
    normals = np.stack([u, -v, np.sqrt(np.maximum(1 - u**2 - v**2, 0.05))], -1)
    if flat:
        normals = np.broadcast_to([0.1, -0.2, np.sqrt(0.95)], normals.shape)
    lights = lights_along(even_cap(count, 50.0), rng.uniform(0.7, 1.4, (count, 3))).normalised()
    images = matte(lights, np.zeros((SIZE, SIZE, 3)), normals, 0.3 + 0.1 * np.sin(9 * u)[..., None])
    half = lights.directions + [0.0, 0.0, 1.0]
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    shine = np.maximum(np.einsum("hwi,fi->fhw", normals, half), 0) ** 60
    images += 0.2 * lights.intensities[:, None, None] * shine[..., None]
    for image in images:
        row, column = rng.integers(0, SIZE - 14, 2)
        image[row : row + 14, column : column + 10] *= 0.05
    return as_floats(lights, np.maximum(images + 0.002 * rng.standard_normal(images.shape), 0)), lights, mask


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
def test_the_frames_that_are_off_are_named_and_corrected_and_no_others(count, off, by, word):
    frames, lights, mask = glossy_ball(count)
    factor = np.ones(count)
    factor[off] = by
    given = stated(lights, factor)
    found, (said,) = corrected(frames, given, CAMERA, mask)
    ratio = (found.intensities / given.intensities).mean(1)
    np.testing.assert_allclose(ratio, factor, rtol=0.025)
    right = np.setdiff1d(np.arange(count), off)
    np.testing.assert_allclose(ratio[right], 1, rtol=1e-12)
    assert word in said
    assert said.startswith(lights.names[off[0]])
    assert ("and 4 more" in said) == (len(off) == 8)


@pytest.mark.parametrize("count", [12, 24])
@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_right_or_off_smoothly_is_not_touched(count, seed):
    frames, lights, mask = glossy_ball(count, seed=seed)
    x, y, _ = lights.directions.T
    for factor in (np.ones(count), np.full(count, 1.3), 1 + 0.2 * x - 0.1 * y):
        given = stated(lights, factor)
        assert corrected(frames, given, CAMERA, mask) == (given, [])


def test_nobody_is_accused_where_most_differ_or_nothing_tells():
    frames, lights, mask = glossy_ball(12)
    wild = stated(lights, np.exp(0.3 * np.random.default_rng(5).standard_normal(12)))
    assert corrected(frames, wild, CAMERA, mask) == (wild, [])
    frames, lights, mask = glossy_ball(12, flat=True)
    given = stated(lights, [0.7] + 11 * [1.0])
    assert corrected(frames, given, CAMERA, mask) == (given, [])
    unknown = replace(lights, directions=np.full((12, 3), np.nan))
    assert corrected(frames, unknown, CAMERA, mask) == (unknown, [])

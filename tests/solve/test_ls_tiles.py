"""Least squares straight from the codes against the general way, on a scene with all that makes them differ."""

from dataclasses import replace

import numpy as np
import pytest

from fixtures.lit_surfaces import spiral
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from solve.pixelwise import ls
from solve.solve import solve

COUNT, HEIGHT, WIDTH = 23, 20, 600


def ball(seed=0):
    """A ball with gloss, noise, shadows, dark background, ambient light, gains; more columns than a tile has."""
    rng = np.random.default_rng(seed)
    directions = spiral(np.linspace(0.4, 0.95, COUNT))
    intensities = rng.uniform(0.7, 1.3, (COUNT, 3))
    y, x = np.mgrid[1 : -1 : HEIGHT * 1j, -1 : 1 : WIDTH * 1j]
    inside = x**2 + y**2 < 0.9
    normals = np.stack([x, y, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))], -1)
    shade = np.maximum(np.einsum("hwi,fi->fhw", normals, directions), 0) * np.where(inside, 0.6, 0.0)
    shade += 0.8 * (shade / 0.6) ** 40
    images = shade[..., None] * intensities[:, None, None]
    images += 0.02 + rng.normal(0, 0.006, images.shape)
    made = Frames.from_linear(tuple(map(str, range(COUNT))), images, ambient=np.full((HEIGHT, WIDTH, 3), 0.02))
    frames = Frames(made.names, made.codes, rng.uniform(0.9, 1.1, COUNT), made.ambient, is_mosaic=bool(seed % 2))
    return frames, Lights(frames.names, directions, intensities / intensities.mean(0))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("coverage", [1.0, 0.7])
def test_both_ways_agree_on_every_map(seed, coverage, monkeypatch):
    frames, lights = ball(seed)
    camera = Camera.orthographic(WIDTH, HEIGHT)
    mask = np.random.default_rng(seed).random((HEIGHT, WIDTH)) < coverage
    assert frames.saturated()[:, mask].any()
    left = []
    stream = ls.METHOD.stream

    def watched(*given):
        found = stream(*given)
        assert found is not None
        left.append(found[-1])
        return found

    monkeypatch.setattr(ls, "METHOD", replace(ls.METHOD, stream=watched))
    fast = solve("ls", frames, lights, camera, mask)
    some = np.concatenate(left[1:])
    assert 0.01 < some.mean() < 0.6
    monkeypatch.setattr(ls, "METHOD", replace(ls.METHOD, stream=None))
    plain = solve("ls", frames, lights, camera, mask)
    np.testing.assert_array_equal(fast.samples, plain.samples)
    facing = np.count_nonzero(plain.normals @ lights.directions.T > 0, axis=-1)
    assert (facing < plain.samples).any(), "some keep a sample whose light is behind the normal"
    np.testing.assert_allclose(fast.normals, plain.normals, atol=1e-6)
    np.testing.assert_allclose(fast.albedo, plain.albedo, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(fast.condition, plain.condition, rtol=1e-5)
    np.testing.assert_allclose(fast.sigma_deg, plain.sigma_deg, rtol=1e-3, atol=1e-4)
    assert fast.warnings == plain.warnings

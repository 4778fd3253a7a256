"""Convex for concave: told where calibrated lights know; never put right in silence."""

import numpy as np
import pytest

from fixtures.lit_surfaces import even_cap, gloss, lights_along, matte
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from solve.axes import relief_cautions
from solve.plausible_axes import INVERTED
from solve.solve import solve

SIZE = 110


def surface(height):
    """Normals (H, W, 3) of a height (H, W) in pixels, x right, y up."""
    up, right = -np.gradient(height, axis=0), np.gradient(height, axis=1)
    return unit(np.stack([-right, -up, np.ones_like(height)], -1))


def shot(normals, mask, *, glossy=0.0, noise=0.0, count=14):
    """(frames, lights, camera, mask) of a surface of two albedos, with gloss, under lights of unlike strength."""
    rng = np.random.default_rng(731)
    lights = lights_along(even_cap(count, 45), rng.uniform(0.7, 1.3, (count, 1)))
    v, u = np.mgrid[:SIZE, :SIZE]
    albedo = np.where(np.sin(u / 9) * np.sin(v / 8) > 0, 0.6, 0.35)
    shine = lights.intensities[:, None, None] * gloss(normals, lights.directions, 40)[..., None]
    image = (matte(lights, normals, normals, albedo[..., None]) + glossy * shine) * mask[..., None]
    image = np.maximum(image + noise * rng.normal(size=image.shape), 0)
    return Frames.from_linear(lights.names, image), lights, Camera.orthographic(SIZE, SIZE), mask


def bumps():
    """A relief of hills and hollows that fills its mask, which has no limb."""
    v, u = np.mgrid[:SIZE, :SIZE].astype(float)
    return surface(9 * np.sin(u / 12) * np.cos(v / 10) + 5 * np.sin((u + 2 * v) / 17)), np.ones((SIZE, SIZE), bool)


@pytest.mark.parametrize(("glossy", "noise"), [(0.0, 0.0), (0.4, 0.01)], ids=["matte", "glossy, noisy"])
def test_an_inverted_relief_is_told_from_the_right_one(glossy, noise):
    normals, mask = bumps()
    scene = shot(normals, mask, glossy=glossy, noise=noise)
    assert not relief_cautions(normals, *scene)
    (said,) = relief_cautions(normals @ INVERTED, *scene)
    assert "convex for concave" in said
    # The inverted relief under the mirrored lights is right again: nothing but the lights tells.
    frames, lights, camera, _ = scene
    mirrored = Lights(lights.names, lights.directions @ INVERTED, lights.intensities)
    assert not relief_cautions(normals @ INVERTED, frames, mirrored, camera, mask)
    assert relief_cautions(normals, frames, mirrored, camera, mask)


def test_lights_that_are_unknown_and_a_surface_that_is_flat_tell_nothing():
    normals, mask = bumps()
    frames, lights, camera, _ = shot(normals, mask)
    assert not relief_cautions(normals @ INVERTED, frames, Lights.unknown(lights.names), camera, mask)
    flat = surface(0.05 * np.sin(np.mgrid[:SIZE, :SIZE][1] / 9.0))
    for noise in (0.0, 0.01):
        assert not relief_cautions(flat @ INVERTED, *shot(flat, mask, noise=noise))


def test_an_uncalibrated_method_that_inverts_says_so_and_keeps_its_own_sign():
    """A bowl that fills its mask to the rim: the outline, which is no limb, votes for a dome."""
    v, u = np.mgrid[:SIZE, :SIZE].astype(float)
    x, y = (u - SIZE / 2) / 48, (SIZE / 2 - v) / 48
    mask = x**2 + y**2 < 0.8
    bowl = surface(-48 * np.sqrt(np.maximum(1 - x**2 - y**2, 0.05)))
    frames, lights, camera, _ = shot(bowl, mask)
    found = solve("ldr", frames, lights, camera, mask)
    known = mask & np.isfinite(found.normals[..., 0])
    assert np.median(angular_error_deg(found.normals @ INVERTED, bowl)[known]) < 10
    assert any("convex for concave" in text for text in found.warnings)
    dome = bowl @ INVERTED
    right = solve("ldr", *shot(dome, mask))
    assert not any("convex for concave" in text for text in right.warnings)

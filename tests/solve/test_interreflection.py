"""Light that an object throws upon itself: in a spherical bowl it is the same everywhere, and known exactly."""

import numpy as np
import pytest

from fixtures.lit_surfaces import as_samples, even_cap
from scene.camera import Camera
from scene.normals import angular_error_deg, unit
from solve.whole.interreflection import Relief
from solve.whole.reflectance import ReflectanceSettings, fit_to_views

SIZE = 48
RIM = 0.75
"""Radius of the bowl's rim; that of its sphere is 1."""
LIGHTS = even_cap(24, 35.0)
CAMERA = Camera(SIZE, SIZE, SIZE / 2, SIZE / 2, SIZE / 2 - 0.5, SIZE / 2 - 0.5, projection="orthographic")


def bowl(side: float) -> tuple[np.ndarray, np.ndarray]:
    """Return mask (H, W) and normals (P, 3) of a bowl, side -1, or a dome, side 1."""
    base, _ = CAMERA.rays(CAMERA.grid())
    across = base[..., :2]
    mask = np.sum(across**2, -1) < RIM**2
    height = np.sqrt(1 - np.sum(across**2, -1, where=mask[..., None]))
    return mask, np.concatenate([side * across, height[..., None]], -1)[mask]


def shaded(normals: np.ndarray) -> np.ndarray:
    """Return n . l (P, F)."""
    return normals @ LIGHTS.T


def share_of_the_sphere() -> float:
    """Return what part of the whole sphere the bowl is: the form factor between any of its points and all of it."""
    return (1 - np.sqrt(1 - RIM**2)) / 2


def throw(mask, normals, gray, patches=3000):
    relief = Relief(mask, CAMERA, 0.0, patches)
    chosen = relief.patches(np.ones(len(normals), bool))
    thrown = relief.throw(chosen, gray[chosen].astype(np.float32), normals[chosen])
    return np.einsum("pcf,pc->pf", thrown.patches[thrown.corner], thrown.share)


@pytest.mark.parametrize("patches", [3000, 500])
def test_in_a_bowl_the_thrown_light_is_the_same_everywhere(patches):
    mask, normals = bowl(-1)
    gray = shaded(normals)
    assert gray.min() > 0.02
    found = throw(mask, normals, gray, patches)
    expected = share_of_the_sphere() * np.average(gray, axis=0, weights=1 / normals[:, 2])
    inner = normals[:, 2] > 0.75
    assert np.abs(found[inner] / expected - 1).mean() < 0.08
    assert np.median(found / expected) == pytest.approx(1, abs=0.04)


def test_what_stands_between_hides():
    mask, normals = bowl(-1)
    column = np.nonzero(mask)[1]
    right = (column > SIZE / 2 + 9)[:, None].astype(float)
    left = column < SIZE / 2 - 9
    assert throw(mask, normals, right)[left].min() > 0.02
    # A ridge along the middle, higher than the rim.
    for near, slope in ((-3.5, -3.0), (2.5, 3.0)):
        normals[np.abs(column - SIZE / 2 - near) < 3.2] = unit(np.array([slope, 0.0, 1.0]))
    assert throw(mask, normals, right)[left].max() < 1e-3


@pytest.mark.parametrize("reflectance", [0.4, 0.7])
def test_normals_of_a_matte_bowl(reflectance):
    """Its thrown light looks like another normal's: nothing tells how much it is; most things are half white."""
    mask, normals = bowl(-1)
    direct = shaded(normals)
    mean = np.average(direct, axis=0, weights=1 / normals[:, 2])
    # All orders of bounces: a geometric series.
    thrown = reflectance * share_of_the_sphere() * mean / (1 - reflectance * share_of_the_sphere())
    noise = 0.001 * np.random.default_rng(20_010).standard_normal(direct.shape)
    gray = (0.5 * (direct + thrown) + noise).astype(np.float32)
    samples = as_samples(gray, LIGHTS)
    views = np.tile([0.0, 0.0, 1.0], (len(gray), 1))
    errors = [
        angular_error_deg(
            unit(fit_to_views(samples, views, ReflectanceSettings(pixels=600, rounds=8), relief)[0].b), normals
        ).mean()
        for relief in (None, Relief(mask, CAMERA, 0.0, 600))
    ]
    assert errors[1] < 0.6 * errors[0]

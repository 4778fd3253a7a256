"""One reflectance for the whole object, which is not Lambertian; light that it throws upon itself, known in a bowl."""

import numpy as np
import pytest

from fixtures.lit_surfaces import as_samples, dome, even_cap
from scene.camera import Camera
from scene.normals import angular_error_deg, unit
from solve.pixelwise import iterative
from solve.whole.interreflection import Relief
from solve.whole.reflectance import fit_to_views

FRONT = np.array([0.0, 0.0, 1.0])


def photographs(lobe, *, count=32, size=44, noise=0.001, seed=20_000):
    """Samples (P, F), normals (P, 3) and directions (F, 3): a ball, f = lobe(cos theta_h, cos theta_d, cos theta_i)."""
    generator = np.random.default_rng(seed)
    normals, mask = dome(size, rim=0.32)
    normals, lights = normals[mask], even_cap(count, 55.0)
    half = unit(lights + FRONT)
    albedo = generator.uniform(0.2, 0.6, (len(normals), 1))
    cosine = np.clip(normals @ lights.T, 0, 1)
    gray = albedo * cosine * lobe(np.clip(normals @ half.T, 0, 1), half @ FRONT, cosine)
    return (gray + noise * generator.standard_normal(gray.shape)).astype(np.float32), normals, lights


def fit(gray, lights):
    return fit_to_views(as_samples(gray, lights), np.tile(FRONT, (len(gray), 1)))[0]


def of_iterative(gray, lights):
    return iterative.fit(as_samples(gray, lights), float(np.percentile(gray, 99)), iterative.IterativeSettings())[0]


def transmitted(cosine):
    """Return what share of light passes into a dielectric (index 1.5) from this angle, relative to straight on."""
    sine = np.sqrt(1 - cosine**2) / 1.5
    inside = np.sqrt(1 - sine**2)
    across, along = (cosine - 1.5 * inside) / (cosine + 1.5 * inside), (1.5 * cosine - inside) / (1.5 * cosine + inside)
    return (1 - (across**2 + along**2) / 2) / 0.96


LOBES = {
    "plastic": (lambda h, d, c: 1 + 2 * h**60, 0.4),
    "satin": (lambda h, d, c: 1 + 1.5 * h**8, 0.4),
    "back-scattering": (lambda h, d, c: 0.7 + 0.5 * d**6 + 0 * h, 0.4),
    # Light that enters at a low angle is weaker: any table over half and difference angle sees plastic too steep.
    "entered": (lambda h, d, c: (1 + 2 * h**60) * transmitted(c), 0.25),
}
"""f(cos theta_h, cos theta_d, cos theta_i), and the share of the error of `iterative` that may be left."""


@pytest.mark.parametrize(("lobe", "share"), LOBES.values(), ids=LOBES)
def test_normals_of_what_is_not_matte(lobe, share):
    gray, normals, lights = photographs(lobe)
    found = angular_error_deg(unit(fit(gray, lights).b), normals)
    before = angular_error_deg(unit(of_iterative(gray, lights)), normals)
    assert found.mean() < share * before.mean()
    assert np.median(found) < 0.2 or share < 0.3


def test_a_matte_object_is_left_as_it_is():
    gray, normals, lights = photographs(lambda h, d, c: 1 + 0 * h, noise=0.0)
    found = fit(gray, lights)
    assert angular_error_deg(unit(found.b), normals).max() < 1e-3
    assert np.linalg.norm(found.b, axis=1) == pytest.approx(
        np.linalg.norm(of_iterative(gray, lights), axis=1), rel=1e-3
    )


def test_a_view_from_the_side_is_not_one_from_the_front():
    """Half angles count from the direction to the camera: with the wrong one, the table explains nothing."""
    gray, normals, lights = photographs(LOBES["satin"][0])
    views = np.tile(unit(np.array([0.6, 0.0, 0.8])), (len(gray), 1))
    wrong, *_ = fit_to_views(as_samples(gray, lights), views)
    right = fit(gray, lights)
    error = [angular_error_deg(unit(found.b), normals).mean() for found in (wrong, right)]
    assert error[1] < 0.1 * error[0]


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
        angular_error_deg(unit(fit_to_views(samples, views, relief)[0].b), normals).mean()
        for relief in (None, Relief(mask, CAMERA, 0.0, 600))
    ]
    assert errors[1] < 0.6 * errors[0]

"""Rough plastic in closed form against the renderer's own."""

from dataclasses import replace

import numpy as np
import pytest

from twin.description.materials import Diffuse, RoughPlastic, Texture
from twin.engines.mitsuba_materials import bsdf
from twin.engines.mitsuba_scene import loadable
from twin.engines.variant import import_mitsuba
from twin.material.reflection_models import coat, matte, reflected


def directions(count: int, seed: int, least: float) -> np.ndarray:
    generator = np.random.default_rng([seed, 10_021])
    z = generator.uniform(least, 1, count)
    angle = generator.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], -1)


def in_mitsuba(material, views: np.ndarray, lights: np.ndarray) -> np.ndarray:
    mi = import_mitsuba()
    plastic = mi.load_dict(loadable(mi, bsdf(material)))
    surface = mi.SurfaceInteraction3f()
    surface.wi = mi.Vector3f(*views.T.astype(np.float32))
    surface.uv = mi.Point2f(0.5, 0.5)
    value = plastic.eval(mi.BSDFContext(), surface, mi.Vector3f(*lights.T.astype(np.float32)))
    return np.pi * np.asarray(value).reshape(3, -1).T


@pytest.mark.parametrize("roughness", [0.05, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("index", [1.3, 1.49, 1.8])
def test_body_and_coat_are_those_of_mitsuba(roughness: float, index: float) -> None:
    views, lights = directions(4000, 1, 0.1), directions(4000, 2, 0.05)
    # Half of them near the mirror direction, where the coat shines.
    near = views[:2000] * [-1, -1, 1] + 0.3 * roughness * directions(2000, 3, -1)
    lights[:2000] = near / np.linalg.norm(near, axis=1, keepdims=True)
    lights[:, 2] = np.abs(lights[:, 2]) + 1e-3
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)
    up = np.broadcast_to([0.0, 0.0, 1.0], views.shape).copy()
    surface = coat(roughness, index)
    body, gloss = (a[:, 0] for a in reflected(surface, up, views, lights[:, None]))
    material = RoughPlastic((0.2, 0.5, 0.9), roughness, 0.7, index)
    both = in_mitsuba(material, views, lights)
    ours = body[:, None] * np.array([0.2, 0.5, 0.9]) + 0.7 * gloss[:, None]
    assert np.max(np.abs(ours / both - 1)) < 0.01
    only = in_mitsuba(replace(material, reflectance=(1.0, 1.0, 1.0), specularity=0.0), views, lights)[:, 0]
    assert np.max(np.abs(body / only - 1)) < 0.01


@pytest.mark.parametrize("covered", [0.0, 0.1, 0.4])
def test_a_body_that_lies_partly_bare_is_that_of_mitsuba(covered: float) -> None:
    views, lights = directions(4000, 8, 0.1), directions(4000, 9, 0.05)
    up = np.broadcast_to([0.0, 0.0, 1.0], views.shape).copy()
    body, gloss = (a[:, 0] for a in reflected(coat(0.3, covered=covered), up, views, lights[:, None]))
    colour = (0.2, 0.5, 0.9)
    for reflectance in (colour, Texture(np.full((1, 1, 3), colour, np.float32))):
        both = in_mitsuba(RoughPlastic(reflectance, 0.3, 0.7, covered=covered), views, lights)
        ours = body[:, None] * np.array(colour) + 0.7 * gloss[:, None]
        assert np.max(np.abs(ours / both - 1)) < 0.01


@pytest.mark.parametrize("roughness", [0.0, 0.4, 1.0])
def test_a_rough_body_is_that_of_mitsuba(roughness: float) -> None:
    views, lights = directions(4000, 10, 0.1), directions(4000, 11, 0.05)
    up = np.broadcast_to([0.0, 0.0, 1.0], views.shape).copy()
    surface = coat(0.3, covered=0.2, body=roughness)
    body, gloss = (a[:, 0] for a in reflected(surface, up, views, lights[:, None]))
    both = in_mitsuba(RoughPlastic((0.2, 0.5, 0.9), 0.3, 0.7, covered=0.2, body_roughness=roughness), views, lights)
    ours = body[:, None] * np.array([0.2, 0.5, 0.9]) + 0.7 * gloss[:, None]
    assert np.max(np.abs(ours / both - 1)) < 0.01


def test_two_lobes_are_those_of_mitsuba() -> None:
    views, lights = directions(4000, 12, 0.1), directions(4000, 13, 0.05)
    up = np.broadcast_to([0.0, 0.0, 1.0], views.shape).copy()
    for covered in (0.3, 1.0):
        numbers = {"covered": covered, "second": 0.3, "second_roughness": 0.6}
        body, gloss = (a[:, 0] for a in reflected(coat(0.2, **numbers), up, views, lights[:, None]))
        both = in_mitsuba(RoughPlastic((0.2, 0.5, 0.9), 0.2, 0.7, **numbers), views, lights)
        ours = body[:, None] * np.array([0.2, 0.5, 0.9]) + 0.7 * gloss[:, None]
        assert np.max(np.abs(ours / both - 1)) < 0.01


def test_matte_is_lambert() -> None:
    views, lights = directions(100, 4, 0.1), directions(100, 5, 0.1)
    up = np.broadcast_to([0.0, 0.0, 1.0], views.shape).copy()
    body, gloss = reflected(matte(), up, views, lights[:, None])
    np.testing.assert_allclose(body[:, 0], lights[:, 2], rtol=1e-6)
    np.testing.assert_allclose(body[:, 0], in_mitsuba(Diffuse((1.0, 1.0, 1.0)), views, lights)[:, 0], rtol=1e-5)
    assert not gloss.any()


def test_nothing_comes_from_behind() -> None:
    up = np.array([[0.0, 0.0, 1.0]])
    body, gloss = reflected(coat(0.3), up, up, np.array([[[0.6, 0.0, -0.8]]]))
    assert body[0, 0] == 0
    assert gloss[0, 0] == 0

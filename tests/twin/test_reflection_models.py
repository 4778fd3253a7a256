"""Rough plastic in closed form against the renderer's own."""

import numpy as np
import pytest

from twin.description.materials import Diffuse, RoughPlastic, Texture
from twin.engines.mitsuba_materials import bsdf
from twin.engines.mitsuba_scene import loadable
from twin.engines.variant import import_mitsuba
from twin.material.reflection_models import coat, matte, reflected

COLOUR = (0.2, 0.5, 0.9)
UP = np.tile([0.0, 0.0, 1.0], (4000, 1))


def directions(count, seed, least):
    generator = np.random.default_rng([seed, 10_021])
    z, angle = generator.uniform(least, 1, count), generator.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], -1)


def in_mitsuba(material, views, lights):
    mi = import_mitsuba()
    surface = mi.SurfaceInteraction3f()
    surface.wi, surface.uv = mi.Vector3f(*views.T.astype(np.float32)), mi.Point2f(0.5, 0.5)
    plastic = mi.load_dict(loadable(mi, bsdf(material)))
    value = plastic.eval(mi.BSDFContext(), surface, mi.Vector3f(*lights.T.astype(np.float32)))
    return np.pi * np.asarray(value).reshape(3, -1).T


@pytest.mark.parametrize(
    "numbers",
    [
        *({"roughness": r} for r in (0.05, 0.1, 0.3, 0.6, 1.0)),
        *({"roughness": 0.3, "index": index} for index in (1.3, 1.8)),
        *({"roughness": 0.3, "covered": share} for share in (0.0, 0.1, 0.4)),
        *({"roughness": 0.3, "covered": 0.2, "body": share} for share in (0.0, 0.4, 1.0)),
    ],
    ids=str,
)  # fmt: skip
def test_body_and_coat_are_those_of_mitsuba(numbers):
    theirs = {"body_roughness" if name == "body" else name: value for name, value in numbers.items()}
    views, lights = directions(4000, 1, 0.1), directions(4000, 2, 0.05)
    # Half of them near the mirror direction, where the coat shines.
    near = views[:2000] * [-1, -1, 1] + 0.3 * numbers["roughness"] * directions(2000, 3, -1)
    lights[:2000] = near / np.linalg.norm(near, axis=1, keepdims=True)
    lights[:, 2] = np.abs(lights[:, 2]) + 1e-3
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)
    body, gloss = (a[:, 0] for a in reflected(coat(**numbers), UP, views, lights[:, None]))
    for reflectance in (COLOUR, Texture(np.full((1, 1, 3), COLOUR, np.float32))):
        both = in_mitsuba(RoughPlastic(reflectance, specularity=0.7, **theirs), views, lights)
        assert np.max(np.abs((body[:, None] * np.array(COLOUR) + 0.7 * gloss[:, None]) / both - 1)) < 0.01
    only = in_mitsuba(RoughPlastic((1.0, 1.0, 1.0), specularity=0.0, **theirs), views, lights)[:, 0]
    assert np.max(np.abs(body / only - 1)) < 0.01


@pytest.mark.parametrize("numbers", [{}, {"covered": 0.0}, {"covered": 0.3}, {"covered": 0.0, "body_roughness": 0.1}])
@pytest.mark.parametrize("specularity", [0.0, 0.6])
def test_light_that_goes_on_is_as_much_as_is_sent_back(numbers, specularity):
    """Drawn directions have the mean weight that the reflection has over all directions: interreflection needs it."""
    mi = import_mitsuba()
    surface, draw = mi.SurfaceInteraction3f(), np.random.default_rng(10_022).random((3, 40_000), np.float32)
    surface.wi, surface.uv = mi.Vector3f(*np.tile([[0.3], [0.1], [0.9**0.5]], 40_000)), mi.Point2f(0.5, 0.5)
    material = RoughPlastic(COLOUR, roughness=0.5, specularity=specularity, **numbers)
    model, around = mi.load_dict(loadable(mi, bsdf(material))), mi.BSDFContext()
    _, drawn = model.sample(around, surface, mi.Float(draw[0]), mi.Point2f(draw[1:]))
    all_round = mi.warp.square_to_cosine_hemisphere(mi.Point2f(draw[1:]))
    seen = model.eval(around, surface, all_round) / mi.warp.square_to_cosine_hemisphere_pdf(all_round)
    assert np.asarray(drawn).mean(1) == pytest.approx(np.asarray(seen).mean(1), rel=0.03)


def test_matte_is_lambert_and_nothing_comes_from_behind():
    views, lights = directions(4000, 4, 0.1), directions(4000, 5, 0.1)
    body, gloss = reflected(matte(), UP, views, lights[:, None])
    np.testing.assert_allclose(body[:, 0], lights[:, 2], rtol=1e-6)
    np.testing.assert_allclose(body[:, 0], in_mitsuba(Diffuse((1.0, 1.0, 1.0)), views, lights)[:, 0], rtol=1e-5)
    assert not gloss.any()
    behind = reflected(coat(0.3), UP[:1], UP[:1], np.array([[[0.6, 0.0, -0.8]]]))
    assert [float(value[0, 0]) for value in behind] == [0, 0]

"""The engine `many`: closed forms, stock Mitsuba, and what must not change their pictures."""

from dataclasses import replace

import numpy as np
import pytest

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Diffuse, RoughPlastic
from twin.description.object_mesh import built_in
from twin.engines.film import Film
from twin.engines.many import Many
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import SLOW, import_mitsuba, pick_variant

pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here"),
]

MIDDLE = np.array([0.0, 0.0, -300.0])
CAMERA = Camera(48, 40, 150.0, 150.0, 25.4, 18.2)
WALLS = Diffuse((0.8, 0.5, 0.3))


def lights(*directions, intensities=None, near=False):
    vectors = np.array(directions, float)
    names = tuple(f"flash_{i}" for i in range(len(vectors)))
    intensities = np.ones((len(vectors), 3)) if intensities is None else np.array(intensities, float)
    return Lights(names, unit(vectors), intensities, MIDDLE + vectors if near else None, MIDDLE)


def placed(name, shape, material, offset=(0, 0, 0), size=40.0, turn=None):
    matrix = np.diag([size, size, size, 1.0])
    if turn is not None:
        matrix[:3, :3] = turn * size
    matrix[:3, 3] = MIDDLE + offset
    return TwinObject(name, built_in(shape), material, matrix)


def corner(material=WALLS):
    """A wall, a floor and a ball: each throws light, and shadow, on the others."""
    floor = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])
    return (
        placed("wall", "square", "walls", (0, 0, -30), 70.0),
        placed("floor", "square", "walls", (0, -25, 0), 70.0, floor),
        placed("ball", "sphere", "ball", (5, -3, 0), 20.0),
    ), {"walls": WALLS, "ball": material}


def scene_of(objects, materials, given, *, camera=CAMERA, max_depth=5):
    return TwinScene(camera, objects, materials, given, sampling=Sampling("mitsuba", max_depth=max_depth))


def whole(scene):
    """Return the film of the whole picture."""
    camera = scene.camera
    return Film.of_pinhole(camera, slice(0, camera.height), slice(0, camera.width))


def rendered(scene, film=None, samples=64, seed=10_000):
    """Return light of one surface and of more, (2, F, h, w, 3)."""
    import_mitsuba()
    film, depth = film or whole(scene), scene.sampling.max_depth
    many = Many(mitsuba_scene(scene), film, scene.lights, max_depth=depth)
    return many.band(slice(0, film.size[0]), samples, seed)


def direct(scene, samples=64):
    return rendered(replace(scene, sampling=replace(scene.sampling, max_depth=2)), samples=samples)[0]


def stock(scene, samples):
    tracer = PathTracer(scene, whole(scene))
    return np.stack([tracer.image(index, samples, seed=10_001) for index in range(len(scene.lights))])


@pytest.mark.parametrize(("near", "distribution"), [(False, "ggx"), (True, "ggx"), (True, "beckmann")])
@pytest.mark.parametrize("flat", [False, True], ids=["perspective", "orthographic"])
def test_the_mean_is_that_of_stock_mitsuba_shadows_gloss_and_all(near, flat, distribution):
    camera = replace(CAMERA, fx=0.5, fy=0.5, projection="orthographic") if flat else CAMERA
    given = lights([120, 60, 200], [-90, 150, 160], near=near, intensities=[[1, 1, 1], [0.5, 0.8, 1.1]])
    ball = RoughPlastic((0.4, 0.4, 0.6), 0.2, distribution=distribution)
    scene = scene_of(*corner(ball), given, camera=camera, max_depth=2)
    ours, theirs = direct(scene, 256), stock(scene, 256)
    assert np.allclose(ours.mean((1, 2)), theirs.mean((1, 2)), rtol=2e-3)
    assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.006 * theirs.mean()


@pytest.mark.full
def test_light_that_went_on_is_what_stock_mitsuba_has_beyond_direct_light():
    given = lights([120, 60, 200], [-90, 150, 160], near=True)
    scene = scene_of(*corner(), given)
    straight, through = rendered(scene, samples=400)
    whole_of = stock(scene, 400)
    beyond = whole_of - straight
    assert beyond.mean() > 0.05 * whole_of.mean(), "the scene shows what is tested"
    assert np.allclose(through.mean((1, 2)), beyond.mean((1, 2)), rtol=0.02)
    assert np.sqrt(np.mean((through - beyond) ** 2)) < 0.02 * whole_of.mean()
    # What is not noise: means of 8 x 8 pixels.
    blocks = (through - beyond).reshape(2, 5, 8, 6, 8, 3).mean((2, 4))
    assert np.sqrt(np.mean(blocks**2)) < 0.004 * whole_of.mean()


def test_neither_bands_nor_threads_change_anything():
    import drjit

    scene, threads = scene_of(*corner(), lights([0.5, 0.2, 1], [-0.4, 0.6, 0.8])), drjit.thread_count()
    at_once = rendered(scene, samples=5)
    many = Many(mitsuba_scene(scene), whole(scene), scene.lights, max_depth=5)
    try:
        drjit.set_thread_count(3)
        pieces = [many.band(slice(row, min(row + 7, 40)), 5, 10_000) for row in range(0, 40, 7)]
    finally:
        drjit.set_thread_count(threads)
    assert np.array_equal(np.concatenate(pieces, 2), at_once)
    assert not np.array_equal(rendered(scene, samples=5, seed=1), at_once)


def test_light_behind_the_surface_and_a_hidden_light_give_nothing():
    """A light from the upper right throws the ball's shadow to the lower left of it on the wall; each sign counts."""
    objects, materials = corner()
    walls = (objects[0], placed("ball", "sphere", "ball", (0, 0, 10), 12.0))
    given = lights([60, 45, 75], [0, 0, -1])
    images = direct(scene_of(walls, materials, given))[..., 0]
    # From the ball's middle, 40 mm before the wall, along -(60, 45, 75): to (-32, -24) mm on the wall.
    for x, y in ((-32, -24), (32, 24), (-32, 24), (32, -24), (-24, -32)):
        u, v = CAMERA.project(np.array([x, y, -330.0])).round().astype(int)
        dark = images[0, v - 1 : v + 2, u - 1 : u + 2].max() == 0
        assert dark == ((x, y) == (-32, -24)) or (x, y) == (-24, -32)
    assert images[1].max() == 0

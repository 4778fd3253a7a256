"""The engine `many`: closed forms, stock Mitsuba, what changes nothing; which engine is chosen, and why."""

from dataclasses import replace

import numpy as np
import pytest

from scene.camera import Camera
from tests.twin.twin_scenes import NEEDS_LLVM, ball_and_wall, lights, placed
from twin.description.description import Environment, Sampling, TwinScene
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Subsurface
from twin.engines import engine_choice
from twin.engines.engine_choice import choose_engine
from twin.engines.film import Film, sensor_description
from twin.engines.light_layers import noise_of_one_sample, render_layers
from twin.engines.many import Many
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import SLOW, import_mitsuba, load

pytestmark = [pytest.mark.render, NEEDS_LLVM]

CAMERA = Camera(48, 40, 150.0, 150.0, 25.4, 18.2)
WALLS = Diffuse((0.8, 0.5, 0.3))
UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0.0]])
WALL = placed("wall", "square", "walls", 70.0, (0, 0, -30))
CORNER = (WALL, placed("floor", "square", "walls", 70.0, (0, -25, 0), UP),
          placed("ball", "sphere", "ball", 20.0, (5, -3, 0)))  # fmt: skip
"""Each throws light, and shadow, on the others."""
TWO = [120, 60, 200], [-90, 150, 160]


def scene_of(given, *, objects=CORNER, ball=WALLS, camera=CAMERA, max_depth=5):
    return TwinScene(
        camera, objects, {"walls": WALLS, "ball": ball}, given, sampling=Sampling("mitsuba", max_depth=max_depth)
    )


def whole(scene):
    return Film.of_pinhole(scene.camera, slice(0, scene.camera.height), slice(0, scene.camera.width))


def engine(scene):
    import_mitsuba()
    return Many(mitsuba_scene(scene), whole(scene), scene.lights, max_depth=scene.sampling.max_depth)


def rendered(scene, samples=64, seed=10_000):
    """Return light of one surface and of more, (2, F, h, w, 3)."""
    return engine(scene).band(slice(0, 40), samples, seed)


def stock(scene, samples):
    tracer = PathTracer(scene, whole(scene))
    return np.stack([tracer.image(index, samples, seed=10_001) for index in range(len(scene.lights))])


@pytest.mark.parametrize(("near", "distribution"), [(False, "ggx"), (True, "ggx"), (True, "beckmann")])
@pytest.mark.parametrize("flat", [False, True], ids=["perspective", "orthographic"])
def test_the_mean_is_that_of_stock_mitsuba_shadows_gloss_and_all(near, flat, distribution):
    camera = replace(CAMERA, fx=0.5, fy=0.5, projection="orthographic") if flat else CAMERA
    given = lights(*TWO, near=near, intensities=[[1, 1, 1], [0.5, 0.8, 1.1]])
    ball = RoughPlastic((0.4, 0.4, 0.6), 0.2, distribution=distribution)
    scene = scene_of(given, ball=ball, camera=camera, max_depth=2)
    ours, theirs = rendered(scene, 256)[0], stock(scene, 256)
    assert np.allclose(ours.mean((1, 2)), theirs.mean((1, 2)), rtol=2e-3)
    assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.006 * theirs.mean()


@pytest.mark.full
def test_light_that_went_on_is_what_stock_mitsuba_has_beyond_direct_light():
    scene = scene_of(lights(*TWO, near=True))
    straight, through = rendered(scene, samples=400)
    all_of_it = stock(scene, 400)
    beyond = all_of_it - straight
    assert beyond.mean() > 0.05 * all_of_it.mean(), "the scene shows what is tested"
    assert np.allclose(through.mean((1, 2)), beyond.mean((1, 2)), rtol=0.02)
    assert np.sqrt(np.mean((through - beyond) ** 2)) < 0.02 * all_of_it.mean()
    # What is not noise: means of 8 x 8 pixels.
    blocks = (through - beyond).reshape(2, 5, 8, 6, 8, 3).mean((2, 4))
    assert np.sqrt(np.mean(blocks**2)) < 0.004 * all_of_it.mean()


def test_neither_bands_nor_threads_change_anything(set_threads):
    scene = scene_of(lights([0.5, 0.2, 1], [-0.4, 0.6, 0.8]))
    at_once, many = rendered(scene, samples=5), engine(scene)
    set_threads(3)
    pieces = [many.band(slice(row, min(row + 7, 40)), 5, 10_000) for row in range(0, 40, 7)]
    assert np.array_equal(np.concatenate(pieces, 2), at_once)
    assert not np.array_equal(rendered(scene, samples=5, seed=1), at_once)


def test_light_behind_the_surface_gives_nothing():
    assert not rendered(scene_of(lights([0, 0, -1]), max_depth=2), samples=4).any()


GREY = Diffuse((0.6, 0.6, 0.6))
VECTORS = [[80, 60, 200], [-100, 40, 160]]


def ball(material=GREY, **change):
    given = lights(*VECTORS, intensities=[[1, 1, 1], [0.6, 0.8, 1.0]])
    return replace(ball_and_wall(given, material, Sampling("auto", max_depth=4, error=0.01)), **change)


def test_what_the_other_cannot_do_goes_to_stock_mitsuba_and_it_is_said_why(monkeypatch):
    near = lights(*VECTORS, near=True)
    assert choose_engine(ball(lights=near))[0] == "many"
    for scene, reason in (
        (ball(Conductor("Au", 0.0)), "mirror"),
        (ball(Diffuse((0.5, 0.5, 0.5), Subsurface(3.0))), "medium"),
        (ball(sampling=Sampling("mitsuba", samples=9)), "asked for"),
        (ball(lights=near, radii_mm=np.array([0, 15.0])), "size"),
    ):
        engine, why = choose_engine(scene)
        assert (engine, reason in why) == ("mitsuba", True)
    monkeypatch.setattr(engine_choice, "pick_variant", lambda: (SLOW, "no LLVM that works was found. Install it"))
    assert choose_engine(ball())[0] == "mitsuba"
    assert "Install it" in choose_engine(ball())[1]


def test_the_layers_add_up_to_stock_mitsuba_environment_and_all():
    scene = ball(RoughPlastic((0.5, 0.5, 0.5), 0.3), environment=Environment(ambient=(0.1, 0.2, 0.05)))
    film = scene.film()
    layers, tracer = render_layers(scene, film, "many", 256), PathTracer(scene, film)
    for index, frame in enumerate(layers.frames()):
        expected = tracer.image(index, 256)
        assert np.allclose(frame.mean((0, 1)), expected.mean((0, 1)), rtol=5e-3)
        assert np.sqrt(np.mean((frame - expected) ** 2)) < 0.02 * expected.mean()
    assert layers.standing.mean() > 0.03
    stock = render_layers(scene, film, "mitsuba", 16)
    assert stock.onward is None
    assert np.allclose(stock.frames().mean((1, 2)), layers.frames().mean((1, 2)), rtol=0.01)


@pytest.mark.parametrize("engine", ["many", "mitsuba"])
def test_the_noise_that_is_predicted_is_that_of_the_rendering(engine):
    scene = ball()
    film = scene.film()
    exact, rough = (render_layers(scene, film, engine, samples).frames() for samples in (400, 16))
    lit = exact > 0.05 * exact.max()
    error = np.sqrt(np.mean((rough - exact)[lit] ** 2)) / exact[lit].mean()
    assert noise_of_one_sample(scene, film, engine) / 4 == pytest.approx(error, rel=0.3)


def test_stock_frames_are_the_same_by_any_number_of_threads_and_stocks_own(set_threads):
    """Stock's film adds in the order in which its threads come: with 25 samples a pixel no two frames were the same."""
    import mitsuba as mi

    scene = ball(camera=Camera(200, 160, 600.0, 600.0, 99.5, 79.5))
    film, images = scene.film(), []
    for count in (1, 2, 3):
        set_threads(count)
        images.append(PathTracer(scene, film).image(1, 25, seed=5))
    assert all(np.array_equal(images[0], image) for image in images)
    sensor = load(sensor_description(film, scene.points, film.window[0], film.window[2]))
    seed = int(np.random.SeedSequence([5, 1, film.window[0]]).generate_state(1)[0])
    stock = mi.render(mitsuba_scene(scene, light=1), sensor=sensor, spp=25, seed=seed)
    np.testing.assert_allclose(images[0], np.asarray(stock)[..., :3], atol=1e-5)

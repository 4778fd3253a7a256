"""The choice of an engine: what the scene asks for, and why; and the layers that it gives."""

from dataclasses import replace

import drjit
import numpy as np
import pytest

from scene.camera import Camera
from tests.twin.twin_scenes import ball_and_wall, lights
from twin.description.description import Environment, Sampling
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Subsurface
from twin.engines import engine_choice
from twin.engines.engine_choice import choose_engine
from twin.engines.film import sensor_description
from twin.engines.light_layers import noise_of_one_sample, render_layers
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import SLOW, load, pick_variant

pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here"),
]

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


def test_stock_frames_are_the_same_by_any_number_of_threads_and_stocks_own():
    """Stock's film adds in the order in which its threads come: with 25 samples a pixel no two frames were the same."""
    import mitsuba as mi

    scene = ball(camera=Camera(200, 160, 600.0, 600.0, 99.5, 79.5))
    film, images, threads = scene.film(), [], drjit.thread_count()
    try:
        for count in (1, 2, 3):
            drjit.set_thread_count(count)
            images.append(PathTracer(scene, film).image(1, 25, seed=5))
    finally:
        drjit.set_thread_count(threads)
    assert all(np.array_equal(images[0], image) for image in images)
    sensor = load(sensor_description(film, scene.points, film.window[0], film.window[2]))
    seed = int(np.random.SeedSequence([5, 1, film.window[0]]).generate_state(1)[0])
    stock = mi.render(mitsuba_scene(scene, light=1), sensor=sensor, spp=25, seed=seed)
    np.testing.assert_allclose(images[0], np.asarray(stock)[..., :3], atol=1e-5)

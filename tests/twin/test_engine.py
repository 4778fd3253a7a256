"""The choice of an engine: what the scene asks for, and why; and the layers that it gives."""

from dataclasses import replace

import numpy as np
import pytest

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, RoughPlastic, Subsurface
from twin.description.object_mesh import built_in
from twin.engines import engine_choice as engines
from twin.engines.engine_choice import choose_engine
from twin.engines.film import sensor_description
from twin.engines.layers import noise_of_one_sample, render_layers
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import SLOW, load, pick_variant

pytestmark = [
    pytest.mark.render,
    pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here"),
]

CAMERA = Camera(48, 40, 150.0, 150.0, 23.5, 19.5)
GREY = Diffuse((0.6, 0.6, 0.6))


def ball(material=GREY, *, wall=False, **change):
    def placed(name, shape, size, z, use):
        matrix = np.diag([size, size, size, 1.0])
        matrix[2, 3] = z
        return TwinObject(name, built_in(shape), use, matrix)

    directions = unit(np.array([[0.4, 0.3, 1], [-0.5, 0.2, 0.8]]))
    scene = TwinScene(
        CAMERA,
        (placed("ball", "sphere", 25.0, -300.0, "m"), *([placed("wall", "square", 90.0, -326.0, "w")] if wall else [])),
        {"m": material, **({"w": Diffuse((0.8, 0.8, 0.8))} if wall else {})},
        Lights(("a", "b"), directions, np.array([[1, 1, 1], [0.6, 0.8, 1.0]])),
        sampling=Sampling("auto", max_depth=4, error=0.01),
    )
    return replace(scene, **change)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"materials": {"m": Conductor("Au", 0.0)}}, "mirror"),
        ({"materials": {"m": Diffuse((0.5, 0.5, 0.5), Subsurface(3.0))}}, "medium"),
        ({"sampling": Sampling("mitsuba", samples=9)}, "asked for"),
    ],
)
def test_what_the_others_cannot_do_goes_to_stock_mitsuba(change, reason):
    import re

    engine, why = choose_engine(ball(**change))
    assert engine == "mitsuba"
    assert re.search(reason, why)


def test_a_light_with_a_size_goes_to_stock_mitsuba():
    scene = ball()
    offset = 200 * scene.lights.directions
    center = np.array([0, 0, -300.0])
    near = replace(scene.lights, positions_mm=center + offset, reference_point_mm=center)
    assert choose_engine(replace(scene, lights=near))[0] == "many"
    assert "size" in choose_engine(replace(scene, lights=near, radii_mm=np.array([0, 15.0])))[1]


def test_without_llvm_it_is_stock_mitsuba_and_says_how_to_get_the_others(monkeypatch):
    monkeypatch.setattr(engines, "pick_variant", lambda: ("scalar_rgb", "no LLVM that works was found. Install it"))
    engine, why = choose_engine(ball())
    assert engine == "mitsuba"
    assert "Install it" in why


def test_the_layers_add_up_to_stock_mitsuba_environment_and_all():
    ambient = Environment(ambient=(0.1, 0.2, 0.05))
    scene = ball(RoughPlastic((0.5, 0.5, 0.5), 0.3), wall=True, environment=ambient)
    film = scene.film()
    layers = render_layers(scene, film, "many", 256)
    tracer = PathTracer(scene, film)
    for index, frame in enumerate(layers.frames()):
        expected = tracer.image(index, 256)
        assert np.allclose(frame.mean((0, 1)), expected.mean((0, 1)), rtol=5e-3)
        assert np.sqrt(np.mean((frame - expected) ** 2)) < 0.02 * expected.mean()
    assert layers.standing.mean() > 0.03
    stock = render_layers(scene, film, "mitsuba", 16)
    assert stock.onward is None
    assert np.allclose(stock.frames().mean((1, 2)), layers.frames().mean((1, 2)), rtol=0.01)


@pytest.mark.parametrize("engine", ["many", "mitsuba"])
def test_the_noise_that_is_foretold_is_that_of_the_rendering(engine):
    scene = ball(wall=True)
    film = scene.film()
    exact, rough = (render_layers(scene, film, engine, samples).frames() for samples in (400, 16))
    lit = exact > 0.05 * exact.max()
    error = np.sqrt(np.mean((rough - exact)[lit] ** 2)) / exact[lit].mean()
    assert noise_of_one_sample(scene, film, engine) / 4 == pytest.approx(error, rel=0.3)


def test_stock_frames_are_the_same_by_any_number_of_threads_and_stocks_own():
    """Stock's film adds in the order in which its threads come: with 25 samples a pixel no two frames were the same."""
    import drjit
    import mitsuba as mi

    scene = ball(wall=True, camera=Camera(200, 160, 600.0, 600.0, 99.5, 79.5))
    film, images, threads = scene.film(), [], drjit.thread_count()
    try:
        for count in (1, 2, 3):
            drjit.set_thread_count(count)
            images.append(PathTracer(scene, film).image(1, 25, seed=5))
    finally:
        drjit.set_thread_count(threads)
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])
    sensor = load(sensor_description(film, scene.points, film.window[0], film.window[2]))
    seed = int(np.random.SeedSequence([5, 1, film.window[0]]).generate_state(1)[0])
    stock = mi.render(mitsuba_scene(scene, light=1), sensor=sensor, spp=25, seed=seed)
    np.testing.assert_allclose(images[0], np.asarray(stock)[..., :3], atol=1e-5)

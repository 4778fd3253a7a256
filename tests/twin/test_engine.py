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
from twin.engines.engine_choice import Choice, choose_engine, run_pilot
from twin.engines.film import film_for, sensor_description
from twin.engines.layers import render_layers
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import SLOW, import_mitsuba, load, pick_variant

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


def chosen(scene):
    return choose_engine(scene, scene.film())


@pytest.mark.full
def test_a_convex_object_is_rendered_directly_and_before_a_wall_by_many():
    alone, before = chosen(ball()), chosen(ball(wall=True))
    assert (alone.engine, before.engine) == ("direct", "many")
    assert alone.pilot.onward < 1e-3 < 0.02 < before.pilot.onward
    assert max(alone.pilot.disagreement, before.pilot.disagreement) < 0.01
    assert "% of the mean" in str(before)
    assert set(before.pilot.seconds(0.01)) == {"direct", "many", "mitsuba"}
    assert before.samples > 4
    rough = chosen(replace(ball(wall=True), sampling=Sampling("auto", max_depth=4, error=0.5)))
    assert rough.engine == "direct", "where half is error enough, what goes on need not be rendered"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"materials": {"m": Conductor("Au", 0.0)}}, "mirror"),
        ({"materials": {"m": Diffuse((0.5, 0.5, 0.5), Subsurface(3.0))}}, "medium|mirror|pane"),
        ({"sampling": Sampling("mitsuba", samples=9)}, "asked for"),
    ],
)
def test_what_the_others_cannot_do_goes_to_stock_mitsuba(change, reason):
    import re

    choice = chosen(ball(**change))
    assert choice.engine == "mitsuba"
    assert re.search(reason, choice.reason)


def test_a_light_with_a_size_goes_to_stock_mitsuba():
    scene = ball()
    offset = 200 * scene.lights.directions
    center = np.array([0, 0, -300.0])
    near = replace(scene.lights, positions_mm=center + offset, reference_point_mm=center)
    assert chosen(replace(scene, lights=near)).engine == "direct"
    assert "size" in chosen(replace(scene, lights=near, radii_mm=np.array([0, 15.0]))).reason


def test_without_llvm_it_is_stock_mitsuba_and_says_how_to_get_the_others(monkeypatch):
    monkeypatch.setattr(engines, "pick_variant", lambda: ("scalar_rgb", "no LLVM that works was found. Install it"))
    choice = chosen(ball())
    assert choice.engine == "mitsuba"
    assert "Install it" in str(choice)


@pytest.mark.full
def test_the_curves_of_time_and_error_tell_what_each_engine_can():
    """`direct` ends at what it leaves out; the others get as exact as is asked, and pay for it."""
    pilot = chosen(ball(wall=True)).pilot
    curves = {name: np.array(points) for name, points in pilot.curves(0.01).items()}
    assert curves["direct"][:, 0].min() >= pilot.onward
    for name in ("many", "mitsuba"):
        error, seconds = curves[name].T
        assert error.min() < 0.011 < 0.03 < error.max()
        assert (np.diff(error) < 0).all()
        assert seconds[-1] > seconds[0]
    # An error once more as small costs stock Mitsuba four times as much: its samples' noise, and nothing else.
    error, seconds = curves["mitsuba"].T
    assert np.allclose(seconds * error**2, (seconds * error**2)[-1], rtol=0.3)


@pytest.mark.full
def test_a_pilot_that_stock_mitsuba_contradicts_bars_the_others(monkeypatch):
    class Bright(engines.Indirect):
        def images(self):
            return 1.5 * super().images()

    monkeypatch.setattr(engines, "Indirect", Bright)
    choice = chosen(ball(wall=True))
    assert choice.engine == "mitsuba"
    assert choice.pilot.disagreement > 0.01
    assert "differs" in choice.reason


def test_the_layers_add_up_to_stock_mitsuba_environment_and_all():
    ambient = Environment(ambient=(0.1, 0.2, 0.05))
    scene = ball(RoughPlastic((0.5, 0.5, 0.5), 0.3), wall=True, environment=ambient)
    film = scene.film()
    layers = render_layers(scene, film, Choice("many", 0.005, 64, ""))
    tracer = PathTracer(scene, film)
    for index, frame in enumerate(layers.frames()):
        expected = tracer.image(index, 256)
        assert np.allclose(frame.mean((0, 1)), expected.mean((0, 1)), rtol=5e-3)
        assert np.sqrt(np.mean((frame - expected) ** 2)) < 0.02 * expected.mean()
    assert layers.standing.mean() > 0.03
    stock = render_layers(scene, film, Choice("mitsuba", 0.005, 16, ""))
    assert stock.onward is None
    assert np.allclose(stock.frames().mean((1, 2)), layers.frames().mean((1, 2)), rtol=0.01)


@pytest.mark.full
def test_errors_are_over_the_brightness_of_what_is_seen():
    """As `direct`'s are: what a wider film adds, nothing at all, is no darker a picture."""
    import_mitsuba()
    found = []
    for camera in (CAMERA, Camera(96, 80, 150.0, 150.0, 47.5, 39.5)):
        corners = camera.points_at_depth([[0, 0], [camera.width - 1, camera.height - 1]], -300.0)
        found.append(run_pilot(ball(camera=camera), film_for(camera, corners)))
    # Four times the box, three quarters of it empty: the same sum of squares over four times the pixels.
    assert np.sqrt(found[1].noise) == pytest.approx(np.sqrt(found[0].noise) / 2, rel=0.25)


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

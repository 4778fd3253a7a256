"""The engines `direct` and `many`: closed forms, stock Mitsuba, and what must not change their pictures."""

from dataclasses import replace

import numpy as np
import pytest

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from twin.description.description import Sampling, TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, RoughPlastic
from twin.description.object_mesh import built_in
from twin.engines import many
from twin.engines.direct import Direct
from twin.engines.film import Film
from twin.engines.many import Indirect
from twin.engines.mitsuba_scene import mitsuba_scene
from twin.engines.path_tracing import PathTracer
from twin.engines.sampling_plan import bends, plan_samples, predicted_error, samples_for, tolerance_for
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


def direct(scene, film=None, error=0.003):
    import_mitsuba()
    return Direct(mitsuba_scene(scene), film or whole(scene), scene.lights, error=error)


def indirect(scene, film=None, samples=64, seed=10_000):
    import_mitsuba()
    depth = scene.sampling.max_depth
    return Indirect(
        mitsuba_scene(scene), film or whole(scene), scene.lights, samples=samples, max_depth=depth, seed=seed
    )


def stock(scene, samples):
    tracer = PathTracer(scene, whole(scene))
    return np.stack([tracer.image(index, samples, seed=10_001) for index in range(len(scene.lights))])


def test_a_matte_ball_under_a_distant_light_has_the_closed_form():
    """Albedo times intensity times cosine, to 0.1 %, where the pixel is not at an edge; 0 behind the terminator."""
    given = lights([0, 0, 1], [-0.5, 0.6, 0.6], intensities=[[1, 1, 1], [1.2, 0.5, 0.8]])
    scene = scene_of((placed("ball", "sphere", "m"),), {"m": Diffuse((0.2, 0.5, 0.9))}, given)
    images = direct(scene).images()
    # A pixel's value is its area's mean: of 6 x 6 points.
    within = np.stack(np.meshgrid(*[(np.arange(6) + 0.5) / 6 - 0.5] * 2), -1).reshape(-1, 2)
    origins, rays = CAMERA.rays(CAMERA.grid()[..., None, :] + within)
    along = -np.sum(rays * (origins - MIDDLE), -1)
    square = along**2 - np.sum((origins - MIDDLE) ** 2, -1) + 40.0**2
    normals = (origins + rays * (along - np.sqrt(np.where(square > 0, square, np.nan)))[..., None] - MIDDLE) / 40.0
    for index in range(2):
        cosine = normals @ given.directions[index]
        well = np.all((-np.sum(normals * rays, -1) > 0.4) & (cosine > 0.3), -1)
        expected = cosine[well].mean(-1)[:, None] * given.intensities[index] * [0.2, 0.5, 0.9]
        ratio = images[index][well] / expected
        assert well.sum() > 400
        assert abs(images[index][well].mean() / expected.mean() - 1) < 1e-3
        assert np.abs(ratio - 1).max() < 0.006
        assert np.percentile(np.abs(ratio - 1), 95) < 0.002
        dark = np.all(cosine < -0.05, -1)
        assert dark.sum() >= 50 * index
        assert images[index][dark].max(initial=0) == 0


@pytest.mark.parametrize(("near", "distribution"), [(False, "ggx"), (True, "ggx"), (True, "beckmann")])
@pytest.mark.parametrize("flat", [False, True], ids=["perspective", "orthographic"])
def test_the_mean_is_that_of_stock_mitsuba_shadows_gloss_and_all(near, flat, distribution):
    camera = replace(CAMERA, fx=0.5, fy=0.5, projection="orthographic") if flat else CAMERA
    given = lights([120, 60, 200], [-90, 150, 160], near=near, intensities=[[1, 1, 1], [0.5, 0.8, 1.1]])
    ball = RoughPlastic((0.4, 0.4, 0.6), 0.2, distribution=distribution)
    scene = scene_of(*corner(ball), given, camera=camera, max_depth=2)
    ours, theirs = direct(scene).images(), stock(scene, 256)
    assert np.allclose(ours.mean((1, 2)), theirs.mean((1, 2)), rtol=2e-3)
    assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.006 * theirs.mean()


@pytest.mark.full
def test_light_that_went_on_is_what_stock_mitsuba_has_beyond_direct_light():
    given = lights([120, 60, 200], [-90, 150, 160], near=True)
    scene = scene_of(*corner(), given)
    through = indirect(scene).images()
    whole_of = stock(scene, 400)
    beyond = whole_of - direct(scene).images()
    assert beyond.mean() > 0.05 * whole_of.mean(), "the scene shows what is tested"
    assert np.allclose(through.mean((1, 2)), beyond.mean((1, 2)), rtol=0.02)
    assert np.sqrt(np.mean((through - beyond) ** 2)) < 0.02 * whole_of.mean()
    # What is not noise: means of 8 x 8 pixels.
    blocks = (through - beyond).reshape(2, 5, 8, 6, 8, 3).mean((2, 4))
    assert np.sqrt(np.mean(blocks**2)) < 0.004 * whole_of.mean()


@pytest.mark.full
@pytest.mark.parametrize(("max_depth", "distribution"), [(3, "ggx"), (5, "ggx"), (3, "beckmann")])
def test_light_that_a_glossy_ball_throws_on_its_surroundings_is_where_stock_mitsuba_has_it(max_depth, distribution):
    given = lights([120, 60, 200], near=True)
    scene = scene_of(*corner(Conductor("Al", 0.3, distribution)), given, max_depth=max_depth)
    through = indirect(scene, samples=256).images()
    both = stock(scene, 576)
    beyond = both - direct(scene).images()
    blocks = (through - beyond).reshape(1, 5, 8, 6, 8, 3).mean((2, 4))
    assert np.sqrt(np.mean(blocks**2)) < 0.006 * both.mean()
    assert np.allclose(through.mean((1, 2)), beyond.mean((1, 2)), rtol=0.03)


@pytest.mark.parametrize(("max_depth", "terms"), [(3, 2), (4, 3), (6, 5)])
def test_inside_a_matte_ball_it_is_an_integrating_sphere(max_depth, terms):
    """A light at the middle of a closed ball: L = rho I (1 + rho + rho^2 + ...), everywhere the same."""
    rho = np.array([0.9, 0.5, 0.2])
    camera = Camera(12, 12, 10.0, 10.0, 5.5, 5.5)
    given = Lights(("a",), np.array([[0, 0, 1.0]]), np.ones((1, 3)), np.zeros((1, 3)), np.array([0, 0, -40.0]))
    matrix = np.diag([40.0, 40.0, 40.0, 1.0])
    ball = TwinObject("ball", built_in("sphere"), "m", matrix)
    scene = scene_of((ball,), {"m": Diffuse(tuple(rho))}, given, camera=camera, max_depth=max_depth)
    straight = direct(scene).images()[0]
    went_on = indirect(scene, samples=16).images()[0]
    assert np.allclose(straight, rho, rtol=0.01)
    series = rho * sum(rho**k for k in range(1, terms))
    # A grazing ray in a thousand slips out between facet and smooth normal.
    assert np.mean(np.abs(went_on / series - 1) < 1e-3) > 0.98
    assert np.allclose(went_on.mean((0, 1)), series, rtol=2e-3)


@pytest.mark.full
def test_frames_are_linear_in_intensity_and_go_with_their_lights():
    given = lights([0.5, 0.2, 1], [-0.4, 0.6, 0.8], [0, -0.3, 1])
    scene = scene_of(*corner(), given)
    brighter = given.intensities * np.array([[1.0], [2.0], [0.5]])
    turned = [2, 0, 1]
    changes = {
        "bright": replace(given, intensities=brighter),
        "turned": replace(given, names=tuple(given.names[i] for i in turned), directions=given.directions[turned]),
    }
    for engine in (direct, indirect):
        images = engine(scene).images()
        bright = engine(replace(scene, lights=changes["bright"])).images()
        permuted = engine(replace(scene, lights=changes["turned"])).images()
        # `direct` samples each light where that light's own picture asks for it, whatever its brightness.
        assert np.allclose(permuted, images[turned], rtol=1e-4, atol=1e-4 * images.mean())
        close = np.abs(bright - images * brighter[:, None, None]) < 1e-4 + 1e-3 * bright
        assert close.mean() > (0.98 if engine is direct else 0.9999)
        assert np.allclose(bright.mean((1, 2)), images.mean((1, 2)) * brighter, rtol=2e-3)


def test_bands_change_nothing():
    scene = scene_of(*corner(), lights([0.5, 0.2, 1], [-0.4, 0.6, 0.8]))
    engine = direct(scene)
    at_once = engine.images()
    pieces = [engine.band(slice(row, min(row + 7, len(at_once[0])))) for row in range(0, len(at_once[0]), 7)]
    assert len(pieces) == 6
    assert np.allclose(np.concatenate(pieces, 1), at_once, atol=1e-6)


def test_the_order_in_which_threads_add_changes_nothing():
    scene = scene_of(*corner(), lights([0.5, 0.2, 1], [-0.4, 0.6, 0.8]))
    engine = direct(scene, error=0.003)
    assert engine.samples_per_pixel > 4
    first = engine.images()
    for _ in range(3):
        assert np.array_equal(engine.images(), first)


def test_the_order_changes_nothing_of_what_glossy_surfaces_send_on(monkeypatch):
    monkeypatch.setattr(many, "FIRST_LOOK", 1 << 12)
    objects, _ = corner()
    shiny = {one.material: RoughPlastic((0.5, 0.5, 0.5), 0.1) for one in objects}
    scene = scene_of(objects, shiny, lights([0.5, 0.2, 1], [-0.4, 0.6, 0.8]))
    first, again = (indirect(scene, samples=16).images() for _ in range(2))
    assert first.max() > 0
    assert np.array_equal(first, again)


@pytest.mark.full
def test_a_window_is_a_cut_of_the_whole():
    scene = scene_of(*corner(), lights([0.5, 0.2, 1], [-0.4, 0.6, 0.8]))
    cut = replace(whole(scene), rows=slice(8, 30), columns=slice(10, 41), window=(8, 10, 22, 31))
    part = direct(scene, cut, error=0.001).images()
    assert part.shape == (2, 22, 31, 3)
    expected = direct(scene, error=0.001).images()[:, 8:30, 10:41]
    assert np.sqrt(np.mean((part - expected) ** 2)) < 0.004 * expected.mean()
    went_on = indirect(scene, cut, samples=256).images()
    expected = indirect(scene, samples=256).images()[:, 8:30, 10:41]
    assert np.allclose(went_on.mean((1, 2)), expected.mean((1, 2)), rtol=0.02)


def test_light_behind_the_surface_and_a_hidden_light_give_nothing():
    """A light from the upper right throws the ball's shadow to the lower left of it on the wall; each sign counts."""
    objects, materials = corner()
    walls = (objects[0], placed("ball", "sphere", "ball", (0, 0, 10), 12.0))
    given = lights([60, 45, 75], [0, 0, -1])
    images = direct(scene_of(walls, materials, given)).images()[..., 0]
    # From the ball's middle, 40 mm before the wall, along -(60, 45, 75): to (-32, -24) mm on the wall.
    for x, y in ((-32, -24), (32, 24), (-32, 24), (32, -24), (-24, -32)):
        u, v = CAMERA.project(np.array([x, y, -330.0])).round().astype(int)
        dark = images[0, v - 1 : v + 2, u - 1 : u + 2].max() == 0
        assert dark == ((x, y) == (-32, -24)) or (x, y) == (-24, -32)
    assert images[1].max() == 0


def test_samples_go_where_the_picture_bends_and_the_plan_adds_up():
    rng = np.random.default_rng(10_002)
    images = np.zeros((3, 20, 30, 3), np.float32)
    images[0, :, 14:] = 1  # an edge
    images[1] = np.linspace(0, 1, 30)[:, None]  # a slope
    images[2, 7, 9] = rng.random(3)  # a speck
    bend = np.empty((3, 20, 30), np.float32)
    bends(images, np.ones(3, np.float32), bend)
    assert np.array_equal(np.unique(np.nonzero(bend[0] > 0.1)[1]), [13, 14])
    assert bend[1, :, 1:-1].max() < 1e-6
    for error in (0.05, 0.02, 0.01):
        tolerance = tolerance_for(bend, error)
        samples = samples_for(bend, tolerance)
        assert predicted_error(bend, samples) <= error
        pixels, first_lane, first_pair, light, counts, lights_of_lane = plan_samples(bend, 2, 11, tolerance)
        wanted = samples[:, 2:13].reshape(3, -1)
        assert np.array_equal(pixels, np.nonzero((wanted > 1).any(0))[0])
        owner = np.repeat(pixels, np.diff(first_pair))
        assert np.array_equal(counts, wanted[light, owner])
        assert np.array_equal(np.diff(first_lane), wanted[:, pixels].max(0))
        assert lights_of_lane.sum() == counts.sum()

"""The scene in Mitsuba: energy, conventions of textures and maps, every material and its closed form; its files."""

import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.picture_files import read_picture
from scene.camera import Camera
from scene.errors import RenderError
from scene.mesh import Mesh
from scene.store import Store
from tests.twin.twin_scenes import lights, placed
from twin.description.description import Environment, Sampling, TwinScene
from twin.description.materials import (
    Conductor,
    Diffuse,
    Measured,
    Principled,
    RoughPlastic,
    Subsurface,
    Texture,
    seed_materials,
)
from twin.description.object_mesh import built_in
from twin.engines.mitsuba_files import write_mitsuba
from twin.engines.mitsuba_materials import bsdf
from twin.engines.mitsuba_scene import loadable
from twin.engines.path_tracing import PathTracer
from twin.engines.render import render_scene
from twin.engines.variant import import_mitsuba, pick_variant
from twin.ground_truth import lights_of
from twin.material.reflection_models import coat, matte, reflected

pytestmark = pytest.mark.render

CAMERA = Camera(32, 32, 100.0, 100.0, 15.5, 15.5)
FLAT = replace(CAMERA, fx=0.32, fy=0.32, projection="orthographic")
GREY, WHITE = Diffuse((0.5, 0.5, 0.5)), (1.0, 1.0, 1.0)
DARK, AHEAD = lights([0, 0, 1], intensities=0.0), lights([0, 0, 1])
FROM_THE_MIDDLE_PX = np.hypot(*(np.mgrid[:32, :32] - 15.5))


def one(shape, material, given=AHEAD, camera=CAMERA, **change):
    sampling = Sampling("mitsuba", max_depth=2)
    return replace(TwinScene(camera, (placed(shape, shape, "m"),), {"m": material}, given, sampling=sampling), **change)


def image(scene, index=0, samples=16):
    """Return the picture (H, W, 3), black where nothing is."""
    film = scene.film()
    return film.whole(film.place(PathTracer(scene, film).image(index, samples)))


@pytest.mark.parametrize("reflectance", [(0.2, 0.5, 0.9), WHITE])
@pytest.mark.parametrize("camera", [CAMERA, FLAT], ids=["perspective", "orthographic"])
def test_a_matte_surface_that_faces_a_light_of_intensity_1_has_its_reflectance_for_a_pixel_value(reflectance, camera):
    white = np.array([0.4, 0.8, 1.0])
    for given, expected in (
        (AHEAD, 1.0),
        (lights([0, 0, 1], intensities=0.5), 0.5),
        (lights([0, 0, 1], white=white), white / 0.8),
        (lights([np.sqrt(0.75), 0, 0.5]), 0.5),
        (lights([0, 0, 250], near=True), 1.0),
        (lights([0, 150, 200], near=True), 0.8),
    ):
        middle = image(one("square", Diffuse(reflectance), given, camera))[15:17, 15:17].mean((0, 1))
        assert np.allclose(middle, expected * np.array(reflectance), rtol=2e-3)


def test_a_disc_of_light_gives_what_a_point_gives_where_its_intensity_holds():
    """The irradiance of a disc that faces a surface, straight above, is pi L r^2 / (r^2 + d^2), exactly."""
    middle = Camera(2, 2, 100.0, 100.0, 0.5, 0.5)
    for radius in (1.0, 60.0, 240.0):
        scene = one("square", GREY, lights([0, 0, 240.0], near=True), middle, radii_mm=np.array([radius]))
        assert np.allclose(image(scene, samples=1600), 0.5, rtol=0.02), radius


def test_a_convex_body_in_an_even_light_has_reflectance_times_radiance():
    for environment in (
        Environment(ambient=(0.3, 0.2, 0.1)),
        Environment(Texture(np.full((4, 8, 3), 0.2, np.float32) * np.array([3, 2, 1], np.float32)), 0.5),
        Environment(Texture(np.full((4, 8, 3), 0.1) * [1, 1, 0]), 1.0, 70, (0.2, 0.1, 0.1)),
    ):
        picture = image(one("sphere", Diffuse((1, 0.5, 0.25)), DARK, environment=environment), samples=256)
        expected = np.array([0.3, 0.2, 0.1]) * [1, 0.5, 0.25]
        assert np.allclose(picture[FROM_THE_MIDDLE_PX < 11].mean(0), expected, rtol=3e-3)
        assert (picture[0] == 0).all(), "behind the objects the picture is black"


@pytest.mark.parametrize(
    ("place", "rotate_deg", "brighter", "opposite"),
    [
        (np.s_[0], 0, np.s_[:16], np.s_[16:]),
        (np.s_[3:6, 2], 0, np.s_[:, 16:], np.s_[:, :16]),
        (np.s_[3:6, 4], 90, np.s_[:, 16:], np.s_[:, :16]),
        (np.s_[3:6, 4], -90, np.s_[:, :16], np.s_[:, 16:]),
    ],
)
def test_an_environment_map_shines_from_where_it_is_said_to(place, rotate_deg, brighter, opposite):
    """Rows: up to down. The middle column is the viewer's side, the quarter to its left the camera's right (x)."""
    sky = np.full((9, 9, 3), 1e-3, np.float32)
    sky[place] = 20.0
    given = Environment(Texture(sky), 1.0, rotate_deg)
    picture = image(one("sphere", GREY, DARK, environment=given), samples=64)
    assert picture[brighter].mean() > 2 * picture[opposite].mean()


@pytest.mark.full
def test_the_eight_materials_are_rendered_and_no_two_alike():
    texture = Texture(np.random.default_rng(10002).uniform(0.1, 0.9, (8, 16, 3)).astype(np.float32))
    pictures = {}
    for name, material in seed_materials(texture).items():
        scene = one("sphere", material, lights([0.3, 0.4, 0.8]))
        tracer = PathTracer(scene, scene.film())
        pictures[name] = [tracer.image(0, 64, seed=seed) for seed in (1, 2)]
        assert np.isfinite(pictures[name]).all()
        assert np.mean(pictures[name]) > 0.05
    assert len(pictures) == 8
    for first, (a, b) in pictures.items():
        for second, (c, d) in pictures.items():
            # The product of two differences with noise of their own is what the pictures differ by, squared.
            square = (a - c) * (b - d)
            sigma = square.std() / np.sqrt(square.size)
            assert first >= second or square.mean() > max(5 * sigma, 0.005**2), (first, second)


@pytest.mark.full
def test_scattering_below_the_surface_keeps_the_energy_and_softens_the_shading():
    """A white furnace: what absorbs nothing, in an even light, cannot be told from the light."""
    for share in (0.5, 1.0):
        # Short against the ball, so that no ray goes straight through: what it would see is hidden.
        wax = Diffuse(WHITE, Subsurface(8.0, WHITE, share))
        picture = image(one("sphere", wax, DARK, environment=Environment(ambient=WHITE)), samples=256)
        assert np.allclose(picture[FROM_THE_MIDDLE_PX < 9].mean(), 1, rtol=0.015), share
    soft, hard = (
        image(one("sphere", Diffuse((0.8,) * 3, below), lights([1, 0, 0.05])), samples=256)
        for below in (Subsurface(10.0, (0.98,) * 3, 0.9), None)
    )
    # Light comes round to the side that the flash does not reach.
    assert hard[12:20, 4:14].max() < 0.03
    assert soft[12:20, 4:14].mean() > 0.03


def test_a_scene_becomes_frames_like_a_session_whatever_the_lens(tmp_path):
    lens = replace(CAMERA, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    given = lights([100, 150, 200], [-150, 50, 220], near=True)
    scene = one("sphere", GREY, given, lens, sampling=Sampling("mitsuba", 16, 2))
    rendered = render_scene(scene, store=Store(tmp_path))
    assert any("resampled" in warning for warning in rendered.warnings)
    # The true maps lie beside. Lit is what is seen and neither faces away nor is hidden, but for the rim.
    mask, attached, cast = (np.load(tmp_path / f"truth_{name}.npy") for name in ("mask", "attached", "cast"))
    for index, shadow in enumerate(lights_of(attached | cast, 2)):
        assert np.abs(rendered.frames.frame(index) - image(scene, index)).max() < 2e-5
        lit = rendered.frames.frame(index)[..., 1] > 0.02
        assert (mask & ~shadow)[lit].mean() > 0.9
        assert lit[mask & ~shadow].mean() > 0.9


def write_bsdf(path, **fields):
    """Write arrays in the container of the RGL database: head, one entry a field, data."""
    head, data = b"tensor_file\0" + struct.pack("<BBI", 1, 0, len(fields)), b""
    start = len(head) + sum(13 + len(name) + 8 * array.ndim for name, array in fields.items())
    for name, array in fields.items():
        kind = {np.dtype("u1"): 1, np.dtype("f4"): 10}[array.dtype]
        head += struct.pack("<H", len(name)) + name.encode()
        head += struct.pack("<HBQ", array.ndim, kind, start + len(data)) + struct.pack(f"<{array.ndim}Q", *array.shape)
        data += array.tobytes()
    path.write_bytes(head + data)


def test_a_measured_material_is_read_and_goes_out_with_the_scene(tmp_path):
    """Even in all its tables, it reflects f cos = colour ndf / (4 sigma) = colour / 4 in every direction."""
    import mitsuba as mi

    colour, even = np.array([0.4, 0.2, 0.1], np.float32), np.ones((1, 4, 8, 8), np.float32)
    write_bsdf(
        tmp_path / "even.bsdf", description=np.frombuffer(b"even", np.uint8), phi_i=np.zeros(1, np.float32),
        theta_i=np.linspace(0, 1.5, 4, dtype=np.float32), ndf=even[0, 0], sigma=even[0, 0], vndf=even, luminance=even,
        rgb=even[:, :, None] * colour[:, None, None], jacobian=np.ones(1, np.uint8),
    )  # fmt: skip
    scene = one("sphere", Measured(tmp_path / "even.bsdf"))
    first, (paths, _) = image(scene), write_mitsuba(scene, tmp_path / "out")
    (tmp_path / "even.bsdf").unlink()
    for picture in (first, np.array(mi.render(mi.load_file(str(paths[0])), spp=4))):
        assert np.allclose(picture[10:22, 10:22], np.pi * colour / 4, rtol=1e-4)


OFF = np.array([5.0, -3.0, 0.0])


def asymmetric(kind, **change):
    """A textured square with a coat, a coloured one, a metal, a wax ball: nothing in it is symmetric."""
    values, square = np.zeros((2, 3, 3), np.float32) + [0.1, 0.2, 0.1], built_in("square")
    values[0, 0], values[0, 2], values[1, 0] = [0.9, 0.1, 0.1], [0.1, 0.8, 0.2], [0.2, 0.2, 0.9]
    corners = np.array([[0.9, 0.1, 0.1], [0.1, 0.9, 0.1], [0.1, 0.1, 0.9], [0.6, 0.6, 0.6]])
    objects = (
        placed("back", "square", "picture", 60, OFF),
        placed("flag", Mesh(square.vertices, square.faces, colours=corners), "colours", 12, OFF + [-35, 25, 20]),
        placed("ball", "sphere", "wax", 14, OFF + [20, -20, 20]),
        placed("rod", "cylinder", "metal", 9, OFF + [-20, -25, 15]),
    )
    materials = {
        "picture": RoughPlastic(Texture(values), 0.3, 0.8, body_roughness=0.4),
        "colours": Principled("vertex", 0.3),
        "wax": Diffuse((0.3, 0.3, 0.6), Subsurface(3.0)),
        "metal": Conductor("Cu", 0.3),
    }
    colours, white = [[1.0, 0.9, 0.7], [0.5, 0.6, 0.8]], np.array([0.7, 0.8, 0.9])
    given = lights([-170, 140, 270], [160, 50, 185], near=kind != "distant", intensities=colours, white=white)
    radii, camera = np.full(2, 40.0 if kind == "area" else 0.0), Camera(48, 40, 95.0, 95.0, 25.1, 18.7)
    given = replace(given, names=("left", "right_1.b"))
    made = TwinScene(camera, objects, materials, given, radii, sampling=Sampling("mitsuba", max_depth=3))
    return replace(made, **change)


def stock(folder, light, samples):
    command = [str(Path(sys.executable).parent / "mitsuba"), "-m", pick_variant()[0], "-D", f"light={light}"]
    command += ["-D", f"samples={samples}", "-o", str(folder / f"{light}.exr"), "scene.xml"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return read_picture(folder / f"{light}.exr", "linear")


@pytest.mark.full
@pytest.mark.parametrize("kind", ["distant", "point", "area"])
def test_the_stock_command_line_renders_what_the_engine_renders(kind, tmp_path):
    environment = Environment()
    if kind == "area":
        sky = np.random.default_rng(10003).uniform(0, 0.3, (4, 8, 3)).astype(np.float32)
        environment = Environment(Texture(sky), 0.5, 40.0, (0.02, 0.01, 0.03))
    given = asymmetric(kind, environment=environment)
    paths, notes = write_mitsuba(given, tmp_path)
    assert ([path.name for path in paths], notes) == (["scene.xml", "left.xml", "right_1.b.xml"], [])
    film, samples = given.film(), 144
    tracer = PathTracer(given, film)
    ours, again = ([tracer.image(index, samples, seed=seed) for index in (0, 1)] for seed in (0, 5))
    for index, light in enumerate(given.lights.names):
        theirs = stock(tmp_path, light, samples)[film.rows, film.columns]
        difference = np.abs(theirs - ours[index]).mean()
        assert difference < 1.3 * np.abs(again[index] - ours[index]).mean() + 1e-4 * ours[index].mean()
        assert np.abs(theirs.mean((0, 1)) / ours[index].mean((0, 1)) - 1).max() < 0.02
        # A wrong light, axis or texture would be many times that.
        for wrong in (ours[1 - index], ours[index][::-1], ours[index][:, ::-1]):
            assert np.abs(theirs - wrong).mean() > 4 * difference


def test_an_orthographic_camera_and_a_lens_are_written_and_a_name_that_is_no_files_is_not(tmp_path):
    given = asymmetric("distant", camera=Camera(40, 32, 0.31, 0.31, 22.0, 14.0, projection="orthographic"))
    write_mitsuba(given, tmp_path / "flat")
    film = given.film()
    ours = PathTracer(given, film).image(0, 64)
    theirs = stock(tmp_path / "flat", "left", 64)[film.rows, film.columns]
    assert np.abs(theirs - ours).mean() < 0.06 * ours.mean()
    assert np.abs(theirs - ours[:, ::-1]).mean() > 0.3 * ours.mean()
    lens = asymmetric("distant", camera=Camera(48, 40, 95, 97, 25, 19, (-0.1, 0, 0, 0, 0)))
    assert "no distortion" in write_mitsuba(lens, tmp_path / "lens")[1][0]
    upward = replace(given, lights=replace(given.lights, names=("../up", "b")))
    with pytest.raises(RenderError, match="can be no file's name"):
        write_mitsuba(upward, tmp_path / "none")
    assert not (tmp_path / "none").exists()


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
        *({"roughness": 0.3, "body": share} for share in (0.0, 0.4, 1.0)),
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


@pytest.mark.parametrize("specularity", [0.0, 0.5])
@pytest.mark.parametrize("roughness", [0.05, 0.2, 0.6])
def test_a_metal_is_that_of_mitsuba(specularity, roughness):
    """Of no specularity the renderer alone makes no metal at all: such an object was black."""
    views, lights = directions(4000, 1, 0.1), directions(4000, 2, 0.1)
    # At grazing angles a metal reflects more; the formula's does not.
    facing = np.sqrt((1 + np.sum(views * lights, 1)) / 2) > 0.75
    views, lights = views[facing], lights[facing]
    body, _ = (a[:, 0] for a in reflected(coat(roughness, is_metal=True), UP, views, lights[:, None]))
    theirs = in_mitsuba(Principled(COLOUR, roughness, 1.0, specularity), views, lights)
    assert np.max(np.abs(body[:, None] * np.array(COLOUR) / theirs - 1)) < 0.01


def test_a_light_behind_is_none_even_straight_behind():
    """Half-way between view and light there is no direction then."""
    views = directions(200, 6, 0.1)
    for surface in (matte(), coat(0.3), coat(0.3, is_metal=True)):
        assert not np.concatenate(reflected(surface, UP[:200], views, -views[:, None])).any()


@pytest.mark.parametrize("numbers", [{}, {"body_roughness": 0.1}, {"body_roughness": 0.8}])
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

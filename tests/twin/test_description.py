"""The scene description's file: read, told what is wrong with it, written and read again."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from pydantic import TypeAdapter

from fixtures.mesh_shapes import ball
from formats.picture_files import write_exr
from scene.camera import Camera
from scene.errors import RenderError
from scene.mesh import Mesh
from scene.store import Store
from tests.twin.twin_scenes import lights, placed
from twin.camera.virtual_camera import Sensor
from twin.description.description import Environment, TwinScene
from twin.description.description_check import check_scene
from twin.description.description_file import TABLES, keys_of, read_document, read_scene, write_document
from twin.description.light_groups import AreaLight, GridTable, RingTable, direction
from twin.description.materials import (
    Conductor,
    Diffuse,
    Measured,
    Principled,
    RoughPlastic,
    Subsurface,
    Texture,
    read_texture,
)
from twin.description.object_mesh import SHAPES, built_in, read_mesh, smooth
from twin.description.scene_toml import ObjectTable

HEAD = """
[camera]
width = 64
height = 48
fx = 100.0
"""
BALL = '[[objects]]\nshape = "sphere"\nscale = 40\ntranslate_mm = [-10, 0, -300]\nmaterial = "m"\n'
MATTE = '[materials.m]\nkind = "diffuse"\nreflectance = 0.5\n'
SENSOR = 'files = "exr"\nsensor = { iso = 800, vignetting = [-0.3, 0, 0], neutral = [1, 1, 1] }\n'
LIGHT = '[[lights]]\nkind = "distant"\ndirection = [0, 0, 1]\n'
WHOLE = f"{HEAD}{BALL}{MATTE}{LIGHT}"


def read(folder, *texts):
    (folder / "a.toml").write_text("\n".join(texts))
    return read_scene(folder / "a.toml")


def refused(folder, *texts):
    with pytest.raises(RenderError) as caught:
        read(folder, *texts)
    return str(caught.value)


def test_what_is_left_out_has_its_default(tmp_path):
    scene = read(tmp_path, WHOLE)
    camera = scene.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy, camera.projection) == (100, 100, 31.5, 23.5, "perspective")
    assert scene.materials == {"m": Diffuse((0.5, 0.5, 0.5))}
    assert scene.lights.names == ("distant_000",)
    assert np.allclose(scene.lights.reference_point_mm, [-10, 0, -300], atol=1e-2)
    assert scene.environment.is_dark
    assert (scene.name, scene.sampling.engine, scene.sampling.max_depth) == ("a", "auto", 3)


def test_a_point_goes_through_scale_then_turns_about_x_y_z_then_place_then_matrix_then_pose(tmp_path):
    pose = np.array([[0, -1.0, 0, 7], [1, 0, 0, 8], [0, 0, 1, -300], [0, 0, 0, 1]])
    (tmp_path / "pose.json").write_text(json.dumps({"camera_from_scan": pose.tolist(), "mm_per_unit": 2.0}))
    place = 'scale = [1, 2, 3]\nrotate_deg = [90, 90, 0]\ntranslate_mm = [10, 20, 30]\npose = "pose.json"\n'
    place += "matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]\n"
    scene = read(tmp_path, HEAD, '[[objects]]\nshape = "cube"\nmaterial = "m"\n' + place, MATTE, LIGHT)
    # (1, 0, 0): turned about x it stays, about y it becomes -z. (0, 1, 0): scaled to 2, about x to z, about y to x.
    for point, turned in (([1.0, 0, 0], [0, 0, -1]), ([0, 1.0, 0], [2, 0, 0]), ([0, 0, 1.0], [0, -3, 0])):
        x, y, z = 2 * (np.array(turned) + [10, 20, 35])
        assert np.allclose(scene.objects[0].matrix @ [*point, 1], [7 - y, 8 + x, z - 300, 1])


GROUPS = """
[[lights]]
kind = "ring"
name = "low"
count = 4
polar_deg = 60
start_deg = 90
distance_mm = 400
radius_mm = 20
intensity = [1, 0.5, 0.25]
[[lights]]
kind = "hemisphere"
rings = 2
around = 3
max_polar_deg = 60
distance_mm = 500
[[lights]]
kind = "point"
name = "key"
position_mm = [0, 0, 50]
"""


def test_lights_stand_where_they_are_said_to(tmp_path):
    """Azimuth counts from right to up, elevation toward the viewer."""
    assert np.allclose(direction([0, 90, 180], [0, 0, 0]), [[1, 0, 0], [0, 1, 0], [-1, 0, 0]])
    one = LIGHT.replace("direction = [0, 0, 1]", "azimuth_deg = 90\nelevation_deg = 30")
    assert np.allclose(read(tmp_path, HEAD, BALL, MATTE, one).lights.directions, [[0, np.sqrt(0.75), 0.5]])
    scene = read(tmp_path, "reference_point_mm = [1, 2, -300]\n", HEAD, BALL, MATTE, GROUPS)
    given = scene.lights
    assert given.names == (*(f"low_00{i}" for i in range(4)), *(f"hemisphere_00{i}" for i in range(6)), "key")
    assert np.allclose(scene.radii_mm, [20] * 4 + [0] * 7)
    offsets = given.positions_mm - [1, 2, -300]
    assert np.allclose(np.linalg.norm(offsets, axis=1)[:10], [400] * 4 + [500] * 6)
    assert np.allclose(offsets[:2], [[0, 400 * np.sqrt(0.75), 200], [-400 * np.sqrt(0.75), 0, 200]])
    assert np.allclose(np.degrees(np.arccos(given.directions[4:10, 2])), [20] * 3 + [60] * 3)
    assert np.allclose(given.positions_mm[10], [0, 0, 50])
    assert np.allclose(given.intensities[:5], [[1, 0.5, 0.25]] * 4 + [[1, 1, 1]])


def test_a_sessions_lights_come_with_the_brightness_of_its_white_ball(tmp_path):
    reference, white = np.array([3.0, 4, -500]), np.array([0.4, 0.5, 0.6])
    vectors, powers = [[-3, -4, 600.0], [87, -4, 500]], np.array([[1.2] * 3, [0.8] * 3])
    Store(tmp_path).save_lights(lights(*vectors, near=True, intensities=powers, white=white, middle=reference))
    scene = read(tmp_path, HEAD, BALL, MATTE, '[[lights]]\nkind = "session"\nfile = "lights.json"\n')
    assert np.allclose(scene.irradiance, np.pi * powers * white / 0.8)
    assert np.allclose(scene.lights.reference_point_mm, reference)
    assert scene.lights.names == ("flash_0", "flash_1")


def test_every_fault_is_told_at_once_with_its_key(tmp_path):
    text = HEAD.replace("fx", "focal").replace("64", "-64") + BALL.replace("scale = 40", "scale = 0")
    text += MATTE.replace("diffuse", "velvet") + '[[objects]]\nname = "o"\nposition_mm = [0, 0, 0]\n'
    text += '[materials.n]\nkind = "rough_plastic"\nreflectance = "red"\nroughness = 0\nruffness = 1\n'
    text += 'distribution = "phong"\n[materials.conductor]\nkind = "conductor"\nmetal = 3\n'
    text += (
        '[[lights]]\nkind = "area"\nposition_mm = [0, 0, 0]\n[[lights]]\nkind = "ring"\ncount = 2\npolar_deg = 190\n'
    )
    message = refused(tmp_path, text + '[sampling]\nengine = "best"\n')
    for line in (
        "15 faults",
        "camera.focal: unknown key",
        "objects[1].position_mm: unknown key. docs/reference/scene-toml.md",
        "materials.n.ruffness: unknown key. Did you mean roughness?",
        "camera.fx: missing",
        "camera.width: found -64",
        "objects[0]: found a table",
        "materials.m.kind",
        "materials.n.reflectance: found 'red'",
        "materials.n.roughness: found 0",
        "materials.conductor.metal: found 3",
        "materials.n.distribution: found 'phong'; expected 'ggx' or 'beckmann'",
        "lights[0].radius_mm: missing",
        "lights[1].polar_deg: found 190",
        "sampling.engine: found 'best'",
    ):
        assert line in message, (line, message)


def test_faults_of_what_is_named_are_told_at_once_too(tmp_path):
    np.save(tmp_path / "sky.npy", np.full((2, 4, 1), np.nan))
    (tmp_path / "bad.ply").write_text("ply\n")
    meshes = (BALL.replace('shape = "sphere"', f'mesh = "{name}"') for name in ("none.stl", "bad.ply"))
    text = "".join([HEAD, BALL, *meshes, BALL.replace('"m"', '"x"'), '[materials.m]\nkind = "diffuse"\n'])
    text += 'reflectance = { file = "no.png" }\n[environment]\nmap = "sky.npy"\n' + LIGHT
    keys = ("objects[1].mesh", "objects[2].mesh", "materials.m.reflectance", "environment.map", "objects[3].material")
    message = refused(tmp_path, text)
    for line in (*keys, "none.stl: there is no such file", "no.png: not found", "8 of 8 values", "found 'x'"):
        assert line in message


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"material": Diffuse(Texture(np.ones((2, 2, 3), np.float32)))}, "no texture coordinates"),
        ({"material": Diffuse("vertex")}, "has none"),
        ({"material": RoughPlastic("vertex")}, "use principled"),
        ({"material": Diffuse((1.2, 0.5, 0.5))}, "expected 0 to 1"),
        ({"material": Conductor("Unobtainium")}, "Unobtainium"),
        ({"material": Diffuse((0.5,) * 3, Subsurface(1.0)), "open": True}, "not closed"),
        ({"light": [0.0, 0, 10]}, "inside 'ball'"),
        ({"at": [900.0, 0, 0]}, "sees nothing"),
    ],
)
def test_what_cannot_be_rendered_is_named(change, message):
    shape = ball(30.0, 2)
    mesh = smooth(Mesh(shape.vertices, shape.faces[: -5 if change.get("open") else None]))
    given, material = lights(change.get("light", [0.0, 0, 300]), near=True), change.get("material", Diffuse((0.5,) * 3))
    camera, one = Camera(64, 48, 100.0, 100.0, 31.5, 23.5), placed("ball", mesh, "m", 1.0, change.get("at", (0, 0, 0)))
    with pytest.raises(RenderError, match=message):
        check_scene(TwinScene(camera, (one,), {"m": material}, given))


CFA = "fx = 100.0\n[camera.sensor]\n"
HUGE = "matrix = [[1e6,0,0,0],[0,1e6,0,0],[0,0,1e6,0],[0,0,0,1]]\ntranslate_mm = [-10, 0, -3e5]"


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (LIGHT, LIGHT + '[[lights]]\nkind = "point"\nposition_mm = [0, 0, 0]\n', "all must be of one sort"),
        (LIGHT, LIGHT.replace("kind", 'name = "a"\nkind') * 2, "a occurs twice"),
        (LIGHT, LIGHT + '[[lights]]\nkind = "session"\nfile = "lights.json"\n', "stand alone"),
        (LIGHT, LIGHT + "azimuth_deg = 3\n", "wants either direction, or azimuth_deg and elevation_deg"),
        (LIGHT, LIGHT + "[sampling]\nmax_depth = 1000000000", "max_depth: found 1000000000; expected less than"),
        (LIGHT, LIGHT + "intensity = 1e300", "lights[0].intensity[0]: found 1e+300; expected less than"),
        (LIGHT, '[lights]\nkind = "ring"\n', "found a table with kind; expected tables, each below a line [[lights]]"),
        ("scale = 40", "scale = 1e-300", "expected a scale of 1e-06 or more"),
        ("scale = 40", "scale = inf", "scale"),
        (BALL, BALL * 160, "objects: 10403840 triangles in all; expected 10000000 at most"),
        ("translate_mm = [-10, 0, -300]", HUGE, "objects[0]: 65024 faces, and "),
        ("width = 64\nheight = 48", "width = 20000\nheight = 20000", "expected 100000000 pixels at most, width"),
        ("width = 64", "width = 90000000000", "camera.width"),
        ("fx = 100.0", "fx = inf", "camera.fx: found inf; expected a finite number"),
        ("fx = 100.0", f"{CFA}gain = 3", "camera.sensor.gain: unknown key"),
        ("fx = 100.0", f"{CFA}vignetting = [-2, 0, 0]", "leaves no light"),
        ("fx = 100.0", f"{CFA}black_level = 600\nwhite_level = 500", "black_level 600"),
        ("fx = 100.0", f"{CFA}read_noise_e = -1", "read_noise_e: found -1"),
        ("fx = 100.0", f"{CFA}neutral = [0, 1, 1]", "neutral[0]: found 0"),
        ("fx = 100.0", f'{CFA}cfa = "RGBW"', "cfa: found 'RGBW'; expected 'RGGB'"),
        ("fx = 100.0", f'files = "dng"\n{CFA}cfa = "none"', "wants [camera.sensor] with a Bayer pattern"),
        ("fx = 100.0", "fx = 9\ndistortion = 3", "camera.distortion: found 3; expected a list between [ and ]."),
        ("[0, 0, 1]", "[0, nan, 1]", "direction[1]: found nan"),
        (WHOLE, "a = " + "[" * 50_000, "a.toml: not TOML"),
        (WHOLE, "a = " + "9" * 5000, "a.toml: not TOML"),
        (WHOLE, "\0", "zero bytes"),
    ],
)  # fmt: skip
def test_what_no_scene_can_be_is_told(tmp_path, old, new, told):
    assert old in WHOLE
    assert told in refused(tmp_path, WHOLE.replace(old, new, 1))


def same(one, two):
    """Whether two values, tables or mappings hold the same, wherever they were read from."""
    if hasattr(one, "__dataclass_fields__") or hasattr(type(one), "model_fields"):
        names = vars(one).keys() - {"file"}
        return type(one) is type(two) and all(same(getattr(one, name), getattr(two, name)) for name in names)
    if isinstance(one, dict):
        return list(one) == list(two) and all(same(one[key], two[key]) for key in one)
    if isinstance(one, tuple):
        return len(one) == len(two) and all(map(same, one, two))
    if isinstance(one, np.ndarray):
        return one.shape == two.shape and np.allclose(one, two, rtol=1e-15, atol=1e-15, equal_nan=True)
    return one == two


def test_what_is_written_is_read_again_as_it_was(tmp_path):
    """Every kind of table; files beside it, and what was made in memory; once more, and nothing changes."""
    rng = np.random.default_rng(10001)
    at = tuple(map(tuple, [[3.1, 0.2, 0, 5], [0, 2.2, 0.1, 6], [0, 0.3, 1.7, -300], [0, 0, 0, 1.0]]))
    square = built_in("square")
    coloured = Mesh(square.vertices + rng.random((4, 3)), square.faces, None, None, rng.random((4, 3)))
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        cv2.imwrite(str(tmp_path / folder / "wood.png"), rng.integers(0, 255, (4, 4, 3)).astype(np.uint8))
    (tmp_path / "gold.bsdf").write_bytes(b"measured")

    def texture(*shape, wrap="clamp"):
        return Texture(rng.random(shape).astype(np.float32), wrap)

    materials = {
        "a b": Diffuse(texture(3, 5, 3), Subsurface(1.5, (0.5, 0.6, 0.7), 0.25)),
        "plastic": RoughPlastic((0.1, 0.2, 0.3), 0.05, texture(2, 2, 1), 1.6),
        "satin": RoughPlastic(read_texture(tmp_path / "a" / "wood.png"), 0.3, distribution="beckmann"),
        "wood": Diffuse(read_texture(tmp_path / "b" / "wood.png", "linear")),
        "copper": Conductor("Cu", 0.0),
        "disney": Principled("vertex", 0.3, 0.5, 0.25),
        "measured": Measured(tmp_path / "gold.bsdf"),
    }
    # Beyond 16 bits, a control character, quotes: what a writer of TOML must escape, and what it must not.
    objects = (
        ObjectTable(name='\U0001f3db "one"\\ \x7f\x01\n', shape="sphere", material="a b", matrix=at),
        ObjectTable(name="two", mesh=coloured, material="disney", matrix=at, smooth=False),
        ObjectTable(shape="cone", material="wood", scale=(2, 1, 1), rotate_deg=(10, 0, 3), translate_mm=(0, 1, -300)),
    )
    groups = (
        RingTable(count=3, polar_deg=20.0, distance_mm=300.0, radius_mm=5.0, intensity=(1.0, 0.5, 0.2)),
        GridTable(rings=2, around=3, distance_mm=200.0),
        AreaLight(name="key", position_mm=(1.0, 2.0, 3.0), radius_mm=7.5),
    )
    (tmp_path / "a.toml").write_text(HEAD + SENSOR + BALL + MATTE + LIGHT)
    update = {"objects": objects, "materials": materials, "lights": groups, "name": 'with "quotes"',
              "environment": Environment(texture(4, 8, 3, wrap="repeat"), 0.7, 33.0, (0.1, 0.2, 0.3))}  # fmt: skip
    given = read_document(tmp_path / "a.toml").model_copy(update=update)
    path = write_document(given, tmp_path / "copy")
    again = read_document(path)
    assert write_document(again, tmp_path / "third").read_text() == path.read_text()
    assert again.scene().sensor == Sensor(iso=800, vignetting=(-0.3, 0, 0), neutral=(1, 1, 1))
    assert again.scene().files == "exr"
    assert again.materials["measured"] == Measured(tmp_path / "copy" / "files" / "gold.bsdf")
    assert len(list((tmp_path / "copy" / "textures").iterdir())) == 5, "two of one name"
    for one, two, but in ((given, again, {"objects"}), (given.scene(), again.scene(), set())):
        one, two = dict(vars(one)), dict(vars(two))
        for name in one.keys() - but:
            assert same(one[name], two[name]), name


@pytest.mark.render
def test_pictures_are_linear_in_memory_whatever_they_are_on_disk(tmp_path, set_threads):
    coded = np.array([[[0, 128, 255], [255, 64, 0]]], np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), coded[..., ::-1])
    for encoding, expected in (("", 0.2158605), (', encoding = "linear"', 128 / 255)):
        text = MATTE.replace("0.5", f'{{ file = "a.png"{encoding} }}')
        values = read(tmp_path, HEAD, BALL, text, LIGHT).materials["m"].reflectance.values
        assert values.shape == (1, 2, 3)
        assert np.allclose(values[0, 0], [0, expected, 1], atol=1e-6)
    # Kept to one thread, Mitsuba's OpenEXR once waited for ever.
    set_threads(1)
    sky = np.random.default_rng(10007).uniform(0, 30, (4, 8, 3)).astype(np.float32)
    write_exr(tmp_path / "sky.exr", sky)
    cv2.imwrite(str(tmp_path / "sky.hdr"), sky[..., ::-1])
    text = '[environment]\nmap = "sky.%s"\nscale = 2\n'
    for suffix, tolerance in (("exr", 0), ("hdr", 0.01)):
        values = read(tmp_path, WHOLE, text % suffix).environment.map.values
        assert np.allclose(values, sky, rtol=tolerance, atol=30 * tolerance)
    sky[1, 2, 0] = np.nan
    write_exr(tmp_path / "sky.exr", sky)
    assert "sky.exr: 1 of 96 values are not finite" in refused(tmp_path, WHOLE, text % "exr")


@pytest.mark.parametrize("name", SHAPES)
def test_built_in_shapes_face_outward_and_their_pictures_stand_upright(name):
    mesh = built_in(name)
    corners = mesh.vertices[mesh.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.linalg.norm(flat, axis=1) > 0).all()
    assert (np.sum(flat * mesh.normals[mesh.faces].mean(1), 1) > 0).all()
    outward = flat[:, 2] if name in ("square", "disc") else np.sum(flat * (corners.mean(1) - [0, 0, -1e-3]), 1)
    assert (outward > 0).all()
    # From outside, s grows to the right of t's downward: never mirrored.
    s, t = (mesh.texcoords[mesh.faces][..., k] for k in (0, 1))
    area = (s[:, 1] - s[:, 0]) * (t[:, 2] - t[:, 0]) - (s[:, 2] - s[:, 0]) * (t[:, 1] - t[:, 0])
    assert (area < 1e-12).all()


VERTICES = "v -1 -1 0 1 0 0\nv 1 -1 0 0 1 0\nv 1 1 0 0 0 1\nv -1 1 0 0.5 0.5 0.5\n"
COORDINATES = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.25 0.25\n"


@pytest.mark.parametrize(
    "faces",
    [
        "f 1/1/1 2/2/1 3/3/1\nf 1/5/1 3/3/1 4/4/1\n",
        "f -4/-5 -3/-4 -2/-3\nf -4/-1 -2/-3 -1/-2\nv 9 9 9 0 0 0\nvt 9 9\n",
        "\tf 1/1 \\\n2/2 3/3 # two\nF 1/5 3/3 4/4\n",
    ],
)
def test_an_obj_gives_a_corner_its_own_coordinates_and_a_vertex_its_colour(tmp_path, faces):
    """One vertex has two coordinates: two vertices stand there, with one colour. The picture stands upright."""
    (tmp_path / "a.obj").write_bytes(b"\xef\xbb\xbf" + (VERTICES + COORDINATES + "vn 0 0 1\n" + faces).encode())
    mesh = read_mesh(tmp_path / "a.obj")
    corners = [
        [((*mesh.vertices[i, :2], *mesh.texcoords[i]), tuple(np.round(mesh.colours[i], 3))) for i in face]
        for face in mesh.faces
    ]
    red, green, blue = (tuple(row) for row in np.eye(3))
    assert corners == [
        [((-1, -1, 0, 1), red), ((1, -1, 1, 1), green), ((1, 1, 1, 0), blue)],
        [((-1, -1, 0.25, 0.75), red), ((1, 1, 1, 0), blue), ((-1, 1, 0, 0), (0.214, 0.214, 0.214))],
    ]
    assert len(mesh.vertices) == 5
    assert np.allclose(mesh.normals, [0, 0, 1])


@pytest.mark.parametrize(
    ("face", "told"),
    [
        *((face, None) for face in ("f 1//1 2//1 3//1\n", "f 1 2 3\n", "f 1/1 2 3/1\n", "f 1/1 2 3/1/1\n")),
        ("f 1/1 2/1 3/9\n", "faces name vt 0 to 8, and there are 5"),
        ("f 1/1 2/1 3/-9\n", "faces name vt -4 to 0"),
    ],
)
def test_an_obj_whose_corners_have_no_coordinates_or_some_that_are_not_there(tmp_path, face, told):
    (tmp_path / "a.obj").write_text(VERTICES + COORDINATES + "vn 0 0 1\n" + face)
    if told:
        with pytest.raises(RenderError, match=told):
            read_mesh(tmp_path / "a.obj")
        return
    mesh = read_mesh(tmp_path / "a.obj")
    assert (mesh.texcoords, mesh.faces.tolist()) == (None, [[0, 1, 2]])


def test_coordinates_at_corners_are_read_from_a_ply(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
    places = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n"
    (tmp_path / "corners.ply").write_text(head + places + "4 0 1 3 2 8 0 0 1 0 1 1 0 0.25\n")
    corners = read_mesh(tmp_path / "corners.ply")
    assert np.allclose(corners.normals, [0, 0, 1])
    assert corners.faces.shape == (2, 3)
    at = {tuple(place[:2]): tuple(where) for place, where in zip(corners.vertices, corners.texcoords, strict=True)}
    assert at == {(0, 0): (0, 1), (1, 0): (1, 1), (1, 1): (1, 0), (0, 1): (0, 0.75)}


def test_the_manuals_example_is_read(tmp_path):
    manual = (Path(__file__).parents[2] / "docs" / "reference" / "scene-toml.md").read_text()
    cv2.imwrite(str(tmp_path / "stripes.png"), np.full((4, 4, 3), 99, np.uint8))
    scene = read(tmp_path, manual.split("```toml")[1].split("```")[0])
    assert len(scene.lights) == 12
    assert scene.materials["wax"].subsurface.share == 0.5


def test_every_key_says_what_it_is_and_every_number_has_bounds():
    """Of the keys to come, too: nothing renders for ever, or in more memory than there is."""
    for where, table in TABLES.items():
        for name, field in keys_of(table).items():
            assert field.get("description") or name == "kind", (where, name)
        for number in numbers(TypeAdapter(table).json_schema()):
            low, high = (number.keys() & {f"{which}imum", f"exclusive{which.title()}imum"} for which in ("min", "max"))
            assert low, number
            assert high, number
            assert all(abs(number[key]) <= 2**20 for key in (*low, *high))


def numbers(schema):
    """Yield all numbers in a JSON schema."""
    if isinstance(schema, dict):
        if schema.get("type") in ("number", "integer") and "const" not in schema:
            yield schema
        schema = list(schema.values())
    if isinstance(schema, list):
        for part in schema:
            yield from numbers(part)

"""The files for Mitsuba's own command line: what it renders from them is what the engine renders."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.pictures import read_picture
from scene.camera import Camera
from scene.errors import RenderError
from scene.lights import Lights
from scene.normals import unit
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.materials import Conductor, Diffuse, Principled, RoughPlastic, Subsurface, Texture
from twin.description.object_mesh import ObjectMesh, built_in
from twin.engines.mitsuba_files import write_mitsuba
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import pick_variant

pytestmark = pytest.mark.render

MIDDLE = np.array([5.0, -3.0, -300.0])


def placed(scale, at, turn=None):
    matrix = np.eye(4)
    matrix[:3, :3] = scale * (np.eye(3) if turn is None else turn)
    matrix[:3, 3] = at
    return matrix


def scene(lights_kind, **change):
    """A textured square with a coat, a coloured one, a metal, a wax ball: nothing in it is symmetric."""
    values = np.zeros((2, 3, 3), np.float32) + [0.1, 0.2, 0.1]
    values[0, 0], values[0, 2], values[1, 0] = [0.9, 0.1, 0.1], [0.1, 0.8, 0.2], [0.2, 0.2, 0.9]
    square = built_in("square")
    corners = np.array([[0.9, 0.1, 0.1], [0.1, 0.9, 0.1], [0.1, 0.1, 0.9], [0.6, 0.6, 0.6]])
    coloured = ObjectMesh(square.vertices, square.faces, None, None, corners)
    objects = (
        TwinObject("back", square, "picture", placed(60, MIDDLE)),
        TwinObject("flag", coloured, "colours", placed(12, MIDDLE + [-35, 25, 20])),
        TwinObject("ball", built_in("sphere"), "wax", placed(14, MIDDLE + [20, -20, 20])),
        TwinObject("rod", built_in("cylinder"), "metal", placed(9, MIDDLE + [-20, -25, 15])),
    )
    materials = {
        "picture": RoughPlastic(Texture(values), 0.3, 0.8, covered=0.1),
        "colours": Principled("vertex", 0.3),
        "wax": Diffuse((0.3, 0.3, 0.6), Subsurface(3.0)),
        "metal": Conductor("Cu", 0.3),
    }
    vectors = unit(np.array([[-0.5, 0.4, 0.8], [0.6, 0.2, 0.7]]))
    colours = np.array([[1.0, 0.9, 0.7], [0.5, 0.6, 0.8]])
    near = None if lights_kind == "distant" else MIDDLE + np.array([[350.0], [250.0]]) * vectors
    lights = Lights(("left", "right_1.b"), vectors, colours, near, MIDDLE, white_value=np.array([0.7, 0.8, 0.9]))
    radii = np.full(2, 40.0 if lights_kind == "area" else 0.0)
    camera = Camera(48, 40, 95.0, 95.0, 25.1, 18.7)
    return replace(
        TwinScene(camera, objects, materials, lights, radii, sampling=Sampling("mitsuba", max_depth=3)), **change
    )


def stock(folder, light, samples):
    variant, _ = pick_variant()
    command = [str(Path(sys.executable).parent / "mitsuba"), "-m", variant, "-D", f"light={light}"]
    command += ["-D", f"samples={samples}", "-o", str(folder / f"{light}.exr"), "scene.xml"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=os.environ)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return read_picture(folder / f"{light}.exr", "linear")


@pytest.mark.full
@pytest.mark.parametrize("kind", ["distant", "point", "area"])
def test_the_stock_command_line_renders_what_the_engine_renders(kind, tmp_path):
    environment = Environment()
    if kind == "area":
        sky = np.random.default_rng(10003).uniform(0, 0.3, (4, 8, 3)).astype(np.float32)
        environment = Environment(Texture(sky), 0.5, 40.0, (0.02, 0.01, 0.03))
    given = scene(kind, environment=environment)
    paths, notes = write_mitsuba(given, tmp_path)
    assert [path.name for path in paths] == ["scene.xml", "left.xml", "right_1.b.xml"]
    assert not notes
    film, samples = given.film(), 144
    tracer = PathTracer(given, film)
    ours = [tracer.image(index, samples) for index in (0, 1)]
    noise = [np.abs(tracer.image(index, samples, seed=5) - ours[index]).mean() for index in (0, 1)]
    for index, light in enumerate(given.lights.names):
        theirs = stock(tmp_path, light, samples)
        assert theirs.shape == (40, 48, 3)
        theirs = theirs[film.rows, film.columns]
        scale = ours[index].mean()
        difference = np.abs(theirs - ours[index]).mean()
        assert difference < 1.3 * noise[index] + 1e-4 * scale
        assert np.abs(theirs.mean((0, 1)) / ours[index].mean((0, 1)) - 1).max() < 0.02
        # A wrong light, axis or texture would be many times that.
        other = ours[1 - index]
        for wrong in (other, ours[index][::-1], ours[index][:, ::-1]):
            assert np.abs(theirs - wrong).mean() > 4 * difference


def test_an_orthographic_camera_and_a_lens_are_written_too(tmp_path):
    given = scene("distant", camera=Camera(40, 32, 0.31, 0.31, 22.0, 14.0, projection="orthographic"))
    write_mitsuba(given, tmp_path / "flat")
    film = given.film()
    ours = PathTracer(given, film).image(0, 64)
    theirs = stock(tmp_path / "flat", "left", 64)[film.rows, film.columns]
    assert np.abs(theirs - ours).mean() < 0.06 * ours.mean()
    assert np.abs(theirs - ours[:, ::-1]).mean() > 0.3 * ours.mean()
    _, notes = write_mitsuba(scene("distant", camera=Camera(48, 40, 95, 97, 25, 19, (-0.1, 0, 0, 0, 0))), tmp_path)
    assert "no distortion" in notes[0]


def test_a_light_whose_name_is_no_file_name_is_refused(tmp_path):
    given = scene("point")
    given = replace(given, lights=replace(given.lights, names=("../up", "b")))
    with pytest.raises(RenderError, match="can be no file's name"):
        write_mitsuba(given, tmp_path)
    assert not list(tmp_path.iterdir())

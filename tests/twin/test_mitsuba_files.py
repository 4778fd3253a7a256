"""The files for Mitsuba's own command line: what it renders from them is what the engine renders."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from formats.meshes.scan_files import ObjectMesh
from formats.picture_files import read_picture
from scene.camera import Camera
from scene.errors import RenderError
from tests.twin.twin_scenes import lights, placed
from twin.description.description import Environment, Sampling, TwinScene
from twin.description.materials import Conductor, Diffuse, Principled, RoughPlastic, Subsurface, Texture
from twin.description.object_mesh import built_in
from twin.engines.mitsuba_files import write_mitsuba
from twin.engines.path_tracing import PathTracer
from twin.engines.variant import pick_variant

pytestmark = pytest.mark.render

OFF = np.array([5.0, -3.0, 0.0])


def scene(kind, **change):
    """A textured square with a coat, a coloured one, a metal, a wax ball: nothing in it is symmetric."""
    values, square = np.zeros((2, 3, 3), np.float32) + [0.1, 0.2, 0.1], built_in("square")
    values[0, 0], values[0, 2], values[1, 0] = [0.9, 0.1, 0.1], [0.1, 0.8, 0.2], [0.2, 0.2, 0.9]
    corners = np.array([[0.9, 0.1, 0.1], [0.1, 0.9, 0.1], [0.1, 0.1, 0.9], [0.6, 0.6, 0.6]])
    objects = (
        placed("back", "square", "picture", 60, OFF),
        placed("flag", ObjectMesh(square.vertices, square.faces, colours=corners), "colours", 12, OFF + [-35, 25, 20]),
        placed("ball", "sphere", "wax", 14, OFF + [20, -20, 20]),
        placed("rod", "cylinder", "metal", 9, OFF + [-20, -25, 15]),
    )
    materials = {
        "picture": RoughPlastic(Texture(values), 0.3, 0.8, covered=0.1),
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
    given = scene(kind, environment=environment)
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
    given = scene("distant", camera=Camera(40, 32, 0.31, 0.31, 22.0, 14.0, projection="orthographic"))
    write_mitsuba(given, tmp_path / "flat")
    film = given.film()
    ours = PathTracer(given, film).image(0, 64)
    theirs = stock(tmp_path / "flat", "left", 64)[film.rows, film.columns]
    assert np.abs(theirs - ours).mean() < 0.06 * ours.mean()
    assert np.abs(theirs - ours[:, ::-1]).mean() > 0.3 * ours.mean()
    lens = scene("distant", camera=Camera(48, 40, 95, 97, 25, 19, (-0.1, 0, 0, 0, 0)))
    assert "no distortion" in write_mitsuba(lens, tmp_path / "lens")[1][0]
    upward = replace(given, lights=replace(given.lights, names=("../up", "b")))
    with pytest.raises(RenderError, match="can be no file's name"):
        write_mitsuba(upward, tmp_path / "none")
    assert not (tmp_path / "none").exists()

"""A rendering that is killed and run again: what is done stays, what lacks is made, and the result is the same."""

import hashlib
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from scene.store import Store
from twin.description.description import Environment, Sampling, TwinObject, TwinScene
from twin.description.description_file import read_scene
from twin.description.materials import Diffuse, RoughPlastic
from twin.description.object_mesh import built_in
from twin.engines import layers
from twin.engines.layers import pieces_of, render_layers
from twin.engines.render import render_scene, rendering_mark
from twin.engines.unfinished import Unfinished
from twin.engines.variant import SLOW, pick_variant

pytestmark = pytest.mark.render
NEEDS_LLVM = pytest.mark.skipif(pick_variant()[0] == SLOW, reason="no LLVM that works is here")
ENGINES = ["mitsuba", pytest.param("many", marks=NEEDS_LLVM)]

BAND = 3 * 48 * 6 * 8
"""Values of eight rows of six frames."""


def scene_for(engine, **change):
    def placed(name, shape, size, z, use):
        matrix = np.diag([size, size, size, 1.0])
        matrix[2, 3] = z
        return TwinObject(name, built_in(shape), use, matrix)

    angle = np.arange(6) * np.pi / 3
    directions = unit(np.stack([0.6 * np.cos(angle), 0.6 * np.sin(angle), np.ones(6)], -1))
    scene = TwinScene(
        Camera(48, 40, 150.0, 150.0, 23.5, 19.5),
        (placed("ball", "sphere", 25.0, -300.0, "m"), placed("wall", "square", 90.0, -326.0, "w")),
        {"m": RoughPlastic((0.6, 0.5, 0.4), 0.3), "w": Diffuse((0.8, 0.8, 0.8))},
        Lights(tuple(f"flash_{i}" for i in range(6)), directions, np.ones((6, 3))),
        sampling=Sampling(engine, samples=16, max_depth=4, error=0.02),
    )
    return replace(scene, **change)


TEXT = """
[camera]
width = 48
height = 40
fx = 150.0
[[objects]]
shape = "sphere"
scale = 25
translate_mm = [0, 0, -300]
material = "m"
[[objects]]
shape = "square"
scale = 90
translate_mm = [0, 0, -326]
material = "w"
[materials.m]
kind = "rough_plastic"
reflectance = [0.6, 0.5, 0.4]
roughness = 0.3
[materials.w]
kind = "diffuse"
reflectance = 0.8
[[lights]]
kind = "ring"
count = 6
polar_deg = 31
"""


def contents(folder):
    """Return the hash of every file below a folder."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


# Renders a scene description; waits a moment after each piece, so that it can be killed in the middle.
VICTIM = f"""
import sys, time
from pathlib import Path
from scene.store import Store
from twin.engines import layers
from twin.description.description_file import read_scene
from twin.engines.render import render_scene, rendering_mark
layers.VALUES_PER_BAND = {BAND}
def progress(done, total):
    print("piece", done, total, flush=True)
    time.sleep(0.3)
render_scene(read_scene(Path(sys.argv[1])), apart=True, store=Store(Path(sys.argv[2])), progress=progress)
"""


@pytest.mark.parametrize(
    "engine",
    [
        pytest.param(ENGINES[0], marks=pytest.mark.full),
        ENGINES[1],
        pytest.param("many", marks=[NEEDS_LLVM, pytest.mark.full]),
    ],
)
def test_a_killed_rendering_goes_on_where_it_was(engine, tmp_path, monkeypatch):
    monkeypatch.setattr(layers, "VALUES_PER_BAND", BAND)
    source = tmp_path / "scene.toml"
    source.write_text(TEXT + f'[sampling]\nengine = "{engine}"\nsamples = 16\nmax_depth = 4\n')
    scene = read_scene(source)
    # The band's size is no part of the mark: the victim cuts as this process does.
    command = [sys.executable, "-c", VICTIM, str(source), str(tmp_path / "killed")]
    root = Path(__file__).parents[2]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith("piece 2 "):
                os.kill(process.pid, signal.SIGKILL)
                break
        assert process.wait() == -signal.SIGKILL
    left = tmp_path / "killed" / "unfinished"
    assert (left / "codes.npy").exists()
    assert not (tmp_path / "killed" / "frames").exists(), "no half rendering may look like a whole one"

    # What a piece had written that was not finished must not matter.
    pieces = pieces_of(scene.film(), 6, engine)
    assert len(pieces) > 4
    codes = np.load(left / "codes.npy", mmap_mode="r+")
    codes[pieces[-1].frames, scene.film().rows.start + pieces[-1].rows.start] = 12345
    codes.flush()
    del codes

    told = []
    rendered = render_scene(
        scene, apart=True, store=Store(tmp_path / "killed"), progress=lambda done, total: told.append((done, total))
    )
    assert (rendered.found, rendered.pieces) == (2, len(pieces))
    assert told == [(done, len(pieces)) for done in range(2, len(pieces) + 1)]
    fresh = render_scene(scene, apart=True, store=Store(tmp_path / "fresh"))
    assert fresh.found == 0
    assert contents(tmp_path / "killed") == contents(tmp_path / "fresh")
    assert not left.exists()
    assert rendered.frames.read().mean() > 0.05


@pytest.mark.full
def test_another_scene_takes_nothing_of_what_was_left(tmp_path):
    scene = scene_for("mitsuba")

    def stop(done, total):
        if done == 3:
            raise KeyboardInterrupt

    for changed, found in (
        (scene, 3),
        (replace(scene, lights=replace(scene.lights, intensities=np.full((6, 3), 2.0))), 0),
    ):
        with pytest.raises(KeyboardInterrupt):
            render_scene(scene, store=Store(tmp_path), progress=stop)
        rendered = render_scene(changed, store=Store(tmp_path))
        assert rendered.found == found
        expected = render_scene(changed).frames.codes
        assert np.array_equal(rendered.frames.codes, expected)


def test_a_mark_tells_what_makes_a_difference_and_nothing_else():
    scene = scene_for("mitsuba")
    assert rendering_mark(scene, False) == rendering_mark(scene_for("mitsuba"), False)
    assert scene.points.size, "what is computed on the way is no part of it"
    assert rendering_mark(scene, False) == rendering_mark(scene_for("mitsuba"), False)
    moved = replace(scene.objects[0], matrix=scene.objects[0].matrix + 1e-9)
    changes = [
        {"objects": (moved, *scene.objects[1:])},
        {"materials": {**scene.materials, "m": RoughPlastic((0.6, 0.5, 0.4), 0.30001)}},
        {"camera": replace(scene.camera, cx=23.6)},
        {"sampling": replace(scene.sampling, max_depth=3)},
        {"environment": Environment(ambient=(0, 0, 0.1))},
        {"radii_mm": np.full(6, 1.0)},
    ]
    marks = {rendering_mark(replace(scene, **change), False) for change in changes} | {rendering_mark(scene, True)}
    assert len(marks) == len(changes) + 1
    assert rendering_mark(scene, False) not in marks


def test_damaged_notes_are_started_anew(tmp_path):
    """Whatever byte of the notes changes, nothing is taken from them, and nothing is raised."""
    kept = Unfinished(tmp_path / "left", "a")
    kept.begin({"engine": "many", "samples": 9}, {"codes": ((2, 3), np.uint16, 0)})
    kept.finished(0)
    again = Unfinished(tmp_path / "left", "a")
    assert (again.notes, again.done) == (kept.notes, {0})
    notes, array = (tmp_path / "left" / name for name in ("rendering.json", "codes.npy"))
    whole, values = notes.read_bytes(), array.read_bytes()
    for damaged in (*(whole.replace(byte, b"7") for byte in (b"0", b"d", b":")), whole[:-9], b"[" * 100_000):
        notes.parent.mkdir(exist_ok=True)
        notes.write_bytes(damaged)
        array.write_bytes(values)
        assert Unfinished(tmp_path / "left", "a").notes is None
        assert not notes.parent.exists()


@pytest.mark.full
@pytest.mark.parametrize("engine", ENGINES)
def test_light_is_kept_apart_and_adds_up(engine, tmp_path):
    scene = scene_for(engine, environment=Environment(ambient=(0.05, 0.1, 0.02)))
    rendered = render_scene(scene, apart=True, store=Store(tmp_path))
    direct, indirect, standing = (
        np.load(tmp_path / f"truth_{name}.npy").astype(np.float32) for name in ("direct", "indirect", "standing")
    )
    assert direct.shape == (6, 40, 48, 3)
    assert np.array_equal(standing, rendered.standing)
    assert np.allclose(direct + indirect + standing, rendered.frames.read(), atol=2e-3)
    alone = render_scene(replace(scene, environment=Environment(), sampling=replace(scene.sampling, max_depth=2)))
    assert np.allclose(alone.frames.read().mean((1, 2)), direct.mean((1, 2)), rtol=0.01)
    # Of one kind with the plain rendering: the same scene, asked for as a whole.
    whole = render_scene(scene)
    assert np.allclose(whole.standing.mean(), standing.mean(), rtol=0.02)
    assert np.allclose(whole.frames.read().mean((1, 2)), rendered.frames.read().mean((1, 2)), rtol=0.02)
    shadow = np.unpackbits(np.load(tmp_path / "truth_cast.npy"), axis=-1, count=6, bitorder="little")
    shadow = np.moveaxis(shadow, -1, 0).astype(bool)
    assert shadow.sum() > 100
    assert np.median(direct[shadow]) < 1e-3
    assert np.median(indirect[shadow].mean(-1)) > 1e-3
    assert indirect.min() > -1e-3


@NEEDS_LLVM
@pytest.mark.parametrize("sign", [1, -1])
def test_a_lens_is_rendered_through_to_where_the_camera_projects(sign):
    """Squares at known places: their middles in the picture are where the distorting camera projects them."""
    camera = Camera(96, 80, 150.0, 158.0, 47.5 + sign * 6.3, 39.5 - sign * 5.7, (-0.9, 0.5, 0.03, -0.04, 0.0))
    u, v = np.meshgrid([14.3, 40.8, 77.6], [11.7, 33.4, 66.2])
    wanted = np.stack([u, v], -1).reshape(-1, 2)
    objects = []
    for pixel, z in zip(wanted, np.linspace(-330, -270, 9), strict=True):
        matrix = np.diag([3.0, 3.0, 3.0, 1.0])
        matrix[:3, 3] = camera.points_at_depth(pixel, z)
        objects.append(TwinObject(str(pixel), built_in("square"), "w", matrix))
    scene = scene_for("many", camera=camera, objects=tuple(objects))
    film = scene.film()
    assert film.pixels is not None
    image = np.zeros((80, 96))
    image[film.rows, film.columns] = render_layers(scene, film, "many", 64).frames()[0, ..., 1]
    plain = replace(camera, distortion=(0.0,) * 5)
    rows, columns = np.mgrid[:80, :96]
    bent = []
    for one, pixel in zip(objects, wanted, strict=True):
        weight = image * (np.hypot(columns - pixel[0], rows - pixel[1]) < 7)
        found = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
        assert np.linalg.norm(found - pixel) < 0.1
        bent.append(np.linalg.norm(plain.project(one.matrix[:3, 3]) - pixel))
    assert max(bent) > 1, "the lens makes a difference here"

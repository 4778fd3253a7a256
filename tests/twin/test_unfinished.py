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

from fixtures.lit_surfaces import spiral
from scene.store import Store
from tests.twin.twin_scenes import NEEDS_LLVM, ball_and_wall, lights
from twin.description.description import Environment, Sampling
from twin.description.materials import RoughPlastic
from twin.engines import light_layers
from twin.engines.light_layers import pieces_of
from twin.engines.render import render_scene, rendering_mark

pytestmark = pytest.mark.render
BAND = 3 * 48 * 6 * 8
"""Values of eight rows of six frames."""


def scene_for(engine, **change):
    given = lights(*spiral(np.full(6, 0.857), turn=np.pi / 3))
    sampling = Sampling(engine, samples=16, max_depth=4, error=0.02)
    return replace(ball_and_wall(given, RoughPlastic((0.6, 0.5, 0.4), 0.3), sampling), **change)


def contents(folder):
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


# Renders a scene; waits a moment after each piece, so that it can be killed in the middle.
VICTIM = f"""
import sys, time
from pathlib import Path
from scene.store import Store
from tests.twin.test_unfinished import scene_for
from twin.engines import light_layers
from twin.engines.render import render_scene
light_layers.VALUES_PER_BAND = {BAND}
def progress(done, total):
    print("piece", done, total, flush=True)
    time.sleep(0.3)
render_scene(scene_for(sys.argv[1]), apart=True, store=Store(Path(sys.argv[2])), progress=progress)
"""


@pytest.mark.parametrize(
    "engine", [pytest.param("mitsuba", marks=pytest.mark.full), pytest.param("many", marks=NEEDS_LLVM)]
)
def test_a_killed_rendering_goes_on_where_it_was(engine, tmp_path, monkeypatch):
    monkeypatch.setattr(light_layers, "VALUES_PER_BAND", BAND)
    scene, killed = scene_for(engine), tmp_path / "killed"
    # The band's size is no part of the mark: the victim cuts as this process does.
    command, root = [sys.executable, "-c", VICTIM, engine, str(killed)], Path(__file__).parents[2]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root) as process:
        assert any(line.startswith("piece 2 ") for line in process.stdout)
        os.kill(process.pid, signal.SIGKILL)
        assert process.wait() == -signal.SIGKILL
    left = killed / "unfinished"
    assert (left / "codes.npy").exists()
    assert not (killed / "frames").exists(), "no half rendering may look like a whole one"

    # What a piece had written that was not finished must not matter.
    pieces, codes = pieces_of(scene.film(), 6, engine), np.load(left / "codes.npy", mmap_mode="r+")
    assert len(pieces) > 4
    codes[pieces[-1].frames, scene.film().rows.start + pieces[-1].rows.start] = 12345
    codes.flush()
    del codes

    told = []
    rendered = render_scene(
        scene, apart=True, store=Store(killed), progress=lambda done, total: told.append((done, total))
    )
    assert (rendered.found, rendered.pieces) == (2, len(pieces))
    assert told == [(done, len(pieces)) for done in range(2, len(pieces) + 1)]
    assert render_scene(scene, apart=True, store=Store(tmp_path / "fresh")).found == 0
    assert contents(killed) == contents(tmp_path / "fresh")
    assert not left.exists()
    assert rendered.frames.read().mean() > 0.05


@pytest.mark.full
def test_another_scene_takes_nothing_of_what_was_left(tmp_path):
    scene = scene_for("mitsuba")

    def stop(done, total):
        if done == 3:
            raise KeyboardInterrupt

    brighter = replace(scene, lights=replace(scene.lights, intensities=np.full((6, 3), 2.0)))
    for changed, found in ((scene, 3), (brighter, 0)):
        with pytest.raises(KeyboardInterrupt):
            render_scene(scene, store=Store(tmp_path), progress=stop)
        rendered = render_scene(changed, store=Store(tmp_path))
        assert rendered.found == found
        assert np.array_equal(rendered.frames.codes, render_scene(changed).frames.codes)


def test_a_mark_tells_what_makes_a_difference_and_nothing_else():
    scene = scene_for("mitsuba")
    assert scene.points.size, "what is computed on the way is no part of it"
    mark = rendering_mark(scene, False)
    assert mark == rendering_mark(scene_for("mitsuba"), False)
    changes = [
        {"objects": (replace(scene.objects[0], matrix=scene.objects[0].matrix + 1e-9), *scene.objects[1:])},
        {"materials": {**scene.materials, "m": RoughPlastic((0.6, 0.5, 0.4), 0.30001)}},
        {"camera": replace(scene.camera, cx=23.6)},
        {"sampling": replace(scene.sampling, max_depth=3)},
        {"environment": Environment(ambient=(0, 0, 0.1))},
        {"radii_mm": np.full(6, 1.0)},
    ]
    marks = {rendering_mark(replace(scene, **change), False) for change in changes} | {rendering_mark(scene, True)}
    assert len(marks - {mark}) == len(changes) + 1


@pytest.mark.full
@pytest.mark.parametrize("engine", ["mitsuba", pytest.param("many", marks=NEEDS_LLVM)])
def test_light_is_kept_apart_and_adds_up(engine, tmp_path):
    scene = scene_for(engine, environment=Environment(ambient=(0.05, 0.1, 0.02)))
    rendered = render_scene(scene, apart=True, store=Store(tmp_path))
    names = ("direct", "indirect", "standing")
    direct, indirect, standing = (np.load(tmp_path / f"truth_{name}.npy").astype(np.float32) for name in names)
    assert direct.shape == (6, 40, 48, 3)
    assert np.array_equal(standing, rendered.standing)
    assert np.allclose(direct + indirect + standing, rendered.frames.read(), atol=2e-3)
    alone = render_scene(replace(scene, environment=Environment(), sampling=replace(scene.sampling, max_depth=2)))
    assert np.allclose(alone.frames.read().mean((1, 2)), direct.mean((1, 2)), rtol=0.01)
    # Of one kind with the plain rendering: the same scene, asked for as a whole.
    assert np.allclose(render_scene(scene).frames.read().mean((1, 2)), rendered.frames.read().mean((1, 2)), rtol=0.02)
    shadow = np.unpackbits(np.load(tmp_path / "truth_cast.npy"), axis=-1, count=6, bitorder="little")
    shadow = np.moveaxis(shadow, -1, 0).astype(bool)
    assert shadow.sum() > 100
    assert np.median(direct[shadow]) < 1e-3 < np.median(indirect[shadow].mean(-1))
    assert indirect.min() > -1e-3

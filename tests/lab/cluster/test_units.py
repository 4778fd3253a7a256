"""What goes to the workers: little through the scheduler, each large array once through the folder that all share."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from capture.photographs.decode import decode
from capture.session.session import load_session
from fixtures.mesh_shapes import ball
from lab.cluster import LARGE, pack
from scene.camera import Camera
from scene.lights import Lights
from scene.normals import unit
from scene.pose import Pose
from scene.store import Store
from solve.solve import solve
from twin.description.description import Sampling
from twin.engines.render import render_scene
from twin.scan_scene import scan_scene
from twin.visibility import Sight

MOST = 2 * LARGE
"""Bytes of a unit."""


class Scales(ThreadPoolExecutor):
    """Does its units here, as they were packed, and weighs them."""

    def __init__(self, folder):
        super().__init__(2)
        self.folder, self.bytes = folder, []

    def submit(self, function, /, *arguments, **named):
        packed = pack((function, arguments, named), self.folder)
        self.bytes.append(len(packed))
        function, arguments, named = pickle.loads(packed)
        return super().submit(function, *arguments, **named)


@pytest.fixture
def executor(tmp_path):
    with Scales(tmp_path) as scales:
        yield scales


@pytest.mark.full
def test_units_of_every_step_are_small_and_give_the_same(session, executor, tmp_path):
    photographs = load_session(session[0])
    frames, _ = decode(photographs, Store(tmp_path / "here"))
    there, _ = decode(photographs, Store(tmp_path / "there"), executor=executor)
    assert len(executor.bytes) == 24
    np.testing.assert_array_equal(there.codes, frames.codes)
    azimuth = np.arange(24) * np.pi / 12
    directions = unit(np.stack([np.cos(azimuth), np.sin(azimuth), np.full(24, np.sqrt(3))], -1))
    lights = Lights(frames.names, directions, np.ones((24, 3)), white_value=np.ones(3))
    camera = Camera(frames.width, frames.height, 400.0, 400.0, frames.width / 2, frames.height / 2)
    for method in ("ls", "rpca"):
        maps = [solve(method, frames, lights, camera, session[2], executor=one) for one in (None, executor)]
        np.testing.assert_array_equal(maps[0].normals, maps[1].normals)
    mesh = ball(60.0)
    assert mesh.vertices.nbytes > MOST
    assert frames.codes[0].nbytes > MOST
    sent = len(executor.bytes)
    pose, albedo = Pose.from_rotation_translation(np.eye(3), np.array([0, 0, -300.0])), np.full((180, 240, 3), 0.5)
    scene, _ = scan_scene(Sight(mesh.moved(pose.matrix), camera, lights), albedo, Sampling("many"))
    rendered = [render_scene(scene, executor=one).frames.codes for one in (None, executor)]
    np.testing.assert_array_equal(*rendered)
    assert len(executor.bytes) > sent
    assert max(executor.bytes) < MOST


@pytest.mark.parametrize("is_shared", [False, True])
def test_what_is_packed_comes_out_the_same(tmp_path, is_shared):
    folder = tmp_path / "out" if is_shared else None
    stored = tmp_path / "map.npy"
    np.save(stored, np.arange(3 * LARGE).reshape(3, -1))
    values = {
        "map": np.load(stored, mmap_mode="r"),
        "window": np.load(stored, mmap_mode="r")[1:, ::2],
        "columns": np.asfortranarray(np.random.default_rng(1).random((300, 400))),
        "step": np.arange(4 * LARGE)[::-3],
        "empty": np.empty((0, 3)),
        "scalar": np.array(2.5),
        "objects": np.array([None, "a"], object),
        "masked": np.ma.masked_array(np.arange(LARGE), np.arange(LARGE) % 2 == 0),
        "records": np.zeros(LARGE, [("a", "f4"), ("b", "i8")]),
        "call": partial(np.add, np.ones(LARGE)),
    }
    packed = pack(values, folder)
    found = pickle.loads(packed)
    for name in set(values) - {"call"}:
        np.testing.assert_array_equal(found[name], values[name], strict=True)
    assert found["columns"].flags.f_contiguous
    np.testing.assert_array_equal(found["masked"].mask, values["masked"].mask)
    np.testing.assert_array_equal(found["call"](1), np.full(LARGE, 2.0))
    # What a unit writes into its arrays stays its own.
    found["step"][:] = 0
    np.testing.assert_array_equal(pickle.loads(packed)["step"], values["step"])


def test_paths_are_sent_in_full(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    packed = pack((Path("raw/a.dng"), Path("/b")), None)
    monkeypatch.chdir("/")
    assert pickle.loads(packed) == (tmp_path / "raw" / "a.dng", Path("/b"))

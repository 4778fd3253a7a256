"""What goes to the workers: little through the scheduler, each large array once through the folder that all share."""

import asyncio
import errno
import pickle
from concurrent.futures import ThreadPoolExecutor, wait
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh

from capture.photographs.decode import decode
from capture.session.session import load_session
from lab.cluster.executor import Cluster
from lab.cluster.worker import LARGE, content_name, pack, unpack
from scene.camera import Camera
from scene.errors import ClusterError
from scene.lights import Lights
from scene.mesh import Mesh
from scene.normals import unit
from scene.pose import Pose
from scene.store import Store
from solve.solve import solve
from twin.description.description import Sampling
from twin.engines.render import render_scene
from twin.scan_scene import scan_scene
from twin.visibility import Sight

MOST = 2 * LARGE
"""Bytes of a unit, with the text that it is served by."""


class Scales:
    """Dask's client, in this process: it does the units that it is given, and weighs them."""

    def __init__(self):
        self.bytes, self.files, self.shared = [], [], None
        self.pool, self.loop = ThreadPoolExecutor(2), self

    def submit(self, function, expression, order, *, key, pure):
        self.bytes.append(len(pickle.dumps((expression, order))))
        self.files.append({path.name for path in self.shared.iterdir()})
        return Done(self.pool.submit(function, expression, order))

    def add_callback(self, function, *arguments):
        self.pool.submit(asyncio.run, function(*arguments))


class Done:
    """Dask's future, of what is done here."""

    status = "finished"

    def __init__(self, future):
        self.future = future

    def __await__(self):
        return asyncio.wrap_future(self.future).__await__()

    def release(self):
        """There is nothing to forget."""


@pytest.fixture
def scales(tmp_path):
    return Scales()


@pytest.fixture
def executor(scales, tmp_path):
    """The executor of a cluster that weighs its units."""
    scales.shared = tmp_path / "shared"
    scales.shared.mkdir()
    (scales.shared / "files").write_text("")
    yield Cluster(scales, "tcp://scales", scales.shared)
    scales.pool.shutdown()


def left(shared):
    return {path.name for path in shared.iterdir()} - {"files"}


@pytest.mark.full
def test_units_of_every_step_are_small_and_give_the_same(session, scales, executor, tmp_path):
    photographs = load_session(session[0])
    frames, _ = decode(photographs, Store(tmp_path / "here"))
    there, _ = decode(photographs, Store(tmp_path / "there"), executor=executor)
    assert len(scales.bytes) == 24
    np.testing.assert_array_equal(there.codes, frames.codes)
    azimuth = np.arange(24) * np.pi / 12
    directions = unit(np.stack([np.cos(azimuth), np.sin(azimuth), np.full(24, np.sqrt(3))], -1))
    lights = Lights(frames.names, directions, np.ones((24, 3)), white_value=np.ones(3))
    camera = Camera(frames.width, frames.height, 400.0, 400.0, frames.width / 2, frames.height / 2)
    for method in ("ls", "rpca"):
        maps = [solve(method, frames, lights, camera, session[2], executor=one) for one in (None, executor)]
        np.testing.assert_array_equal(maps[0].normals, maps[1].normals)
    ball = trimesh.creation.icosphere(5, 60.0)
    mesh = Mesh(np.array(ball.vertices), np.array(ball.faces))
    assert mesh.vertices.nbytes > MOST
    assert frames.codes[0].nbytes > MOST
    sent = len(scales.bytes)
    pose, albedo = Pose.from_rotation_translation(np.eye(3), np.array([0, 0, -300.0])), np.full((180, 240, 3), 0.5)
    scene, _ = scan_scene(Sight.of_scan(mesh, pose, camera, lights), albedo, Sampling("many"))
    rendered = [render_scene(scene, executor=one).frames.codes for one in (None, executor)]
    np.testing.assert_array_equal(*rendered)
    assert len(scales.bytes) > sent
    assert max(scales.bytes) < MOST
    assert not left(scales.shared)


def test_an_array_of_many_units_is_one_file_while_one_of_them_needs_it(scales, executor):
    array = np.arange(LARGE, dtype=np.float64)
    units = [executor.submit(np.add, array, number) for number in range(5)]
    wait(units)
    for number, done in enumerate(units):
        np.testing.assert_array_equal(done.result(), array + number)
    name = content_name(array)
    assert all(name in files for files in scales.files)
    # The arrays that came back are files until they are taken up.
    assert max(len(files) for files in scales.files) <= 1 + 1 + len(units)
    assert not left(scales.shared)
    assert max(scales.bytes) < MOST


def test_a_full_disk_is_told(scales, executor, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    assert executor.submit(len, "a").result() == 1
    monkeypatch.setattr("lab.cluster.worker.os.replace", full)
    with pytest.raises(ClusterError, match=r"shared: the disk is full .* run the same command again"):
        executor.submit(len, np.zeros(LARGE))
    # By the worker, of what it gives back.
    with pytest.raises(ClusterError, match="the disk is full"):
        executor.submit(np.zeros, LARGE).result()


def test_what_is_packed_comes_out_the_same(tmp_path):
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
        "text": "x" * 3 * LARGE,
        "call": partial(np.add, np.ones(LARGE)),
    }
    for folder in (None, str(tmp_path)):
        found = unpack(pack(values, folder, content_name), folder)
        for name in set(values) - {"text", "call"}:
            np.testing.assert_array_equal(found[name], values[name], strict=True)
        assert found["columns"].flags.f_contiguous
        assert found["text"] == values["text"]
        np.testing.assert_array_equal(found["masked"].mask, values["masked"].mask)
        np.testing.assert_array_equal(found["call"](1), np.full(LARGE, 2.0))
    # What a unit writes into its arrays stays its own.
    packed = pack(values, str(tmp_path), content_name)
    unpack(packed, str(tmp_path))["step"][:] = 0
    np.testing.assert_array_equal(unpack(packed, str(tmp_path))["step"], values["step"])
    assert len(packed[0]) < LARGE


def test_paths_are_sent_in_full(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    packed = pack((Path("raw/a.dng"), Path("/b")), None, content_name)
    monkeypatch.chdir("/")
    assert unpack(packed, None) == (tmp_path / "raw" / "a.dng", Path("/b"))

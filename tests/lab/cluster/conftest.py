"""A real cluster on this machine: a scheduler and workers, each a process, that tests start, hinder and kill."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from scene.files import write_png
from tests.conftest import ROOT, until

COMMAND = [sys.executable, "-c", "from rgbn.cli import main; main()"]
FRAMES = 24
METHODS = "ls,iterative,rpca"
HABITS = """
import os, signal, sys, time

def on_open(word, act):
    count = [0]
    def hear(event, arguments):
        if event == "open" and word in str(arguments[0]):
            count[0] += 1
            act(count[0])
    sys.addaudithook(hear)

"""
"""Put before what a worker is to do when it opens a file for its work: it is run before the worker starts."""


class Cluster:
    """Processes in a folder, and what they say."""

    SLOW = """
def slow(count):
    time.sleep(0.5)
    open(os.path.join(os.path.dirname(__file__), "works"), "w").close()

on_open("flash_", slow)
"""

    def __init__(self, folder):
        self.folder, self.address = folder, None
        self.scheduler, self.workers, self.runs = None, [], []

    def start_scheduler(self, **settings):
        said = self.folder / f"scheduler-{time.time_ns()}"
        words = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
        self.scheduler = self._dask(words, said, settings)
        self.address = self._heard(self.scheduler, said, "Scheduler at:").split()[-1]
        return self.address

    def start_worker(self, *, habit="", house=ROOT, first=()):
        """Start a worker of the house in a folder; `habit` is what it does beside, `first` a command that starts it."""
        place = self.folder / f"worker-{len(self.workers)}"
        place.mkdir()
        (place / "sitecustomize.py").write_text(HABITS + habit if habit else "")
        words = ["worker", self.address, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--local-directory", place]
        settings = {"PYTHONPATH": f"{place}{os.pathsep}{house}"}
        self.workers.append(self._dask(words, place / "said", settings, first))
        self._heard(self.workers[-1], place / "said", "Registered to:")
        return self.workers[-1]

    def solve(self, session, out, **settings):
        """Run `rgbn solve` on the cluster, to its end; return it with what it said."""
        return self.run("solve", session, "--out", out, "--method", METHODS, **settings)

    def begin(self, session, out):
        """Start `rgbn solve` on the cluster, and wait until its first, slow worker is at work."""
        process = self.start("solve", session, "--out", out, "--method", METHODS)
        working = self.folder / "worker-0" / "works"
        until(lambda: working.exists() or process.poll() is not None, process.said.read_text)
        assert working.exists(), process.said.read_text()
        return process

    def run(self, *words, **settings):
        """Run rgbn on the cluster, to its end; return it with what it said."""
        return self.finish(self.start(*words, **settings))

    @staticmethod
    def finish(process):
        """Wait for a command; return it with what it said."""
        process.wait(timeout=300)
        process.stderr = process.said.read_text()
        return process

    def start(self, *words, scheduler=True, **settings):
        """Start rgbn; its lines go where `said` is."""
        there = ["--scheduler", self.address] if scheduler else []
        with open(self.folder / f"run-{time.time_ns()}", "w+") as said:
            process = subprocess.Popen(
                [*COMMAND, *map(str, words), *there], env=os.environ | {"PYTHONPATH": str(ROOT)} | settings,
                stdout=subprocess.DEVNULL, stderr=said,
            )  # fmt: skip
        process.said = Path(said.name)
        self.runs.append(process)
        return process

    def end(self):
        for process in (*self.runs, *self.workers, self.scheduler):
            if process is not None:
                process.kill()
                process.wait()

    def _dask(self, words, said, settings, first=()):
        command = [*first, sys.executable, "-m", "dask", *map(str, words)]
        with open(said, "w") as file:
            return subprocess.Popen(command, stdout=file, stderr=file, cwd=self.folder, env=os.environ | settings)

    def _heard(self, process, said, word):
        def lines():
            return [line for line in said.read_text().splitlines() if word in line]

        until(lambda: lines() or process.poll() is not None, said.read_text)
        assert lines(), said.read_text()
        return lines()[0]


@pytest.fixture
def cluster(tmp_path):
    """A cluster that ends with the test."""
    folder = tmp_path / "cluster"
    folder.mkdir()
    made = Cluster(folder)
    yield made
    made.end()


@pytest.fixture
def session(tmp_path):
    """Photographs of a matte ball under known lights; its normals; where it is."""
    folder = tmp_path / "session"
    folder.mkdir()
    v, u = np.mgrid[:180, :240]
    x, y = (u - 120) / 80, -(v - 90) / 80
    inside = x**2 + y**2 < 0.9
    normals = np.stack([x, y, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))], -1)
    azimuth = np.arange(FRAMES) * 2 * np.pi / FRAMES
    lights = np.stack([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), np.full(FRAMES, np.sqrt(0.75))], -1)
    names = [f"flash_{index:02}.png" for index in range(FRAMES)]
    for name, light in zip(names, lights, strict=True):
        image = np.where(inside, 0.7 * np.clip(normals @ light, 0, 1), 0)
        write_png(folder / name, np.repeat(image[..., None] * 65535, 3, -1).astype(np.uint16))
    write_png(folder / "mask.png", inside)
    rows = "".join(f"{name} {x} {y} {z}\n" for name, (x, y, z) in zip(names, lights, strict=True))
    (folder / "lights.lp").write_text(f"{FRAMES}\n{rows}")
    (folder / "session.toml").write_text(
        '[frames]\nflash = "flash_*.png"\nlinear = true\n[lights]\nfile = "lights.lp"\n[object]\nmask = "mask.png"\n'
    )
    return folder, normals, inside


@pytest.fixture
def same(tmp_path, session, cluster):
    """Return whether an output folder has, bit for bit, what this machine's cores alone give."""

    def compare(out):
        here = tmp_path / "here"
        done = cluster.run("solve", session[0], "--out", here, "--method", METHODS, scheduler=False)
        assert done.returncode == 0, done.stderr
        maps = [f"{kind}/{method}.npy" for kind in ("normals", "albedo") for method in METHODS.split(",")]
        for name in ("frames/codes.npy", *maps):
            np.testing.assert_array_equal(np.load(here / name), np.load(out / name))
        found, truth, inside = np.load(out / "normals" / "ls.npy"), session[1], session[2]
        assert np.nanmedian(np.abs(found - truth)[inside]) < 1e-3
        assert not (out / ".rgbn" / "cluster").exists(), "what was sent by files is removed"

    return compare


@pytest.fixture
def refused():
    """Return whether a run ended with one message, of these words."""

    def check(done, *words):
        assert done.returncode == 2, done.stderr
        assert "Traceback" not in done.stderr
        said = [line for line in done.stderr.splitlines() if line.startswith("rgbn: ")]
        assert len(said) == 1, done.stderr
        assert done.stderr.rstrip().endswith(said[0]), "nothing comes after it"
        for word in words:
            assert word in said[0], said[0]
        return said[0]

    return check

"""The same code on a cluster: a Dask scheduler with two worker processes gives what threads give."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scene.files import write_png

COMMAND = [str(Path(sys.executable).parent / "rgbn")]
CLUSTER = """
import sys
from dask.distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def cluster(tmp_path):
    """A scheduler's address, for as long as the test runs."""
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, script], text=True, **pipes) as process:
        yield process.stdout.readline().strip()
        process.stdin.close()


@pytest.fixture
def session(tmp_path):
    """Six photographs of a matte ball under known lights."""
    folder = tmp_path / "session"
    folder.mkdir()
    v, u = np.mgrid[:90, :120]
    x, y = (u - 60) / 40, -(v - 45) / 40
    inside = x**2 + y**2 < 0.9
    normals = np.stack([x, y, np.sqrt(np.clip(1 - x**2 - y**2, 0, 1))], -1)
    azimuth = np.arange(6) * np.pi / 3
    lights = np.stack([0.5 * np.cos(azimuth), 0.5 * np.sin(azimuth), np.full(6, np.sqrt(0.75))], -1)
    for index, light in enumerate(lights):
        image = np.where(inside, 0.7 * np.clip(normals @ light, 0, 1), 0)
        write_png(folder / f"flash_{index}.png", np.repeat(image[..., None] * 65535, 3, -1).astype(np.uint16))
    write_png(folder / "mask.png", inside)
    rows = "".join(f"flash_{index}.png {x} {y} {z}\n" for index, (x, y, z) in enumerate(lights))
    (folder / "lights.lp").write_text(f"6\n{rows}")
    (folder / "session.toml").write_text(
        '[frames]\nflash = "flash_*.png"\nlinear = true\n[lights]\nfile = "lights.lp"\n[object]\nmask = "mask.png"\n'
    )
    return folder, normals, inside


def test_a_cluster_gives_what_threads_give(session, cluster, tmp_path):
    folder, normals, inside = session
    for out, more in ((tmp_path / "here", []), (tmp_path / "there", ["--scheduler", cluster])):
        run = subprocess.run([*COMMAND, "solve", folder, "--out", out, *more], capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
    for name in ("frames/codes.npy", "normals/ls.npy", "normals/iterative.npy", "albedo/iterative.npy"):
        np.testing.assert_array_equal(np.load(tmp_path / "here" / name), np.load(tmp_path / "there" / name))
    found = np.load(tmp_path / "there" / "normals" / "ls.npy")
    assert np.nanmedian(np.abs(found - normals)[inside]) < 1e-3


def test_a_scheduler_that_does_not_answer(session, tmp_path):
    words = ["check", session[0], "--out", tmp_path / "out", "--scheduler", "tcp://127.0.0.1:9"]
    run = subprocess.run([*COMMAND, *words], capture_output=True, text=True)
    assert run.returncode == 2
    assert "no Dask scheduler answers" in run.stderr
    assert "Traceback" not in run.stderr

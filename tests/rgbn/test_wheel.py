"""The wheel: what is in it, and that it runs by itself from an empty folder."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

from scene.current import ROOMS
from tests.conftest import ROOT

pytestmark = [pytest.mark.slow, pytest.mark.full]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The project's wheel, built without the network."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", str(ROOT), "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "--quiet", "--wheel-dir", str(folder)], check=True, capture_output=True)
    return next(folder.glob("rgbn-*.whl"))


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """A virtual environment with the wheel and, by a path file, the libraries of this one, but not its rgbn."""
    folder = tmp_path_factory.mktemp("installed") / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    own = Path(sysconfig.get_path("purelib", vars={"base": str(folder)}))
    # Path files that lie in a folder that a path file names are not read: the checkout stays out.
    (own / "libraries.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), "install", "--no-deps"]
    subprocess.run([*pip, "--no-index", "--quiet", str(wheel)], check=True, capture_output=True)
    # The checkout's compiled kernels: numba takes them for a source of the same size and time of change.
    for kernel in (found for room in ROOMS for found in (ROOT / room).rglob("*.nb?")):
        place = own / kernel.parent.relative_to(ROOT)
        place.mkdir(exist_ok=True)
        shutil.copy2(kernel, place)
        source = kernel.parents[1] / f"{kernel.name.split('.')[0]}.py"
        shutil.copystat(source, place.parent / source.name)
    return folder


def run(installed, *words, cwd):
    """Run a program of the environment in a folder, without what this one's shell says of Python."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL_ENV"))}
    command = [str(installed / "bin" / words[0]), *map(str, words[1:])]
    done = subprocess.run(command, cwd=cwd, env=kept, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


def test_the_wheel_holds_the_rooms_and_the_demo_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    rooms = {name for name in tracked if name.split("/")[0] in ROOMS and (ROOT / name).is_file()}
    demo = {name.replace("fixtures/bumpy", "rgbn/fixture") for name in tracked if name.startswith("fixtures/bumpy/")}
    assert len(demo) > 10
    assert rooms | demo <= names
    other = {name for name in names if name.split("/")[0] not in ROOMS}
    assert all(name.split("/")[0].endswith(".dist-info") for name in other), other
    assert not [name for name in names if name.endswith((".nbi", ".nbc", ".pyc")) or "__pycache__" in name]
    assert not {name.split("/")[0] for name in names} & {"tests", "benchmarks", "fixtures", "docs"}


def test_it_runs_from_an_empty_folder(installed, tmp_path):
    """Its own code, not the checkout's; help, an example session, and the demo judged by its known truth."""
    for name in ROOMS:
        place = run(installed, "python", "-c", f"import {name}; print({name}.__file__)", cwd=tmp_path).strip()
        assert Path(place).is_relative_to(installed), place
    assert "demo" in run(installed, "rgbn", "--help", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []

    run(installed, "rgbn", "example", "fixture", cwd=tmp_path)
    assert (tmp_path / "fixture" / "session.toml").is_file()

    found = json.loads(run(installed, "rgbn", "demo", "--json", cwd=tmp_path))
    assert found["truth_check"]["direction_median_deg"]["value"] <= 0.5
    assert found["truth_check"]["truth_median_deg"]["value"] <= 1
    assert (tmp_path / "out" / "demo" / "report.html").stat().st_size > 1e6
    assert {path.name for path in tmp_path.iterdir()} == {"fixture", "out"}

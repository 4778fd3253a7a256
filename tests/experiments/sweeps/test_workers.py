"""Workers and whole runs that are killed lose nothing: real kills, of real processes."""

import json
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest

from experiments import recipe
from experiments.recipe import ROOM
from experiments.stagings import ONE_FACTOR
from experiments.sweeps import sweep
from experiments.sweeps.cell import failed_rows
from scene.current import code_fingerprint
from scene.errors import SceneError
from scene.output_folder import open_record

# Photographs would take minutes: these cells only compute what their recipe says, and some of them die.
PROGRAM = """
import os, signal, sys, time
from pathlib import Path
from experiments.stagings import ONE_FACTOR
from experiments.sweeps.sweep import join_cells, run_cells
from experiments.sweeps.cell import failed_rows
from scene.output_folder import open_record

root = Path(sys.argv[1])

def work(cell):
    time.sleep(0.02)
    fate, marks = f"{cell.recipe.shape}-{cell.level}", root / "marks"
    marks.mkdir(exist_ok=True)
    with open(marks / f"{cell.key}.{os.getpid()}.{time.time_ns()}", "w"):
        pass
    lives = len(list(marks.glob(f"{cell.key}.*")))
    if "deaths" in sys.argv and (fate == "pear-2" and lives == 1 or fate == "knot-5"):
        os.kill(os.getpid(), signal.SIGKILL)
    rows = [{**row, "median_deg": 12.0, "flip_deg": 12.0, "status": "ok",
             "mean_deg": (31 * cell.level + 17 * i) % 97 / 7, "unanswered": 0.0,
             "albedo_error_percent": 1.0, "pixels": 3000, "frames": 32}
            for i, row in enumerate(failed_rows(cell, "")) if cell.level < 7 or i]
    seconds = [{**{k: rows[0][k] for k in ("experiment", "level", "value", "label", "shape", "seed", "solver",
                "profile")}, "seconds": time.time()}]
    return {"rows": rows, "seconds": seconds, "picture": None}

if __name__ == "__main__":
    cells = list(ONE_FACTOR["ambient"].cells())
    if "full" in sys.argv:
        import errno, scene.files
        calls, replace = [], os.replace

        def full(*names):
            calls.extend(name for name in names[1:] if "/cells/" in str(name))
            if len(calls) > 5:
                raise OSError(errno.ENOSPC, "No space left on device", str(names[1]))
            replace(*names)

        scene.files.os.replace = full
    scheduler = next((word for word in sys.argv if word.startswith("tcp:")), None)
    with open_record(root) as record:
        run_cells(record, cells, work=work, processes=2, scheduler=scheduler)
        join_cells(record, root / "ambient", cells)
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    path = tmp_path_factory.mktemp("sweep") / "program.py"
    path.write_text(PROGRAM)
    return [sys.executable, str(path)]


@pytest.fixture(scope="module")
def whole(program, tmp_path_factory):
    """The folder of a run that nothing disturbed."""
    return run(program, tmp_path_factory.mktemp("whole"))


def table_of(root):
    return (root / "ambient" / "results.parquet").read_bytes()


def run(program, root, *words):
    root.mkdir(exist_ok=True)
    done = subprocess.run([*program, str(root), *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return root


def times_run(root):
    names = [path.name.split(".")[0] for path in (root / "marks").iterdir()]
    return {name: names.count(name) for name in set(names)}


@pytest.mark.full
def test_a_worker_that_dies_costs_its_cell_a_second_try(program, tmp_path):
    root = run(program, tmp_path / "a", "deaths")
    cells = [json.loads(path.read_text()) for path in (root / "cells").iterdir()]
    assert len(cells) == 24
    died = [one["rows"][0] for one in cells if one["rows"][0]["status"] != "ok"]
    assert [(row["shape"], row["level"]) for row in died] == [("knot", 5)]
    assert died[0]["status"] == "failed: its worker process died 3 times"
    # Whoever was in work beside a killer ran again, but no more than that.
    assert sorted(times_run(root).values())[-1] <= 3
    assert sum(times_run(root).values()) <= 24 + 1 + 2 + 2


@pytest.mark.full
def test_a_run_killed_at_random_moments_ends_as_one_that_was_not(program, whole, tmp_path):
    torn = tmp_path / "torn"
    torn.mkdir()
    generator = np.random.default_rng(10001)
    moments = (0, 3, 9, 16)
    workers = []
    for done in moments:
        process = subprocess.Popen([*program, str(torn)], stderr=subprocess.DEVNULL)
        while len(list((torn / "cells").glob("*.json"))) < done and process.poll() is None:
            time.sleep(0.002)
        time.sleep(generator.uniform(0, 0.1))
        assert process.poll() is None, "killed in the middle"
        workers += psutil.Process(process.pid).children(recursive=True)
        process.kill()
        process.wait()
    assert workers
    assert not psutil.wait_procs(workers, 10)[1], "workers leave with the run that started them"
    run(program, torn)
    names = sorted(path.name for path in (whole / "cells").iterdir())
    assert sorted(path.name for path in (torn / "cells").iterdir() if path.suffix == ".json") == names
    assert len(names) == 24
    assert table_of(torn) == table_of(whole)
    # Only what was in work when a run was killed was done twice.
    assert sum(times_run(torn).values()) <= 24 + 2 * len(moments)


@pytest.mark.full
def test_a_rerun_with_nothing_changed_runs_nothing(program, whole):
    page = whole / "ambient" / "index.html"
    before = page.stat().st_mtime_ns
    run(program, whole)
    assert set(times_run(whole).values()) == {1}
    assert page.stat().st_mtime_ns == before


@pytest.mark.full
def test_a_full_disk_costs_what_was_in_work(program, whole, tmp_path):
    torn = tmp_path / "torn"
    torn.mkdir()
    failed = subprocess.run([*program, str(torn), "full"], capture_output=True, text=True, timeout=120)
    assert failed.returncode
    assert "the disk is full" in failed.stderr
    assert len(list((torn / "cells").iterdir())) == 5
    assert table_of(run(program, torn)) == table_of(whole)


CLUSTER = """
import sys
from dask.distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.mark.full
def test_a_cluster_gives_what_processes_here_give(program, whole, tmp_path):
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([sys.executable, script], text=True, **pipes) as process:
        there = run(program, tmp_path / "there", process.stdout.readline().strip())
        process.stdin.close()
    assert table_of(there) == table_of(whole)


def test_no_cell_is_kept_that_was_made_while_the_code_changed(tmp_path, monkeypatch):
    """Workers read the code when they first need it: a change, even one that is taken back, leaves its mark in time."""
    source = tmp_path / "code" / "solve" / "ls.py"
    source.parent.mkdir(parents=True)
    source.write_text("one = 1")
    monkeypatch.setattr(recipe, "sources", lambda _: [source])
    cells = list(ONE_FACTOR["ambient"].cells())[:6]
    made = {"rows": failed_rows(cells[0], "by the test"), "seconds": [], "picture": None}

    def results(*_, **__):
        for number, cell in enumerate(cells):
            if number == change:
                source.write_text("one = 2")
                source.write_text("one = 1")
            yield cell, made | {"code": code_fingerprint(ROOM) if number != stranger else "another machine's"}

    monkeypatch.setattr(sweep, "run_all", results)
    for change, stranger, kept in ((3, None, 3), (None, 2, 2), (None, None, 6)):
        root = tmp_path / f"{change}-{stranger}"
        with open_record(root) as record:
            if kept < 6:
                with pytest.raises(SceneError, match=r"code changed while ambient .* ran.*Run the same command again"):
                    sweep.run_cells(record, cells)
            else:
                sweep.run_cells(record, cells)
        assert len(list((root / "cells").glob("*.json"))) == kept

"""Register scans on virtual sessions of known pose, and scans that must be refused; into docs/evidence/registration.md.

    .venv/bin/python -m benchmarks.bench_align [ROW ...] [--quick] [--write]

Rows: found (every shape, random orientations, small pictures), full (every shape at 1200 x 800 with 16 frames: pose,
ground truth, sigma), wrong (every third shape; scans that must be refused), speed (one session of that size, and one of
24 MP and 60 frames with a million faces, stage by stage; 9 GB of disk below out/ for a while). Results are kept in
out/bench_align.json, so that rows can be run one by one; without names nothing is run, and `--write` puts the tables of
what is there into the document.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "out" / "bench_align.json"
SMALL = {"width": 600, "height": 400, "flashes": 12, "faces": 20_000}
FULL = {"width": 1200, "height": 800, "flashes": 16, "faces": 60_000}
ORIENTATIONS = 5
FULL_SEEDS = 1
WRONG_SEEDS = 1
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def _found(name: str, seed: int) -> dict:
    from benchmarks.align_sessions import mark, session

    return mark(session(name, seed, **SMALL))


def _full(name: str, seed: int) -> dict:
    from benchmarks.align_sessions import mark, session

    return mark(session(name, seed, **FULL), with_truth=True)


def _wrong(name: str, seed: int, fault: str) -> dict:
    from benchmarks.align_sessions import mark, session, with_fault

    return mark(with_fault(session(name, seed, **SMALL), name, fault))


def _speed() -> dict:
    from benchmarks.align_speed import time_sizes

    return time_sizes("relief", 0)


def _tasks(rows: list[str], quick: bool) -> list[tuple]:
    from benchmarks.align_sessions import FAULTS, shape_names

    names = shape_names()
    orientations = 2 if quick else ORIENTATIONS
    tasks: list[tuple] = []
    if "found" in rows:
        tasks += [("found", name, seed, _found, (name, seed)) for seed in range(orientations) for name in names]
    if "full" in rows:
        seeds = range(100, 100 + (1 if quick else FULL_SEEDS))
        tasks += [("full", name, seed, _full, (name, seed)) for seed in seeds for name in names]
    if "wrong" in rows:
        seeds = range(200, 200 + (1 if quick else WRONG_SEEDS))
        tasks += [
            ("wrong", f"{fault}: {name}", seed, _wrong, (name, seed, fault))
            for seed in seeds
            for fault in FAULTS
            for name in _shapes_for(fault, names)
        ]
    return tasks


def _shapes_for(fault: str, names: list[str]) -> list[str]:
    """Return every third shape; of those that a mirror changes, where it is mirrored."""
    from fixtures.mesh_shapes import OWN_MIRROR_IMAGE

    return [name for name in names if fault != "mirrored" or name not in OWN_MIRROR_IMAGE][::3]


def _in_one_thread() -> None:
    import cv2

    cv2.setNumThreads(1)


def _run(rows: list[str], quick: bool) -> dict:
    results = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, cwd=ROOT).stdout
    for row in rows:
        results[row] = {"commit": commit.strip(), "marks": {}}
    if "speed" in rows:
        results["speed"]["marks"] = _speed()
        _keep(results)
    for variable in ONE_THREAD:
        os.environ[variable] = "1"
    start, tasks = time.perf_counter(), _tasks(rows, quick)
    with ProcessPoolExecutor(os.cpu_count(), get_context("spawn"), _in_one_thread) as pool:
        waiting = {pool.submit(call, *given): (row, name, seed) for row, name, seed, call, given in tasks}
        for done, future in enumerate(as_completed(waiting)):
            row, name, seed = waiting[future]
            results[row]["marks"].setdefault(name, {})[str(seed)] = future.result()
            print(f"\r{done + 1} of {len(tasks)}, {time.perf_counter() - start:.0f} s", end="", file=sys.stderr)
            if done % 10 == 9:
                _keep(results)
    print(file=sys.stderr)
    _keep(results)
    return results


def _keep(results: dict) -> None:
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(results, indent=1, default=lambda value: np.asarray(value).tolist()))


def main() -> None:
    """Measure, print, and with --write put the tables into the document."""
    from benchmarks.align_tables import tables
    from benchmarks.pages import put

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="*", help="found, full, wrong, speed; none: write from what is there")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    results = _run(arguments.rows, arguments.quick) if arguments.rows else json.loads(RESULTS.read_text())
    text = tables(results)
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "registration.md"
        put(path, "measured", f"\n{text}")


if __name__ == "__main__":
    main()

"""Calibrate against known truth, and against other tools' models on the same photographs; written into docs/.

    .venv/bin/python -m benchmarks.bench_calibrate [ROW ...] [--quick] [--write]

Rows: two, four, one, far (sessions of the virtual camera), balls (200 random scenes), peers, speed. Without names all
of them. Results are kept in out/bench_calibrate.json, so that rows can be run one by one; `--write` puts the tables
of what is there between the markers in docs/evidence/calibration.md, and draws its charts.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "out" / "bench_calibrate.json"
# As many seeds as a half hour on two cores allows; "far" only has to show that distant lights are told.
SESSIONS = {"two": 14, "four": 10, "one": 10, "far": 5}
SCENES = 200
PEER_SEEDS = 3
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def _mark_session(kind: str, seed: int) -> dict:
    from benchmarks.calibration_sessions import mark, session

    marks = mark(session(seed, kind))
    return marks | {"said": [f"seed {seed}: {line}" for line in marks.get("said", [])]}


def _find_in_scene(seed: int) -> dict:
    from calibrate.detection.balls import find_balls
    from fixtures.random_scenes import judge, random_scene
    from scene.errors import SceneError

    # A ball of 15 px is as hard to find in a smaller picture, and 200 scenes take half the time.
    scene = random_scene(seed, width=900, height=600)
    frames = scene.photograph()
    start = time.perf_counter()
    try:
        found = [ball.sphere for ball in find_balls(frames, scene.world.camera, [])[0]]
    except SceneError:
        found = []
    verdict = judge(found, scene)
    said = [f"seed {seed}: missed {one}" for one in verdict.missed] + [f"seed {seed}: false {o}" for o in verdict.false]
    return {
        "wanted": [verdict.wanted],
        "found": [verdict.found],
        "false": [len(verdict.false)],
        "seconds": [time.perf_counter() - start],
        "said": said,
    }


def _peer_off_axis(offset_mm: float, seed: int, count: int) -> dict:
    from benchmarks.calibration_peers import off_axis

    return {f"{offset_mm:.0f}_{name}": errors for name, errors in off_axis(offset_mm, seed, count).items()}


def _peer_two(seed: int) -> dict:
    from benchmarks.calibration_peers import two_balls

    return two_balls(seed)


def _in_one_thread() -> None:
    import cv2

    cv2.setNumThreads(1)


def jobs_of(row: str, *, quick: bool) -> list[tuple]:
    """Return a row's work units: function and arguments."""
    if row in SESSIONS:
        return [(_mark_session, row, seed) for seed in range(1 if quick else SESSIONS[row])]
    if row == "balls":
        return [(_find_in_scene, seed) for seed in range(4 if quick else SCENES)]
    from benchmarks.calibration_peers import LIGHTS, OFF_AXIS_MM

    seeds, lights = (1, 6) if quick else (PEER_SEEDS, LIGHTS)
    off = [(_peer_off_axis, offset, seed, lights) for offset in OFF_AXIS_MM for seed in range(seeds)]
    return off + [(_peer_two, seed) for seed in range(1 if quick else SESSIONS["two"])]


def run_rows(rows: list[str], file: Path, *, quick: bool) -> None:
    """Run rows on two processes, one thread each; keep and print each as it is finished."""
    if "speed" in rows:
        from benchmarks.calibration_speed import measure

        # Alone, before the others fill both cores.
        keep(file, {"speed": measure(1500, 1000) if quick else measure()})
    for name in ONE_THREAD:
        os.environ[name] = "1"
    with ProcessPoolExecutor(2, mp_context=get_context("spawn"), initializer=_in_one_thread) as pool:
        for row in [row for row in rows if row != "speed"]:
            start = time.perf_counter()
            pooled: dict[str, list] = defaultdict(list)
            waiting = [pool.submit(*job) for job in jobs_of(row, quick=quick)]
            for done, one in enumerate(as_completed(waiting), 1):
                if done % 10 == 0:
                    print(f"{row}: {done} of {len(waiting)}", file=sys.stderr, flush=True)
                for key, values in one.result().items():
                    pooled[key] += values
            keep(file, {row: dict(pooled) | {"took_s": time.perf_counter() - start}})


def kept(file: Path) -> dict[str, dict]:
    """Return the rows that were run so far."""
    return json.loads(file.read_text()) if file.is_file() else {}


def keep(file: Path, rows: dict[str, dict]) -> None:
    """Put rows into the results' file, with the commit that they were run at, and print them."""
    from scene.files import write_json

    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()
    file.parent.mkdir(exist_ok=True)
    write_json(file, kept(file) | {name: row | {"commit": commit} for name, row in rows.items()})
    for name, row in rows.items():
        print(f"\n{name} ({row.get('took_s', 0):.0f} s)")
        for key, value in row.items():
            if key == "said":
                print(*(f"  {line}" for line in value), sep="\n")
            elif isinstance(value, list):
                known = np.abs(np.array(value, float))
                of = [np.nanmedian(known), np.nanmean(known), np.nanquantile(known, 0.95), np.nanmax(known)]
                told = "  ".join(f"{n} {v:8.3f}" for n, v in zip(("median", "mean", "p95", "worst"), of, strict=True))
                print(f"  {key:24s} n {len(known):5d}  {told}  NaN {np.isnan(known).sum()}")
            else:
                print(f"  {key:24s} {value}")
    sys.stdout.flush()


def main() -> None:
    """Run rows, print, and with --write put the tables into docs/evidence/calibration.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("row", nargs="*", choices=[[], *SESSIONS, "balls", "peers", "speed"])
    parser.add_argument("--quick", action="store_true", help="a seed or two of each: does it run?")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    file = RESULTS.with_stem("bench_calibrate_quick") if arguments.quick else RESULTS
    run_rows(arguments.row or [*SESSIONS, "peers", "balls", "speed"], file, quick=arguments.quick)
    results = kept(file)
    from benchmarks.calibration_tables import draw_charts, tables
    from benchmarks.pages import put

    text = tables(results)
    print("\n".join(f"\n{part}" for part in text.values()))
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "calibration.md"
        for name, part in text.items():
            put(path, name, part)
        draw_charts(results, ROOT / "docs" / "evidence")


if __name__ == "__main__":
    main()

"""What a sweep costs and what it survives; written into docs/evidence/sweeps.md.

    .venv/bin/python -m benchmarks.bench_sweeps [--write] [--kills 20]

Kills: eight experiments at their quick size, once undisturbed, once with `kill -9` of the run at random moments, half
of the times of one of its workers instead; then the cells are counted and the tables compared byte by byte. Rerun: the
same command with nothing to do. Workers: cells that only wait, on a Dask cluster of processes on this machine; that
is the scheduling alone, whatever cores there are.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pyarrow import parquet

from experiments.recipe import Cell
from experiments.stagings import ONE_FACTOR
from experiments.sweeps.cell import failed_rows
from experiments.sweeps.sweep import run_cells
from experiments.tables import KEY
from scene.output_folder import open_record

ROOT = Path(__file__).resolve().parents[1]
MARKERS = "<!-- survives -->\n", "<!-- end of survives -->"
COMMAND = [str(Path(sys.executable).parent / "rgbn"), "sweep"]
# `material` takes as long as the others together, and dies as they do.
WANTED = ",".join(name for name in ONE_FACTOR if name != "material")
SEED, WAIT_S, WAITING_CELLS = 501, 0.25, 192


def run(out: Path) -> float:
    """Return the seconds of one run to its end."""
    start = time.perf_counter()
    subprocess.run([*COMMAND, WANTED, "--quick", "--out", out], check=True, capture_output=True)
    return time.perf_counter() - start


def killed_run(out: Path, cells: int, *, worker: bool, generator: random.Random) -> int:
    """Start a run and kill it, or one of its workers and then it, some time after so many cells are there.

    Returns how many there are then.
    """
    process = subprocess.Popen(
        [*COMMAND, WANTED, "--quick", "--out", out], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while count_cells(out) < cells and process.poll() is None:
        time.sleep(0.01)
    time.sleep(generator.uniform(0, 2))
    if worker and (children := workers_of(process.pid)):
        os.kill(generator.choice(children), signal.SIGKILL)
        time.sleep(generator.uniform(0, 2))
    process.kill()
    process.wait()
    return count_cells(out)


def count_cells(out: Path) -> int:
    """Return how many cells are done."""
    return len(list((out / "cells").glob("*.json")))


def workers_of(pid: int) -> list[int]:
    """Return the processes that a process started."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            number, rest = path.read_text().split(" (", 1)
        except (OSError, ValueError):
            continue
        if int(rest.rsplit(") ", 1)[1].split()[1]) == pid:
            found.append(int(number))
    return found


def kills(count: int, folder: Path) -> list[str]:
    """Return the rows on kills, and on a rerun."""
    generator = random.Random(SEED)
    run(folder / "whole")
    cells = count_cells(folder / "whole")
    reached = []
    for number in range(count):
        due = number * (cells - 4) // count
        reached.append(killed_run(folder / "torn", due, worker=number % 2 == 1, generator=generator))
    run(folder / "torn")
    names = [sorted(path.name for path in (folder / one / "cells").glob("*.json")) for one in ("whole", "torn")]
    tables = [next((folder / one).glob("*/results.parquet")) for one in ("whole", "torn")]
    apart = differences(*tables)
    rerun_s = run(folder / "torn")
    before_end = sum(there < cells for there in reached)
    same = "the same bytes" if tables[0].read_bytes() == tables[1].read_bytes() else f"**{len(apart)} rows differ**"
    print(*apart, sep="\n")
    once = "each once" if names[0] == names[1] else "**not the same ones**"
    return [
        f"| {count} kills, {before_end} of them before the last cell was there | {len(names[1])} of {len(names[0])} "
        f"cells, {once}; table: {same} |",
        f"| rerun with nothing changed, s | {rerun_s:.1f} |",
    ]


def differences(one: Path, other: Path) -> list[str]:
    """Return the rows in which two tables differ, and in what."""
    rows = zip(*(parquet.read_table(path).to_pylist() for path in (one, other)), strict=True)
    return [
        " ".join([*(str(a[key]) for key in KEY), *(f"{key}: {a[key]}, {b[key]}" for key in a if a[key] != b[key])])
        for a, b in rows
        if repr(a) != repr(b)
    ]


def wait(cell: Cell) -> dict:
    """Take the time of a cell, and nothing else."""
    time.sleep(WAIT_S)
    return {"rows": failed_rows(cell, "only waited"), "seconds": [], "picture": None}


def scheduling(folder: Path) -> list[str]:
    """Return the rows on workers: seconds for cells that only wait, and the share of the ideal speed-up."""
    from dask.distributed import LocalCluster

    cells = [cell for one in ONE_FACTOR.values() for cell in one.cells()][:WAITING_CELLS]
    seconds = {}
    for workers in (2, 4, 8):
        with LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster:  # type: ignore[attr-defined]
            address = str(cluster.scheduler_address)  # type: ignore[attr-defined]
            # The workers' first cells load the libraries.
            with open_record(folder / f"first_{workers}") as record:
                run_cells(record, cells[: 4 * workers], work=wait, scheduler=address)
            with open_record(folder / f"wait_{workers}") as record:
                start = time.perf_counter()
                run_cells(record, cells, work=wait, scheduler=address)
                seconds[workers] = time.perf_counter() - start
    return [
        f"| {workers} Dask workers, {len(cells)} cells that wait {WAIT_S} s | {taken:.2f} s, "
        f"{100 * WAIT_S * len(cells) / workers / taken:.0f} % of ideal |"
        for workers, taken in seconds.items()
    ]


def main() -> None:
    """Measure, print, and write into the documentation if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--kills", type=int, default=20)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        rows = ["| | |", "|---|---|", *kills(options.kills, Path(name)), *scheduling(Path(name))]
    text = "\n".join(rows) + f"\n\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_sweeps.py`.\n"
    print(text)
    if options.write:
        path = ROOT / "docs" / "evidence" / "sweeps.md"
        before, rest = path.read_text().split(MARKERS[0])
        path.write_text(before + MARKERS[0] + text + MARKERS[1] + rest.split(MARKERS[1])[1])


if __name__ == "__main__":
    main()

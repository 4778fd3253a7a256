"""`rgbn sweep`: the cells that are missing are run, then the tables and the page are written.

Cells lie in OUT/cells, one file each, whoever asked for them; OUT/NAME holds what one sweep joins from them.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.recipe import ROOM, Cell, code_times
from experiments.stagings import SOLVERS, experiments, experiments_of
from experiments.sweeps.cell import failed_rows, run_cell
from experiments.tables import RESULTS, SECONDS, Rows, write_table
from experiments.workers import Work, WorkerDied, run_all
from lab.options import Solving, Staging
from lab.progress import logged, progress_bar, say
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.files import write_json
from scene.output_folder import open_record
from scene.reading import json_of
from scene.record import Record


def sweep(
    wanted: str,
    *,
    out: Path | None = None,
    quick: bool = False,
    staging: Staging = "one-factor",
    shape: str = "",
    method: str = ",".join(SOLVERS),
    scheduler: str | None = None,
    processes: int | None = None,
) -> Path:
    """Run experiments, as far as their cells are not there yet; return the folder of the tables and the page.

    wanted: names with commas, or all. staging: see `experiments.stagings`. quick: a first look, with fewer levels, one
    shape, one draw, small pictures. shape: others than the experiments' own, with commas. method: solvers with commas.
    scheduler: address of a Dask scheduler; default: processes here, one a core. SceneError: unknown experiment, shape
    or method, no cluster, a full disk, a folder in use.
    """
    chosen, methods = experiments_of(wanted, staging, shape), Solving(method, "seed").methods()
    cells = [cell for one in chosen for cell in one.cells(methods=methods, quick=quick)]
    names = "all" if len(chosen) == len(experiments(staging)) else "-".join(one.name for one in chosen)
    words = ["benchmark"] * (staging == "benchmark") + [names] + shape.replace(",", " ").split() + ["quick"] * quick
    folder = (out or Path("out") / "sweeps") / "-".join(words)
    with open_record(folder.parent, origin="sweep") as record, logged(record):
        run_cells(record, cells, scheduler=scheduler, processes=processes)
        join_cells(record, record.folder / folder.name, cells, staging=staging)
    return folder


def cell_path(folder: Path, cell: Cell) -> Path:
    """Return where a cell's file is, or would be."""
    return folder / "cells" / f"{cell.key}.json"


def run_cells(
    record: Record,
    cells: Sequence[Cell],
    *,
    work: Work = run_cell,
    scheduler: str | None = None,
    processes: int | None = None,
) -> None:
    """Run the cells whose files are not there, and write those, each whole or not at all.

    work: gives what `run_cell` does. SceneError: the code that cells are named after was written to meanwhile, here or
    on a worker: who can tell what made them?
    """
    root = record.folder
    missing = [cell for cell in cells if not record.is_intact(cell_path(root, cell))]
    if not missing:
        return
    start, failed, times, code = time.perf_counter(), 0, code_times(), code_fingerprint(ROOM)
    with progress_bar("cells") as report:
        for done, (cell, found) in enumerate(run_all(missing, work, processes=processes, scheduler=scheduler), 1):
            if isinstance(found, WorkerDied):
                found = {"rows": failed_rows(cell, str(found)), "seconds": [], "picture": None}
            if code_times() != times or found.get("code", code) != code:
                raise SceneError(
                    f"sweep: the code changed while {cell.experiment} {cell.value} ran, here or on a worker. What is "
                    "done stays. Run the same command again, with the same code on all workers."
                )
            write_json(cell_path(root, cell), found)
            failed += any(row["status"].startswith("failed") for row in found["rows"])
            report(done, len(missing))
    say(f"{len(missing)} cells in {time.perf_counter() - start:.0f} s, {failed} with failures")


def join_cells(record: Record, folder: Path, cells: Sequence[Cell], *, staging: Staging = "one-factor") -> None:
    """Write the tables and the page of cells that are all there, unless they are of these very cells already."""
    root, code = record.folder, code_fingerprint(ROOM)
    mark = fingerprint([cell.key for cell in cells], [cell_path(root, cell) for cell in cells], code=code)
    if record.is_current(folder.name, mark):
        return
    from experiments.sweeps.sweep_page import write_page

    with record.making(folder.name, mark):
        found = [json_of(cell_path(root, cell)) for cell in cells]
        rows, seconds = write_tables(folder, found)
        write_page(folder, rows, found, seconds=seconds, staging=staging)


def write_tables(folder: Path, found: list[dict[str, Any]]) -> tuple[Rows, Rows]:
    """Write results.parquet, and what no two runs agree on, the times, as seconds.parquet; return the rows of both.

    found: the cells' files, in the order of their experiments.
    """
    rows, seconds = ([row for one in found for row in one[name]] for name in ("rows", "seconds"))
    write_table(folder / "results.parquet", rows, RESULTS)
    write_table(folder / "seconds.parquet", seconds, SECONDS)
    return rows, seconds

"""`rgbn sweep`: the cells that are missing are run, then the tables and the page are written.

Cells lie in OUT/cells, one file each, whoever asked for them; OUT/NAME holds what one sweep joins from them.
"""

import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from experiments.sweeps.cell import failed_rows, run_cell
from experiments.sweeps.cell_progress import cell_progress
from experiments.sweeps.cell_table import cell_path, read_cells, write_cell, write_tables
from experiments.sweeps.nine_experiments import EXPERIMENTS, SOLVERS, experiments_of
from experiments.sweeps.perturbation import PERTURBATIONS, perturbation_cells
from experiments.sweeps.recipe import RUNNER, Cell, code_times
from experiments.sweeps.workers import Work, WorkerDied, run_here, run_there
from lab.cluster.connect import executor_of
from lab.options import Solving
from lab.progress import say
from scene.current import code_fingerprint, fingerprint
from scene.errors import SceneError
from scene.output_folder import open_record
from scene.record import Record


def sweep(
    wanted: str,
    *,
    out: Path | None = None,
    quick: bool = False,
    method: str = ",".join(SOLVERS),
    scheduler: str | None = None,
    processes: int | None = None,
) -> Path:
    """Run experiments, as far as their cells are not there yet.

    Parameters
    ----------
    wanted : str
        Names of experiments, with commas, or all.
    out : Path, optional
        Default: out/sweeps.
    quick : bool
        A first look: fewer levels, one shape, one draw, small pictures.
    method : str
        Solvers, with commas.
    scheduler : str, optional
        Address of a Dask scheduler; default: processes here.
    processes : int, optional
        Default: one a core.

    Returns
    -------
    Path
        The folder with the tables, index.html and the charts.

    Raises
    ------
    SceneError
        Unknown experiment or method, no cluster, a full disk, a folder in use.
    """
    experiments, methods = experiments_of(wanted), Solving(method, "seed").methods()
    cells = [cell for one in experiments for cell in one.cells(methods=methods, quick=quick)]
    if len(experiments) == len(EXPERIMENTS):
        cells += perturbation_cells(methods, quick=quick)
    root = out or Path("out") / "sweeps"
    names = "all" if len(experiments) == len(EXPERIMENTS) else "-".join(one.name for one in experiments)
    folder = root / (f"{names}-quick" if quick else names)
    with open_record(root) as record:
        run_cells(record, cells, scheduler=scheduler, processes=processes)
        join_cells(record, record.folder / folder.name, cells)
    return folder


def run_cells(
    record: Record,
    cells: Sequence[Cell],
    *,
    work: Work = run_cell,
    scheduler: str | None = None,
    processes: int | None = None,
) -> None:
    """Run the cells whose files are not there, and write those.

    Parameters
    ----------
    record : Record
        Of the folder where `cells` is, or will be.
    cells : sequence of Cell
    work : callable
        What runs a cell: gives what `run_cell` does.
    scheduler, processes
        See `sweep`.

    Raises
    ------
    SceneError
        The code that cells are named after was written to meanwhile, here or on a worker: who can tell what made them?
    """
    root = record.folder
    missing = [cell for cell in cells if not record.is_intact(cell_path(root, cell))]
    if not missing:
        return
    start, failed, times, code = time.perf_counter(), 0, code_times(), code_fingerprint(RUNNER)
    with cell_progress(len(missing)) as report:
        for done, (cell, found) in enumerate(_results(missing, work, scheduler, processes), 1):
            if isinstance(found, WorkerDied):
                found = {"rows": failed_rows(cell, str(found)), "seconds": [], "picture": None}
            if code_times() != times or found.get("code", code) != code:
                raise SceneError(
                    f"sweep: the code changed while {cell.experiment} {cell.value} ran, here or on a worker. What is "
                    "done stays. Run the same command again, with the same code on all workers."
                )
            write_cell(root, cell, found)
            failed += any(row["status"].startswith("failed") for row in found["rows"])
            report(done, failed)
    say(f"{len(missing)} cells in {time.perf_counter() - start:.0f} s, {failed} with failures")


def _results(cells: list[Cell], work: Work, scheduler: str | None, processes: int | None) -> Iterator[tuple[Cell, Any]]:
    if scheduler is None:
        yield from run_here(cells, work, processes=min(processes or os.cpu_count() or 1, len(cells)))
        return
    with executor_of(scheduler) as executor:
        yield from run_there(cells, work, executor)


def join_cells(record: Record, folder: Path, cells: Sequence[Cell]) -> None:
    """Write the tables and the page of cells that are all there, unless they are of these very cells already."""
    root, code = record.folder, code_fingerprint(__name__)
    mark = fingerprint([cell.key for cell in cells], [cell_path(root, cell) for cell in cells], code=code)
    if record.is_current(folder.name, mark):
        return
    from experiments.sweeps.sweep_page import write_page

    with record.making(folder.name, mark):
        found = read_cells(root, cells)
        rows, perturbed, seconds = write_tables(folder, found, [*EXPERIMENTS, *PERTURBATIONS, *cells[0].methods])
        write_page(folder, rows, found, perturbed=perturbed, seconds=seconds)

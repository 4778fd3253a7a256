"""The cells' files, and the tables that are joined from them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.sweeps.perturbation import PERTURBATIONS
from experiments.sweeps.recipe import Cell
from scene.files import write_json, write_whole
from scene.reading import json_of

Rows = list[dict[str, Any]]

KEY = {
    "experiment": "string", "level": "int32", "value": "float64", "label": "string", "shape": "string",
    "seed": "int32", "solver": "string", "profile": "string",
}  # fmt: skip
"""What names a row, and its type."""
RESULTS = KEY | {
    "status": "string", "mean_deg": "float64", "median_deg": "float64", "min_deg": "float64", "max_deg": "float64",
    "std_deg": "float64", "q1_deg": "float64", "q3_deg": "float64", "under_5_deg": "float64",
    "under_10_deg": "float64", "pixels": "int64", "flip_deg": "float64", "relief_deg": "float64",
    "turn_deg": "float64", "tilt_deg": "float64", "tilt_spread_deg": "float64", "unanswered": "float64",
    "frames": "int64", "albedo_error_percent": "float64", "doubts": "string",
}  # fmt: skip
"""Columns of results.parquet."""
PERTURBED = KEY | {"breaks_at": "float64"} | {name: kind for name, kind in RESULTS.items() if name not in KEY}
"""Columns of perturbations.parquet; `status` may be "not told": the method does not ask for the quantity."""
SECONDS = KEY | {"seconds": "float64"}
"""Columns of seconds.parquet; `solver` empty: the photographs were made."""


def cell_path(folder: Path, cell: Cell) -> Path:
    """Return where a cell's file is, or would be."""
    return folder / "cells" / f"{cell.key}.json"


def write_cell(folder: Path, cell: Cell, found: dict[str, Any]) -> None:
    """Write a cell's file, whole or not at all."""
    write_json(cell_path(folder, cell), found)


def read_cells(folder: Path, cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Return what the cells' files hold."""
    return [json_of(cell_path(folder, cell)) for cell in cells]


def write_tables(folder: Path, found: list[dict[str, Any]], order: Sequence[str]) -> tuple[Rows, Rows, Rows]:
    """Write results.parquet, perturbations.parquet, and what no two runs agree on, the times, as seconds.parquet.

    Parameters
    ----------
    folder : Path
    found : list of dict
        The cells' files.
    order : sequence of str
        Of the experiments and solvers in the tables.

    Returns
    -------
    rows, perturbed, seconds : list of dict
        Of the three, sorted.
    """
    every = _sorted([row for one in found for row in one["rows"]], order)
    rows = [row for row in every if row["experiment"] not in PERTURBATIONS]
    perturbed = [row for row in every if row["experiment"] in PERTURBATIONS]
    seconds = _sorted([row for one in found for row in one["seconds"]], order)
    _write(folder / "results.parquet", rows, RESULTS)
    _write(folder / "seconds.parquet", seconds, SECONDS)
    if perturbed:
        _write(folder / "perturbations.parquet", perturbed, PERTURBED)
    return rows, perturbed, seconds


def _sorted(rows: Rows, order: Sequence[str]) -> Rows:
    rank = {name: number for number, name in enumerate(order)}

    def place(row: dict[str, Any]) -> tuple:
        return (
            rank.get(row["experiment"], len(rank)),
            row["level"],
            row["shape"],
            row["seed"],
            rank.get(row["solver"], len(rank) if row["solver"] else -1),
            row["solver"],
            row["profile"],
        )

    return sorted(rows, key=place)


def _write(path: Path, rows: list[dict[str, Any]], columns: dict[str, str]) -> None:
    import pyarrow
    from pyarrow import parquet

    schema = pyarrow.schema([(name, getattr(pyarrow, kind)()) for name, kind in columns.items()])
    table = pyarrow.Table.from_pylist(rows, schema=schema)
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(table, sink)
    with write_whole(path) as file:
        file.write(sink.getvalue())

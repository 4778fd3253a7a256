"""What the text leaves open, read in other ways: the rank correlation of each; into docs/evidence/sweeps.md.

    .venv/bin/python -m benchmarks.bench_sweep_readings [--write] [--out out/sweeps]

Wants the whole sweep (`benchmarks.bench_sweep_all`) in the same folder. Nothing is chosen by these numbers: they tell
how far the correlation depends on what the text does not say.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pyarrow import parquet

from benchmarks.pages import put
from experiments.catalogue import CALIBRATED, EXPERIMENTS
from experiments.sweeps.sweep import read_cells, run_cells
from experiments.sweeps.sweep_statistics import rank_correlation, statistics
from experiments.tables import Rows
from scene.output_folder import open_record

ROOT = Path(__file__).resolve().parents[1]
READINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "hollows of reflectance 0.95, not 0.8": ("interreflection", {"reflectance": 0.95}),
    "the hollows' lights within 30 degrees of the axis, not 15": ("interreflection", {"polar_deg": 30.0}),
    "the hollows' lights on a ring of 15 degrees": ("interreflection", {"lights": "ring"}),
    "waves whose light goes on from surface to surface": ("shadow", {"depth": 32}),
    "white waves (0.8) whose light goes on": ("shadow", {"depth": 32, "reflectance": 0.8}),
    "waves lit from 80 degrees, too": ("shadow", {"polar_deg": 80.0}),
    "noise on the waves, 0.005": ("shadow", {"noise": 0.005}),
}
"""What is read in another way, the experiment, and the recipe's fields."""


def read_again(root: Path, name: str, changed: dict[str, Any]) -> Rows:
    """Return the rows of an experiment on the benchmark's shape with some fields of its recipe changed."""
    one = EXPERIMENTS[name]
    cells = [
        replace(cell, recipe=replace(cell.recipe, **changed))
        for cell in replace(one, shapes=one.shapes[:1]).cells(methods=CALIBRATED)
    ]
    with open_record(root) as record:
        run_cells(record, cells)
    return [row for found in read_cells(root, cells) for row in found["rows"]]


def line(what: str, rows: Rows, experiment: str) -> str:
    """Return a row of the table: the plain readings' means of an experiment, and the correlations of all."""
    numbers = statistics(rows)
    means = " / ".join(f"{numbers[experiment, solver, 'seed'].get('mean', np.nan):.1f}" for solver in CALIBRATED)
    found = " | ".join(f"{rank_correlation(numbers, profile)[0]:.2f}" for profile in ("default", "seed"))
    return f"| {what} | {experiment} | {means} | {found} |"


def main() -> None:
    """Run what is missing, print the table, and write it into the documentation if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out") / "sweeps")
    options = parser.parse_args()
    rows = [
        row
        for row in parquet.read_table(options.out / "all" / "results.parquet").to_pylist()
        if row["shape"] == EXPERIMENTS[row["experiment"]].shapes[0]
    ]
    solvers = ", ".join(f"`{name}`" for name in CALIBRATED)
    lines = [
        f"| reading | of | means of the plain {solvers}, degrees | rank correlation, default | plain |",
        "|---|---|---|---|---|",
        *(line("as everywhere here", rows, name) for name in ("interreflection", "shadow")),
    ]
    for what, (name, changed) in READINGS.items():
        others = [row for row in rows if row["experiment"] != name]
        lines.append(line(what, others + read_again(options.out, name, changed), name))
    text = "\n".join(lines) + "\n"
    print(text)
    if options.write:
        put(ROOT / "docs" / "evidence" / "sweeps.md", "readings", text)


if __name__ == "__main__":
    main()

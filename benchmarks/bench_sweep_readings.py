"""One thing of the staging "benchmark" changed at a time, and what follows; into docs/evidence/findings.md.

    .venv/bin/python -m benchmarks.bench_sweep_readings [--write] [--out out/sweeps]

Wants the whole sweep (`benchmarks.bench_sweep_all`) in the same folder. Nothing is chosen by these numbers: they tell
how far the correlation depends on what the text does not say.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

from pyarrow import parquet

from benchmarks.pages import put
from experiments.stagings import CALIBRATED, SOLVERS, Experiment, benchmark
from experiments.sweeps.findings import Errors
from experiments.sweeps.sweep import read_cells, run_cells
from experiments.sweeps.sweep_statistics import agreement
from experiments.tables import Rows
from scene.output_folder import open_record

ROOT = Path(__file__).resolve().parents[1]
READINGS: dict[str, tuple[str, dict[str, Any]]] = {
    "the cones' light straight from the flash only: what is left is shadow": ("interreflection", {"depth": 2}),
    "cones of reflectance 0.95, not 0.8": ("interreflection", {"reflectance": 0.95}),
    "the cones' lights within 5 degrees of the axis, not 15": ("interreflection", {"polar_deg": 5.0}),
    "the cones' lights within 30 degrees": ("interreflection", {"polar_deg": 30.0}),
    "the waves' light straight from the flash only": ("shadow", {"depth": 2}),
    "noise under a ring of 24 lights at 15 degrees": ("noise", {"lights": "ring", "count": 24, "polar_deg": 15.0}),
    "fewer images, without the renderings' noise": ("images", {"noise": 0.0}),
    "GGX facets, not Beckmann's": ("roughness", {"distribution": "ggx"}),
    "rings without the renderings' noise": ("ring", {"noise": 0.0}),
}
"""What is read in another way, the experiment, and the recipe's fields."""


def read_again(root: Path, one: Experiment, changed: dict[str, Any]) -> Rows:
    """Return the rows of an experiment with some fields of its recipe changed."""
    cells = [replace(cell, recipe=replace(cell.recipe, **changed)) for cell in one.cells(methods=CALIBRATED)]
    with open_record(root) as record:
        run_cells(record, cells)
    return [row for found in read_cells(root, cells) for row in found["rows"]]


def line(what: str, rows: Rows, experiment: str) -> str:
    """Return a row of the table: the plain readings' first, last and mean error of each, and the rank correlations."""
    errors = Errors(rows, "seed")
    curves = [errors.over(experiment, solver) for solver in CALIBRATED]
    fields = " | ".join(f"{curve[0]:.1f} to {curve[-1]:.1f}, {curve.mean():.1f}" for curve in curves)
    found = (agreement(rows, profile, "filled_deg").overall[0] for profile in ("default", "seed"))
    return f"| {what} | {experiment} | {fields} | " + " | ".join(f"{one:.2f}" for one in found) + " |"


def main() -> None:
    """Run what is missing, print the table, and write it into the documentation if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out") / "sweeps")
    options = parser.parse_args()
    rows = parquet.read_table(options.out / "benchmark-all" / "results.parquet").to_pylist()
    there = benchmark()
    lines = [
        "| reading | of | " + " | ".join(SOLVERS[one] for one in CALIBRATED) + " | rank correlation, default | plain |",
        "|---" * (len(CALIBRATED) + 4) + "|",
        *(line("as staged", rows, name) for name in dict.fromkeys(name for name, _ in READINGS.values())),
    ]
    for what, (name, changed) in READINGS.items():
        others = [row for row in rows if row["experiment"] != name]
        lines.append(line(what, others + read_again(options.out, there[name], changed), name))
    text = (
        "\n".join(lines)
        + "\n\nPlain readings: error at the first to the last level, and their mean, degrees; gaps count 90.\n"
    )
    print(text)
    if options.write:
        put(ROOT / "docs" / "evidence" / "findings.md", "readings", text)


if __name__ == "__main__":
    main()

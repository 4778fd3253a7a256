"""All nine experiments whole, beside the benchmark's own numbers; written into docs/sweeps.md.

    .venv/bin/python -m benchmarks.bench_sweep_all [--write] [--out out/sweeps]

Goes on where it was stopped. The charts are copied to docs/sweeps-EXPERIMENT.svg.
"""

import argparse
import json
import os
import shutil
import time
from pathlib import Path

from pyarrow import parquet

from lab.sweeps.experiments import EXPERIMENTS, SOLVERS
from lab.sweeps.summary import benchmark_statistics
from lab.sweeps.sweep import sweep

ROOT = Path(__file__).resolve().parents[1]
MARKERS = "<!-- all -->\n", "<!-- end of all -->"


def means(statistics: list[dict]) -> list[str]:
    """Return the table of mean errors: as they are, plain readings, the benchmark's."""
    ours = {(row["experiment"], row["solver"], row["profile"]): row for row in statistics}
    theirs = benchmark_statistics()
    rows = ["| mean error, degrees | " + " | ".join(SOLVERS.values()) + " |", "|---" * (len(SOLVERS) + 1) + "|"]
    for one in EXPERIMENTS.values():
        fields = []
        for solver in SOLVERS:
            found = [ours[one.name, solver, profile] for profile in ("default", "seed")]
            shown = " / ".join(f"{row['mean']:.1f}" if "mean" in row else "–" for row in found)
            failed = sum(row["failed"] for row in found)
            note = f" ({failed} failed)" if failed else ""
            fields.append(f"{shown} / {theirs[one.name, solver]['mean']:.1f}{note}")
        rows.append(f"| {one.label} | " + " | ".join(fields) + " |")
    return rows


def correlations(found: dict) -> list[str]:
    """Return the table of rank correlations."""
    rows = ["| shapes, profile | rank correlation with the benchmark's means | pairs |", "|---|---|---|"]
    return rows + [f"| {what} | {one['spearman']:.2f} | {one['pairs']} |" for what, one in found.items()]


def main() -> None:
    """Run what is missing, print the tables, and write them into the documentation if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out") / "sweeps")
    options = parser.parse_args()
    start = time.perf_counter()
    folder = sweep("all", out=options.out)
    wall_s = time.perf_counter() - start
    found = json.loads((folder / "statistics.json").read_text())
    seconds = [value or 0 for value in parquet.read_table(folder / "seconds.parquet").column("seconds").to_pylist()]
    lines = [
        *means(found["statistics"]),
        "",
        "In each field: the methods as they are / their plain readings / the benchmark's own number.",
        "",
        *correlations(found["rank_correlation"]),
        "",
        f"This run: {wall_s / 60:.1f} minutes for the cells that were missing; all cells together took one core "
        f"{sum(seconds) / 60:.0f} minutes. Measured on {os.cpu_count()} cores by `benchmarks/bench_sweep_all.py`.",
    ]
    text = "\n".join(lines) + "\n"
    print(text)
    if options.write:
        charts = []
        for name in EXPERIMENTS:
            shutil.copy(folder / f"{name}-normals.svg", ROOT / "docs" / f"sweeps-{name}.svg")
            charts.append(f"![{name}: angular error against level](sweeps-{name}.svg)\n")
        path = ROOT / "docs" / "sweeps.md"
        before, rest = path.read_text().split(MARKERS[0])
        path.write_text(before + MARKERS[0] + text + "\n" + "".join(charts) + MARKERS[1] + rest.split(MARKERS[1])[1])


if __name__ == "__main__":
    main()

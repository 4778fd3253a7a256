"""All nine experiments whole, beside the benchmark's own numbers; into docs/evidence/sweeps.md.

    .venv/bin/python -m benchmarks.bench_sweep_all [--write] [--out out/sweeps]

Goes on where it was stopped. The charts are copied to docs/evidence/sweeps-EXPERIMENT.svg, atlas and the chart of speed
against accuracy to sweeps-atlas.svg and sweeps-speed.svg beside them. With --quick it is the first look, printed only.
"""

import argparse
import json
import os
import shutil
import time
from pathlib import Path

from pyarrow import parquet

from benchmarks.pages import put
from experiments.catalogue import EXPERIMENTS, SOLVERS
from experiments.sweeps.sweep import sweep
from experiments.sweeps.sweep_statistics import benchmark_statistics

ROOT = Path(__file__).resolve().parents[1]


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
            counts = {key.replace("_", " "): sum(row[key] for row in found) for key in ("no_answer", "failed")}
            told = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
            note = f" ({told})" if told else ""
            fields.append(f"{shown} / {theirs[one.name, solver]['mean']:.1f}{note}")
        rows.append(f"| {one.label} | " + " | ".join(fields) + " |")
    return rows


def correlations(found: dict) -> list[str]:
    """Return the table of rank correlations."""
    rows = ["| shapes, profile | rank correlation with the benchmark's means | pairs |", "|---|---|---|"]
    return rows + [f"| {what} | {one['spearman']:.2f} | {one['pairs']} |" for what, one in found.items()]


def tolerances(found: dict) -> list[str]:
    """Return the table of the smallest perturbations that break a method: median over draws, and quartiles."""
    names = list(dict.fromkeys(row["name"] for row in found["perturbations"]))
    rows = ["| method, profile | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    places: dict[str, list[str]] = {}
    for row in found["perturbations"]:
        place = places.setdefault(f"`{row['solver']}`, {row['profile']}", [])
        ends = " to ".join("more" if row[end] is None else _rounded(row[end]) for end in ("low", "high"))
        if not row["draws"]:
            place.append("failed" if row["failed"] else "not told them")
        elif row["breaks_at"] is None:
            place.append("holds")
        elif row["breaks_at"] == 0:
            place.append("broken without")
        else:
            place.append(f"{_rounded(row['breaks_at'])} {row['unit']} ({ends}), {row['how']}")
        if row["failed"] and row["draws"]:
            place[-1] += f" ({row['failed']} failed)"
    return rows + [f"| {who} | " + " | ".join(fields) + " |" for who, fields in places.items()]


def _rounded(value: float) -> str:
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def candour(found: dict) -> list[str]:
    """Return the table of how often the methods doubt their own results."""
    rows = ["| method, profile | doubts, of the broken cells | of the others |", "|---|---|---|"]
    for row in found["doubts"]:
        shares = (f"{row[f'{which}_doubted']} of {row[which]}" for which in ("broken", "whole"))
        rows.append(f"| `{row['solver']}`, {row['profile']} | " + " | ".join(shares) + " |")
    return rows


def main() -> None:
    """Run what is missing, print the tables, and write them into the documentation if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out") / "sweeps")
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args()
    start = time.perf_counter()
    folder = sweep("all", out=options.out, quick=options.quick)
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
    marks = json.loads((folder / "stability.json").read_text())
    limits = "\n".join([*tolerances(marks), "", *candour(marks)]) + "\n"
    print(text, limits, sep="\n")
    if options.write and not options.quick:
        charts = []
        for name in EXPERIMENTS:
            shutil.copy(folder / f"{name}-normals.svg", ROOT / "docs" / "evidence" / f"sweeps-{name}.svg")
            charts.append(f"![{name}: angular error against level](sweeps-{name}.svg)\n")
        for name in ("atlas", "speed"):
            shutil.copy(folder / f"{name}.svg", ROOT / "docs" / "evidence" / f"sweeps-{name}.svg")
        path = ROOT / "docs" / "evidence" / "sweeps.md"
        put(path, "all", text + "\n" + "".join(charts))
        pictures = "![What breaks whom](sweeps-atlas.svg)\n\n![Speed against accuracy](sweeps-speed.svg)\n\n"
        put(path, "stability", pictures + limits)


if __name__ == "__main__":
    main()

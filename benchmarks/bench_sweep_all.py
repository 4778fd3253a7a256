"""All nine experiments in both stagings, beside the benchmark's own numbers; into docs/evidence/sweeps.md, findings.md.

    .venv/bin/python -m benchmarks.bench_sweep_all [--write] [--only benchmark] [--out out/sweeps]

Goes on where it was stopped. The charts of the plain readings are copied beside the pages; of the staging one-factor
the atlas, too, and the chart of speed against accuracy.
"""

import argparse
import json
import os
import shutil
import time
from pathlib import Path

from pyarrow import parquet

from benchmarks.pages import put
from experiments.stagings import ONE_FACTOR, SOLVERS
from experiments.sweeps.findings import Answer, answers, verdict_of
from experiments.sweeps.sweep import sweep
from experiments.sweeps.sweep_statistics import MEASURES, benchmark_statistics, three_means
from lab.options import Staging

ROOT = Path(__file__).resolve().parents[1]
STAGINGS: tuple[Staging, ...] = ("benchmark", "one-factor")


def means(found: list[dict]) -> list[str]:
    """Return the table of mean errors, each over three sets of pixels, and the benchmark's own."""
    ours = {(row["experiment"], row["solver"], row["profile"], row["measure"]): row for row in found}
    theirs = benchmark_statistics()
    rows = ["| mean error, degrees | " + " | ".join(SOLVERS.values()) + " |", "|---" * (len(SOLVERS) + 1) + "|"]
    for one in ONE_FACTOR.values():
        for profile in ("default", "seed"):
            fields = [_field([ours[one.name, solver, profile, measure] for measure in MEASURES]) for solver in SOLVERS]
            rows.append(f"| {one.label}, {profile} | " + " | ".join(fields) + " |")
        rows.append("| *the benchmark* | " + " | ".join(f"*{theirs[one.name, s]['mean']:.1f}*" for s in SOLVERS) + " |")
    return rows


def _field(three: list[dict]) -> str:
    told = ", ".join(f"{three[0][key]} {key.replace('_', ' ')}" for key in ("no_answer", "failed") if three[0][key])
    return three_means(three) + (f" ({told})" if told else "")


def agreements(found: dict[str, dict]) -> list[str]:
    """Return the table of rank correlations, of each staging's statistics.json."""
    rows = ["| staging, profile | means over | all means | methods within an experiment | between experiments |"]
    rows.append("|---|---|---|---|---|")
    for staging, numbers in found.items():
        for one in numbers["agreement"]:
            shown = (f"{one[k][0]:.2f} ({one[k][1]:.2f} to {one[k][2]:.2f})" for k in ("overall", "within", "between"))
            rows.append(f"| {staging}, {one['profile']} | {MEASURES[one['measure']]} | " + " | ".join(shown) + " |")
    return rows


def findings(found: dict[str, list[Answer]]) -> list[str]:
    """Return the table of the benchmark's statements, and what the stagings say to each; the verdict is the first's."""
    rows = ["| section | the benchmark says | counts as so if | " + " | ".join(found) + " | verdict |"]
    rows.append("|---" * (len(found) + 4) + "|")
    for place in zip(*found.values(), strict=True):
        one = place[0].finding
        fields = [
            "<br>".join(f"{p}: **{'yes' if each.holds[p] else 'no'}**, {words}" for p, words in each.numbers.items())
            for each in place
        ]
        verdict = verdict_of(place[0].holds.values())
        rows.append(f"| {one.section} | {one.claim} | {one.rule} | " + " | ".join(fields) + f" | **{verdict}** |")
    return rows


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


def _write_limits(page: Path, folder: Path) -> None:
    """Write what breaks whom, and the chart of speed against accuracy."""
    marks, pictures = json.loads((folder / "stability.json").read_text()), []
    for name, title in (("atlas", "What breaks whom"), ("speed", "Speed against accuracy")):
        shutil.copy(folder / f"{name}.svg", page.parent / f"sweeps-{name}.svg")
        pictures += [f"![{title}](sweeps-{name}.svg)", ""]
    put(page, "stability", "\n".join([*pictures, *tolerances(marks), "", *candour(marks), ""]))


def main() -> None:
    """Run what is missing, print the tables, and write them into the documentation if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--only", choices=STAGINGS)
    parser.add_argument("--out", type=Path, default=Path("out") / "sweeps")
    options = parser.parse_args()
    numbers, answered, texts, folders = {}, {}, {}, {}
    for staging in [options.only] if options.only else STAGINGS:
        start = time.perf_counter()
        folder = folders[staging] = sweep("all", out=options.out, staging=staging)
        wall_s = time.perf_counter() - start
        numbers[staging] = json.loads((folder / "statistics.json").read_text())
        answered[staging] = answers(parquet.read_table(folder / "results.parquet").to_pylist())
        seconds = [value or 0 for value in parquet.read_table(folder / "seconds.parquet").column("seconds").to_pylist()]
        texts[staging] = "\n".join(
            [
                *means(numbers[staging]["statistics"]),
                "",
                f"In each field: {' / '.join(MEASURES.values())}, one number where they are alike; "
                "share of the pixels that is answered, where it is not all.",
                "",
                f"All cells together: {sum(seconds) / 60:.0f} processor minutes. This run: {wall_s / 60:.1f} minutes "
                f"on {os.cpu_count()} cores, for what was missing.",
                "",
            ]
        )
    ranks, said = ("\n".join([*table, ""]) for table in (agreements(numbers), findings(answered)))
    print(*texts.values(), ranks, said, sep="\n")
    if options.write:
        page, pictures = ROOT / "docs" / "evidence" / "sweeps.md", ROOT / "docs" / "evidence"
        for staging, text in texts.items():
            charts = []
            for name in ONE_FACTOR:
                chart = f"sweeps-{name}.svg" if staging == "one-factor" else f"sweeps-benchmark-{name}.svg"
                shutil.copy(folders[staging] / f"{name}-normals-seed.svg", pictures / chart)
                charts.append(f"![{name}: mean angular error against level, plain readings]({chart})\n")
            put(page, staging, text + "\n" + "".join(charts))
        put(page, "agreement", ranks)
        put(pictures / "findings.md", "findings", said)
        if "one-factor" in folders:
            _write_limits(page, folders["one-factor"])


if __name__ == "__main__":
    main()

"""The seed's experiments on real things: virtual captures against counterparts; into docs/evidence/counterparts.md.

    .venv/bin/python -m benchmarks.bench_counterparts [--only iso] [--write] [--out out/counterparts]

Goes on where it was stopped. Each experiment has a block of its own in the page, and a chart,
docs/evidence/virtual-EXPERIMENT.svg.
"""

import argparse
import os
import time
from pathlib import Path

from benchmarks.pages import put
from benchmarks.virtual_lab import VIRTUAL_EXPERIMENTS, Experiment
from benchmarks.virtual_pairs import METHODS, Pair, run_experiments
from compare.report.line_chart import line_chart

ROOT = Path(__file__).resolve().parents[1]
SHOWN = ("ls", "iterative", "hsh")
"""In the charts: each twice, virtual and rendered."""


def chart(experiment: Experiment, pairs: list[Pair]) -> str:
    """Return the SVG of both sides' errors over the level."""
    levels = [pair.level for pair in pairs]
    lines = {
        f"{name}, {words}": (levels, [pair.medians(kind)[name] for pair in pairs])
        for name in SHOWN
        for kind, words in (("real", "virtual"), ("twin", "rendered"))
    }
    return line_chart(lines, x_title=experiment.axis, y_title="median angular error, degrees", log_x=experiment.log)


def rows(experiment: Experiment, pairs: list[Pair]) -> list[str]:
    """Return an experiment's table: medians virtual / rendered, rank correlation, verdict."""
    head = (experiment.axis, *METHODS, "Spearman of the methods", "tau, 90 %", "size", "place", "order", "verdict")
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    for pair in pairs:
        real, twin, order = pair.medians("real"), pair.medians("twin"), pair.found["order"]
        tau = f"{order['tau']:.2f}, {order['tau_low']:.2f} to {order['tau_high']:.2f}"
        fields = [f"{pair.level:g}", *(f"{real[name]:.1f} / {twin[name]:.1f}" for name in METHODS)]
        fields += [f"{pair.spearman:.2f}", tau, *(pair.found["reasons"][key] for key in ("level", "pattern", "order"))]
        lines.append("| " + " | ".join([*fields, f"**{pair.found['verdict']}**"]) + " |")
    return lines


def block(experiment: Experiment, pairs: list[Pair], spent_min: float) -> str:
    """Return an experiment's part of the page."""
    sigma = [pair.found["captures"]["real"]["carried"]["direction_sigma_deg"] for pair in pairs]
    told = ", ".join("unknown" if one is None else f"{one:.2f}°" for one in sigma)
    lines = [f"### {experiment.label} (virtual)", "", *rows(experiment, pairs), ""]
    lines += [
        f"Stated sigma of the light directions: {told}. 320 x 240 pixels, 16 flashes; {spent_min:.1f} processor "
        f"minutes, on {os.cpu_count()} cores, for what was missing.",
        "",
        f"![{experiment.label}: error over the level, virtual and rendered](virtual-{experiment.name}.svg)",
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run what is missing, print the tables, and write them into the documentation if asked."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--only", choices=[one.name for one in VIRTUAL_EXPERIMENTS])
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("out") / "counterparts")
    options = parser.parse_args()
    wanted = [one for one in VIRTUAL_EXPERIMENTS if options.only in (None, one.name)]
    start = time.process_time()
    for experiment, pairs in run_experiments(options.out, wanted):
        text, start = block(experiment, pairs, (time.process_time() - start) / 60), time.process_time()
        print(text, flush=True)
        if options.write:
            (ROOT / "docs" / "evidence" / f"virtual-{experiment.name}.svg").write_text(chart(experiment, pairs))
            put(ROOT / "docs" / "evidence" / "counterparts.md", experiment.name, text)


if __name__ == "__main__":
    main()

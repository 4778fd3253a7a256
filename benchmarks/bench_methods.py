"""Every solver on sessions with ground truth: error and speed, into docs/evidence/methods.md and four charts beside it.

    .venv/bin/python -m benchmarks.bench_methods [--write]

The fixture, and where ../shared is, the bunny and DiLiGenT's ball and cat. Nothing was tuned on any of them but
the fixture.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.pages import put
from compare.report.speed_chart import speed_chart, speed_points
from solve.methods import METHODS

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT / ".." / "shared"
SESSIONS = {
    "fixture": ROOT / "fixtures" / "bumpy",
    "bunny": SHARED / "sessions" / "bunny",
    "DiLiGenT ball": SHARED / "real" / "diligent" / "ballPNG",
    "DiLiGenT cat": SHARED / "real" / "diligent" / "catPNG",
}


TIMES = ("seconds", "seconds_per_megapixel_image", "twin_seconds")


def measure(folder: Path) -> dict:
    """Return a session's summary, each method's times the least of two runs: other work can only slow it down."""
    first, second = process(folder), process(folder)
    for method, row in first["solve"]["methods"].items():
        for key in TIMES:
            if row[key] is not None:
                row[key] = min(row[key], second["solve"]["methods"][method][key])
    return first


def process(folder: Path) -> dict:
    """Process one session in an empty folder and return its summary."""
    command = [
        str(Path(sys.executable).parent / "rgbn"),
        "process",
        str(folder),
        "--json",
        "--method",
        ",".join(METHODS),
    ]
    with tempfile.TemporaryDirectory() as out:
        run = subprocess.run([*command, "--out", out], capture_output=True, text=True, check=False)
    if run.returncode:
        raise SystemExit(run.stderr)
    return json.loads(run.stdout)


def table(summaries: dict[str, dict]) -> list[str]:
    """Return a row a method, a column a session: mean (median) error, and seconds for a million pixels of a frame."""
    heads = []
    for name, summary in summaries.items():
        work = summary["solve"]["methods"][METHODS[0]]
        heads.append(f"{name}, {work['frames']} x {work['megapixels'] * 1e3:.0f} kpx")
    lines = [f"| method | {' | '.join(heads)} |", "|---" * (1 + len(heads)) + "|"]
    for method in METHODS:
        cells = []
        for summary in summaries.values():
            error = summary["compare"]["methods"][method]["real"]
            seconds = summary["solve"]["methods"][method]["seconds_per_megapixel_image"]
            shown = f"{error['mean_deg']:.2f}° ({error['median_deg']:.2f}°)" if error else "no answer"
            cells.append(f"{shown}, {seconds:.2g} s" if seconds < 10 else f"{shown}, {seconds:.0f} s")
        lines.append(f"| `{method}` | {' | '.join(cells)} |")
    return lines


def chart_name(session: str) -> str:
    """Return the file of a session's chart."""
    return f"speed-{session.lower().replace(' ', '-')}.svg"


def charts(summaries: dict[str, dict]) -> dict[str, str]:
    """Return a chart a session, as SVG by its file's name."""
    out = {}
    for name, summary in summaries.items():
        points, missing = speed_points(summary)
        out[chart_name(name)] = speed_chart(points, label=f"Time against median angular error, {name}")
        for method, reason in missing:
            print(f"{name}: {method} is not in the chart: {reason}")
    return out


def main() -> None:
    """Measure, print, and with --write put table and charts into docs/."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    summaries = {name: measure(folder) for name, folder in SESSIONS.items() if folder.is_dir()}
    drawn = charts(summaries)
    pictures = [f"![speed against accuracy, {name}]({chart_name(name)})" for name in summaries]
    pairs = [list(summaries)[i : i + 2] for i in range(0, len(summaries), 2)]
    gallery = []
    for number, pair in enumerate(pairs):
        gallery.append(f"| {' | '.join(pictures[2 * number : 2 * number + 2])} |")
        gallery.append(f"| {' | '.join(pair)} |")
    gallery.insert(1, "|---" * len(pairs[0]) + "|")
    by = f"Measured on {os.cpu_count()} cores by `benchmarks/bench_methods.py`; seconds: the least of two runs."
    text = "\n".join([*table(summaries), "", *gallery, "", by]) + "\n"
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "methods.md"
        put(path, "table", text)
        for name, chart in drawn.items():
            path.with_name(name).write_text(chart)


if __name__ == "__main__":
    main()

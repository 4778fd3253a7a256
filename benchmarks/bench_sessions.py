"""Process sessions with known truth and write what came out into docs/evidence/sessions.md.

    .venv/bin/python -m benchmarks.bench_sessions [--write]

The fixture (made by our virtual camera) and, where ../shared is, the bunny (rendered by a program that shares no code
with this project). `--write` puts the table between the markers of the page.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.pages import put

ROOT = Path(__file__).resolve().parents[1]
SESSIONS = {"fixture": ROOT / "fixtures" / "bumpy", "bunny": ROOT / ".." / "shared" / "sessions" / "bunny"}
ROWS = (
    ("direction_median_deg", "light direction at the object, median", "≤ 1°", "{:.2f}°"),
    ("direction_max_deg", "... worst of the lights", "", "{:.2f}°"),
    ("position_median_percent", "light position, median, of its distance", "", "{:.2f} %"),
    ("intensity_rms_percent", "light intensity per channel, rms", "≤ 3 %", "{:.2f} %"),
    ("intensity_max_percent", "... worst", "", "{:.2f} %"),
    ("sphere_max_px", "balls: centre or radius, worst", "", "{:.2f} px"),
    ("registration_rms_px", "registration, rms over the scan", "≤ 1 px", "{:.2f} px"),
    ("registration_deg", "registration, rotation", "", "{:.3f}°"),
    ("truth_median_deg", "ground-truth normals against the true ones, median", "≤ 1°", "{:.2f}°"),
    ("mask_overlap", "object mask, intersection over union", "", "{:.3f}"),
    ("ls_median_deg", "`ls` against the true normals, median", "", "{:.2f}°"),
    ("iterative_median_deg", "`iterative` against the true normals, median", "", "{:.2f}°"),
)


def measure(folder: Path) -> tuple[dict, float, float]:
    """Process one session in an empty folder; return its summary, and the command's seconds and processor seconds."""
    code = (
        "import json, sys, rgbn; "
        "print(json.dumps(rgbn.open(sys.argv[1], out=sys.argv[2], truth=sys.argv[1]).process().summary))"
    )
    with tempfile.TemporaryDirectory() as out:
        start, before = time.perf_counter(), os.times()
        run = subprocess.run(
            [sys.executable, "-c", code, str(folder), out], capture_output=True, text=True, cwd=ROOT, check=False
        )
        seconds, after = time.perf_counter() - start, os.times()
    if run.returncode:
        raise SystemExit(run.stderr)
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    return json.loads(run.stdout), seconds, spent


def table(results: dict[str, tuple[dict, float, float]]) -> str:
    """Return the markdown table."""
    lines = ["| figure | asked | " + " | ".join(results) + " |", "|---|---|" + "---|" * len(results)]
    for key, label, asked, form in ROWS:
        cells = [
            form.format(s["truth_check"][key]["value"]) if key in s["truth_check"] else "" for s, *_ in results.values()
        ]
        lines.append(f"| {label} | {asked} | " + " | ".join(cells) + " |")
    for method in ("ls", "iterative"):
        for where in ("real", "twin"):
            cells = [f"{s['compare']['methods'][method][where]['median_deg']:.2f}°" for s, *_ in results.values()]
            name = "the frames" if where == "real" else "the twin"
            lines.append(f"| `{method}` on {name} against the ground truth, median | | " + " | ".join(cells) + " |")
    for label, asked, place in (("seconds, the whole command", "≤ 180", 1), ("... of one processor", "", 2)):
        lines.append(f"| {label} | {asked} | " + " | ".join(f"{row[place]:.0f}" for row in results.values()) + " |")
    return "\n".join(lines)


def main() -> None:
    """Measure, print, and with --write put the table into docs/evidence/sessions.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    results = {name: measure(folder) for name, folder in SESSIONS.items() if folder.is_dir()}
    text = table(results) + f"\n\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_sessions.py`.\n"
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "evidence" / "sessions.md"
        put(path, "sessions", text)


if __name__ == "__main__":
    main()

"""Every solver on sessions with ground truth: error and speed, written into docs/methods.md.

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

from solve.solve import METHODS

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT / ".." / "shared"
SESSIONS = {
    "fixture": ROOT / "fixtures" / "bumpy",
    "bunny": SHARED / "sessions" / "bunny",
    "DiLiGenT ball": SHARED / "real" / "diligent" / "ballPNG",
    "DiLiGenT cat": SHARED / "real" / "diligent" / "catPNG",
}


def measure(folder: Path) -> dict:
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


def rows(name: str, summary: dict) -> list[str]:
    """Return the table's lines of one session."""
    lines = []
    for method in METHODS:
        error, work = summary["compare"]["methods"][method]["real"], summary["solve"]["methods"][method]
        lines.append(
            f"| {name} | {work['frames']} | {work['megapixels'] * 1e3:.0f} | `{method}` | {error['mean_deg']:.2f} | "
            f"{error['median_deg']:.2f} | {error['under_10_deg']:.1%} | {work['seconds']:.2f} | "
            f"{work['seconds_per_megapixel_image']:.3f} |"
        )
    return lines


def main() -> None:
    """Measure, print, and with --write put the table into docs/methods.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    head = (
        "| session | frames | kpx | method | mean, degrees | median | under 10 degrees | seconds | "
        "s per megapixel-image |\n"
        "|---|---|---|---|---|---|---|---|---|"
    )
    body = [line for name, folder in SESSIONS.items() if folder.is_dir() for line in rows(name, measure(folder))]
    text = "\n".join([head, *body]) + f"\n\nMeasured on {os.cpu_count()} cores by `benchmarks/bench_methods.py`.\n"
    print(text)
    if arguments.write:
        path = ROOT / "docs" / "methods.md"
        before, rest = path.read_text().split("<!-- table -->\n")
        _, after = rest.split("<!-- end of table -->")
        path.write_text(f"{before}<!-- table -->\n{text}<!-- end of table -->{after}")


if __name__ == "__main__":
    main()

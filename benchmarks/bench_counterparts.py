"""The benchmark's experiments on real things: virtual captures against counterparts; into docs/evidence.

    .venv/bin/python -m benchmarks.bench_counterparts [--only iso | --write] [--out out/counterparts]

Goes on where it was stopped; a pair is made again where setup or code has changed. `--write` writes
counterparts.md, its charts (virtual-EXPERIMENT.svg) and error maps, and section 4 of findings.md all at once, and names
the commit that they are of.
"""

import argparse
import subprocess
from pathlib import Path

import cv2

from benchmarks.counterpart_findings import findings
from benchmarks.counterpart_tables import block, chart, curves, distinct, maps_picture, tables, verdict
from benchmarks.pages import put
from benchmarks.virtual_lab import VIRTUAL_EXPERIMENTS
from benchmarks.virtual_pairs import run_experiments
from scene.current import ROOMS

ROOT = Path(__file__).resolve().parents[1]
EVIDENCE = ROOT / "docs" / "evidence"


def commit(root: Path = ROOT) -> str:
    """Return the commit that all code is of; stop the program where some is changed and not committed."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True).stdout.strip()

    changed = git("status", "--porcelain", "--", *(room for room in (*ROOMS, "benchmarks") if (root / room).is_dir()))
    if changed:
        raise SystemExit(f"--write: all tables are to be of one commit, and this is not committed:\n{changed}")
    return git("rev-parse", "--short=10", "HEAD")


def main() -> None:
    """Run what is missing, print the tables, and write them into the documentation if asked."""
    parser = argparse.ArgumentParser()
    asked = parser.add_mutually_exclusive_group()
    asked.add_argument("--only", choices=[one.name for one in VIRTUAL_EXPERIMENTS])
    asked.add_argument("--write", action="store_true", help="of all experiments, for the page is of one commit")
    parser.add_argument("--out", type=Path, default=Path("out") / "counterparts")
    options = parser.parse_args()
    before = commit() if options.write else ""
    wanted = [one for one in VIRTUAL_EXPERIMENTS if options.only in (None, one.name)]
    results = {}
    for experiment, pairs in run_experiments(options.out, wanted):
        results[experiment.name] = pairs
        print("\n".join(block(experiment, pairs)), flush=True)
    if not options.write:
        return
    if commit() != before:
        raise SystemExit(f"--write: the code was at {before} when this began and is at {commit()} now. Run it again.")
    for experiment in wanted:
        EVIDENCE.joinpath(f"virtual-{experiment.name}.svg").write_text(chart(experiment, results[experiment.name]))
    done, picture = cv2.imencode(".png", maps_picture(results)[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done
    EVIDENCE.joinpath("virtual-maps.png").write_bytes(picture.tobytes())
    put(
        EVIDENCE / "counterparts.md", "verdict", verdict(distinct(wanted, results), curves(results), f"commit {before}")
    )
    put(EVIDENCE / "counterparts.md", "tables", tables(wanted, results))
    put(EVIDENCE / "findings.md", "section 4", findings(results))


if __name__ == "__main__":
    main()

"""Own memory of `rgbn process`, step by step, on 24-megapixel photographs with a scan; into docs/evidence/methods.md.

    .venv/bin/python -m benchmarks.bench_memory [--frames 60] [--faces 1000000] [--limit-gb 4] [--error 0.05] [--write]

Own memory is the process' anonymous memory, looked at every 20 ms; mapped pages of the frames' files are the system's
to drop. The limit is RLIMIT_DATA, which counts what is reserved too: beyond it the system refuses memory, and the run
fails. Twelve different flashes, each photograph listed several times.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.memory_session import write_session
from benchmarks.own_memory import OwnMemory
from benchmarks.pages import put

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "evidence" / "methods.md"
WIDTH, FLASHES = 6000, 12


def run(session: Path, out: Path, *, limit_gb: float = 0.0, error: float | None = None) -> list[dict[str, Any]]:
    """Process a session in this process; print and return a row a step: name, own memory (GB), seconds.

    Parameters
    ----------
    session, out : Path
    limit_gb : float
        0: none.
    error : float or None
        Of the twin's rendering, relative.
    """
    from lab.options import TwinSettings
    from lab.plan import STEPS
    from lab.run import run_session

    if limit_gb:
        most = int(limit_gb * 1e9)
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
    watch, rows = OwnMemory(), []

    def note(name: str, begun: tuple[float, float]) -> None:
        wall, processor = time.perf_counter() - begun[0], time.process_time() - begun[1]
        rows.append({"step": name, "gb": watch.peak, "wall": wall, "processor": processor})
        print(json.dumps(rows[-1]), flush=True)
        watch.peak = 0.0

    def watched(name: str, work: Callable) -> Callable:
        def timed(job: Any) -> Any:
            watch.peak, begun = 0.0, (time.perf_counter(), time.process_time())
            try:
                return work(job)
            finally:
                note(name, begun)

        return timed

    was = dict(STEPS)
    STEPS.update({name: replace(step, work=watched(name, step.work)) for name, step in was.items()})
    try:
        begun = time.perf_counter(), time.process_time()
        run_session(session, "compare", out=out, twin=TwinSettings(error=error))
    finally:
        STEPS.update(was)
        watch.stop()
    # What comes after the last step is the report.
    note("report", (begun[0] + sum(row["wall"] for row in rows), begun[1] + sum(row["processor"] for row in rows)))
    return rows


def table(rows: list[dict[str, Any]], *, frames: int, faces: int, limit_gb: float) -> str:
    """Return the rows as a table."""
    lines = [
        f"| {WIDTH * (WIDTH * 2 // 3) / 1e6:.0f} megapixels x {frames}, scan of {faces / 1e6:.1f} million triangles | "
        "own memory, peak | wall, s | processor, s |",
        "|---|---|---|---|",
        *(f"| {row['step']} | {row['gb']:.2f} GB | {row['wall']:.0f} | {row['processor']:.0f} |" for row in rows),
    ]
    limit = f" under a limit of {limit_gb:g} GB" if limit_gb else ""
    return "\n".join([*lines, "", f"`rgbn process` in one process{limit}, by `benchmarks/bench_memory.py`.", ""])


def main() -> None:
    """Make the session, process it in a process of its own, print, and with --write put the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=60, help=f"A multiple of {FLASHES}.")
    parser.add_argument("--faces", type=int, default=1_000_000)
    parser.add_argument("--limit-gb", type=float, default=4.0)
    parser.add_argument("--error", type=float, default=0.05)
    parser.add_argument("--folder", type=Path, help="Where to work; what is there already is not made again.")
    parser.add_argument("--here", action="store_true", help="Process the folder's session in this process.")
    parser.add_argument("--write", action="store_true")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = arguments.folder or Path(scratch)
        if arguments.here:
            run(folder / "session", folder / "out", limit_gb=arguments.limit_gb, error=arguments.error)
            return
        if not (folder / "session" / "session.toml").exists():
            write_session(
                folder / "session",
                width=WIDTH,
                flashes=FLASHES,
                faces=arguments.faces,
                times=arguments.frames // FLASHES,
            )
        command = [sys.executable, "-m", "benchmarks.bench_memory", "--here", "--folder", str(folder)]
        command += ["--limit-gb", str(arguments.limit_gb), "--error", str(arguments.error)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as child:
            assert child.stdout is not None
            rows = [json.loads(line) for line in child.stdout if line.startswith('{"step"')]
        if child.returncode:
            raise SystemExit(f"the run ended with exit code {child.returncode}, after {[row['step'] for row in rows]}")
    text = table(rows, frames=arguments.frames, faces=arguments.faces, limit_gb=arguments.limit_gb)
    print(text)
    if arguments.write:
        put(PAGE, "process memory", text)


if __name__ == "__main__":
    main()

"""Own memory of `rgbn process`, step by step, on 24-megapixel photographs with a scan; written into docs/methods.md.

    .venv/bin/python -m benchmarks.bench_memory [--frames 60] [--faces 1000000] [--limit-gb 4] [--error 0.01] [--write]

Own memory is the process' anonymous memory, looked at every 20 ms; mapped pages of the frames' files are the system's
to drop. The limit is RLIMIT_DATA: beyond it the system refuses memory, and the run fails.
"""

import json
import resource
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.own_memory import OwnMemory

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "methods.md"
REPORT = "report"


def run(session: Path, out: Path, *, limit_gb: float, wanted: str, method: str, error: float) -> list[dict]:
    """Process a session in this process; return a row a step: name, own memory (GB), wall and processor seconds."""
    from lab.plan import STEPS
    from lab.run import run_session
    from lab.twin_settings import TwinSettings

    if limit_gb:
        resource.setrlimit(resource.RLIMIT_DATA, (int(limit_gb * 1e9),) * 2)
    watch, rows = OwnMemory(), []

    def note(name: str, began: tuple[float, float]) -> None:
        wall, processor = time.perf_counter() - began[0], time.process_time() - began[1]
        rows.append({"step": name, "gb": watch.peak, "left_gb": watch.now(), "wall": wall, "processor": processor})
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
        watch.peak = 0.0

    def watched(name: str, work):
        def timed(job):
            watch.peak, began = 0.0, (time.perf_counter(), time.process_time())
            try:
                return work(job)
            finally:
                note(name, began)

        return timed

    for name, step in STEPS.items():
        STEPS[name] = replace(step, work=watched(name, step.work))
    run_session(session, wanted, out=out, method=method, twin=TwinSettings(error=error))
    if wanted == "compare":
        # What is left of the run is the report.
        rows.append({"step": REPORT, "gb": watch.peak, "left_gb": watch.now(), "wall": np.nan, "processor": np.nan})
    watch.stop()
    return rows

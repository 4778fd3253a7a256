"""How much memory of its own a whole run needs: it must not depend on how many photographs there are."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.memory_session import write_session
from lab.registration import median_or_none

ROOT = Path(__file__).resolve().parents[2]
WIDTH, FLASHES, TIMES = 816, 6, 8
RUNS = """
import ctypes, gc, sys
from pathlib import Path
from benchmarks.bench_memory import run
for name in ("few", "many"):
    run(Path(sys.argv[1]) / name, Path(sys.argv[1]) / f"{name}_out", error=0.2)
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
"""


@pytest.mark.full
@pytest.mark.render
def test_a_step_needs_no_more_memory_for_eight_times_the_frames(tmp_path):
    for name, times in (("few", 1), ("many", TIMES)):
        write_session(tmp_path / name, width=WIDTH, flashes=FLASHES, faces=30_000, times=times)
    command = [sys.executable, "-c", RUNS, str(tmp_path)]
    told = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, cwd=ROOT).stdout
    rows = [json.loads(line) for line in told.splitlines() if line.startswith('{"step"')]
    few, many = rows[: len(rows) // 2], rows[len(rows) // 2 :]
    assert [row["step"] for row in few] == [row["step"] for row in many]
    assert {"check", "calibrate", "align", "solve", "twin", "compare", "report"} <= {row["step"] for row in few}
    more_frames = (TIMES - 1) * FLASHES * WIDTH * (WIDTH * 2 // 3)
    codes_gb = more_frames * 3 * 2 / 1e9
    grown = {b["step"]: b["gb"] - a["gb"] for a, b in zip(few, many, strict=True)}
    # A stack of codes would be this much more, one of float32 twice as much.
    assert max(grown.values()) < 0.6 * codes_gb, grown


def test_the_median_of_a_map_is_that_of_all_its_numbers():
    """Without a copy of the whole map in float64: what is infinite counts, what is unknown does not."""
    values = np.random.default_rng(10_073).random((60, 80)).astype(np.float32)
    values[::3], values[1::6] = np.nan, np.inf
    assert median_or_none(values) == np.nanmedian(values.astype(np.float64))
    assert median_or_none(values[::3]) is None
    assert median_or_none(np.full(3, np.inf)) is None
    assert median_or_none(None) is None

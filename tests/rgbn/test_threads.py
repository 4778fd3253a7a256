"""The command line holds OpenBLAS to one thread, unless its user says otherwise."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = """
import ctypes, json
from importlib.metadata import entry_points
(entry,) = entry_points(group="console_scripts", name="rgbn")
entry.load()
import numpy, scipy.linalg
maps = [line.split()[-1] for line in open("/proc/self/maps") if "openblas" in line]
found = []
for path in sorted(set(maps)):
    library = ctypes.CDLL(path)
    names = [f"{prefix}openblas_get_num_threads{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", "")]
    found += [getattr(library, name)() for name in names if hasattr(library, name)][:1]
print(json.dumps(found))
"""


def blas_threads(**settings):
    """What numpy's and scipy's OpenBLAS say of themselves once the command's entry is loaded."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment | settings, stdout=subprocess.PIPE, check=True
    )
    found = json.loads(run.stdout)
    if not found:
        pytest.skip("numpy was built with another BLAS")
    return found


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="asks Linux which libraries are loaded")
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="needs two cores to tell")
def test_one_blas_thread_by_default_and_the_user_wins():
    assert set(blas_threads()) == {1}
    assert set(blas_threads(OPENBLAS_NUM_THREADS="2")) == {2}

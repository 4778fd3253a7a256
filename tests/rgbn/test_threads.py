"""The command line holds OpenBLAS to one thread, unless its user says otherwise; so do the tests."""

import ctypes
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from scene.rooms import ROOT

PROGRAM = """
import json
from importlib.metadata import entry_points
(entry,) = entry_points(group="console_scripts", name="rgbn")
entry.load()
from tests.rgbn.test_threads import threads_of_blas
print(json.dumps(threads_of_blas()))
"""

pytestmark = [
    pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="asks Linux which libraries are loaded"),
    pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="needs two cores to tell"),
]


def threads_of_blas():
    """What numpy's and scipy's OpenBLAS, in this process, say of themselves."""
    import numpy  # noqa: F401
    import scipy.linalg  # noqa: F401

    maps = [line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "openblas" in line]
    found = []
    for path in sorted(set(maps)):
        library = ctypes.CDLL(path)
        names = [f"{prefix}openblas_get_num_threads{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", "")]
        found += [getattr(library, name)() for name in names if hasattr(library, name)][:1]
    return found


def of_the_command(**settings):
    """What it is once the command's entry is loaded."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment | settings, stdout=subprocess.PIPE, check=True, cwd=ROOT
    )
    found = json.loads(run.stdout)
    if not found:
        pytest.skip("numpy was built with another BLAS")
    return found


def test_one_blas_thread_by_default_and_the_user_wins():
    assert set(of_the_command()) == {1}
    assert set(of_the_command(OPENBLAS_NUM_THREADS="2")) == {2}

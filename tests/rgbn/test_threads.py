"""The command line holds OpenBLAS to one thread, unless its user says otherwise; so do the tests."""

import os
import subprocess
import sys

import pytest

from scene.rooms import ROOT

PROGRAM = "import rgbn.cli, os, sys; assert 'numpy' not in sys.modules; print(os.environ['OPENBLAS_NUM_THREADS'])"


@pytest.mark.parametrize(("settings", "threads"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")])
def test_one_blas_thread_by_default_and_the_user_wins(settings, threads):
    """Set before numpy is loaded, which reads it once."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    words = [sys.executable, "-c", PROGRAM]
    run = subprocess.run(words, env=environment | settings, capture_output=True, text=True, check=True, cwd=ROOT)
    assert run.stdout.strip() == threads

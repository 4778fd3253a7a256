"""rgbn.log: every run with its command, what it said, and how it ended; bounded, and the user's if he changes it."""

import os
import re
import subprocess
import sys

import pytest

from lab.job import Job
from lab.progress import log, logged
from scene.output_folder import open_record
from tests.conftest import ROOT
from tests.lab.test_foreign_files import make_session


@pytest.fixture
def lab(tmp_path, monkeypatch):
    make_session(tmp_path / "pear")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def runs_of(out):
    """Return the runs of a log, each with its header line first."""
    text = (out / "rgbn.log").read_text()
    return [part.splitlines() for part in text.split("=== ")[1:]]


def test_every_run_is_logged_with_its_command_its_table_and_its_warnings(lab, run_rgbn):
    code, _, said = run_rgbn("check", "pear")
    again, _, more = run_rgbn("solve", "out/pear", "-q", "-m", "ls")
    assert (code, again) == (0, 0)
    first, second = runs_of(lab / "out" / "pear")
    assert first[0].endswith("  rgbn check pear")
    assert second[0].endswith("  rgbn solve out/pear -q -m ls")
    assert re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d[+-]", first[0])
    assert re.search(r"python \d.*rgbn \d.*numpy \d", first[1])
    assert any("pear: check" in line for line in first)
    # Quiet is for the terminal.
    assert any(line.endswith("solve ...") for line in second)
    assert any("sigma of a normal" in line for line in second)
    warnings = [line for line in (said + more).splitlines() if line.startswith("warning (align)")]
    assert warnings
    assert any(line.endswith(warnings[0]) for line in second)
    assert first[-1].endswith(" done")


def test_how_a_run_ended_is_logged(lab, monkeypatch, run_rgbn):
    (lab / "pear" / "known" / "lights.lp").write_text("3\n")
    code, _, said = run_rgbn("solve", "pear")
    assert code == 2
    assert runs_of(lab / "out" / "pear")[-1][-1].endswith(said.splitlines()[-1])

    def broken(*_):
        raise ZeroDivisionError("of the test")

    monkeypatch.setattr(Job, "frame_files", property(broken))
    make_session(lab / "plum")
    assert run_rgbn("solve", "plum")[0] == 1
    text = (lab / "out" / "plum" / "rgbn.log").read_text()
    assert "Traceback" in text
    assert "ZeroDivisionError: of the test" in text


def test_a_killed_run_leaves_what_it_had_said_to_the_next(lab):
    script = (
        "import os, sys\nfrom pathlib import Path\nfrom lab.progress import log, logged\n"
        "from scene.output_folder import open_record\n"
        "with open_record(Path('out')) as record, logged(record):\n"
        "    log('half way')\n    os.kill(os.getpid(), 9)\n"
    )
    killed = subprocess.run([sys.executable, "-c", script], env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert killed.returncode == -9
    assert not (lab / "out" / "rgbn.log").exists()
    with open_record(lab / "out") as record, logged(record):
        log("again")
    first, second = runs_of(lab / "out")
    assert first[-1].endswith("half way")
    assert [line.split(" ", 1)[1] for line in second[2:]] == ["again", "done"]

"""Standard streams that are closed, full or of another alphabet; work that is long off a terminal; threads."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lab import progress
from tests.conftest import ROOT
from tests.lab.test_foreign_files import make_session

FULL = Path("/dev/full")
pytestmark = pytest.mark.skipif(not FULL.exists(), reason="no /dev/full here")


def shell(words, *, environment=None):
    """Run the command line with a shell's redirections; return its end and what the shell saw."""
    program = f'{sys.executable} -c "from rgbn.cli import main; main()"'
    done = subprocess.run(
        ["bash", "-c", f"{program} {words}"], cwd=ROOT, capture_output=True, env=environment, timeout=300
    )
    return done.returncode, done.stdout.decode(), done.stderr.decode(errors="replace")


@pytest.mark.parametrize("words", ["--help > /dev/full", "dataset list > /dev/full"])
def test_standard_output_on_a_full_disk_is_told_once(words):
    code, _, said = shell(words)
    assert code == 2
    assert said.count("\n") == 1
    assert "standard output cannot be written (No space left on device)" in said


@pytest.mark.parametrize(
    ("words", "code"),
    [
        *((f"--help {closed}", 0) for closed in (">&-", "2>&-", "<&- >&- 2>&-")),
        *((f"check nowhere {closed}", 2) for closed in ("2>&-", ">&-", "2> /dev/full")),
    ],
)
def test_closed_streams_keep_the_exit_code(words, code):
    found, out, said = shell(words)
    assert found == code
    assert "Traceback" not in said
    if "2>&-" in words:
        assert "nowhere" not in out, "what is for people stays out of the results"


def test_a_closed_stream_s_number_is_not_given_to_a_file(tmp_path, picture_folder):
    """Without the null device in its place the first array would be opened as stream 2, and words written into it.

    The other run's words go to a terminal of ASCII alone.
    """
    ascii_alone = {**os.environ, "PYTHONIOENCODING": "ascii"}
    code, out, said = shell(f"check {picture_folder} --out {tmp_path / 'open'}", environment=ascii_alone)
    assert (code, "frames" in out) == (0, True), said
    assert shell(f"check {picture_folder} --out {tmp_path / 'shut'} <&- >&- 2>&-")[0] == 0
    names = [path.relative_to(tmp_path / "open") for path in (tmp_path / "open" / "frames").iterdir()]
    assert len(names) >= 2
    for name in names:
        assert (tmp_path / "open" / name).read_bytes() == (tmp_path / "shut" / name).read_bytes()


def test_a_word_that_is_no_text():
    code, _, said = shell(r"check $'a\xff'")
    assert code == 2
    assert "not UTF-8" in said
    assert said.count("\n") == 1


@pytest.fixture
def picture_folder(tmp_path):
    make_session(tmp_path / "session")
    manifest = tmp_path / "session" / "session.toml"
    manifest.write_text('name = "Jörg\'s box"\n' + manifest.read_text())
    return manifest.parent


@pytest.mark.parametrize(("settings", "threads"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "2"}, "2")])
def test_one_blas_thread_by_default_and_the_user_wins(settings, threads):
    """Set before numpy is loaded, which reads it once."""
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    program = "import rgbn.cli, os, sys; assert 'numpy' not in sys.modules; print(os.environ['OPENBLAS_NUM_THREADS'])"
    run = subprocess.run([sys.executable, "-c", program], env=environment | settings, stdout=subprocess.PIPE, cwd=ROOT)
    assert run.stdout.split() == [threads.encode()]


def test_a_single_long_unit_is_heard_of(monkeypatch, capsys):
    """`calibrate` was silent for 173 s: its units are long, and most of its work is none of them."""
    monkeypatch.setattr(progress, "EVERY_S", 0.1)
    with progress.progress_bar("calibrate") as report:
        report(1, 3)
        time.sleep(1.0)
    lines = capsys.readouterr().err.splitlines()
    assert 4 <= len(lines) <= 9
    assert all(re.fullmatch(r"  calibrate: 1 of 3, \d+ s so far", line) for line in lines)

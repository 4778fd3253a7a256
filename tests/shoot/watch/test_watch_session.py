"""A whole shoot: the virtual photographer's mistakes are told, and `process` goes on with the session as it lies."""

import json
import os
import shutil
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from fixtures.hasty_writers import killed_watch
from fixtures.virtual_photographer import blurred, pushed, shoot
from lab.run import run_session
from lab.session_place import MANIFEST
from scene.store import Store
from shoot.init.answers import Answers
from shoot.watch.watch_folder import watch_folder

SESSION = Path(__file__).parents[3] / "fixtures" / "bumpy"
BALLS = Answers(chrome=(100.0,), white=(90.0,))
pytestmark = pytest.mark.full


@pytest.fixture(scope="module")
def after_shoot(tmp_path_factory):
    """What lies in the folders after a shoot with mistakes, and what was said."""
    import contextlib
    import io

    place, said = tmp_path_factory.mktemp("shoot"), io.StringIO()
    (place / "hot").mkdir()
    photographer = threading.Thread(target=shoot, args=(place / "hot", SESSION), kwargs={"every_s": 1.0})
    photographer.start()
    with contextlib.redirect_stderr(said):
        watch_folder(place / "hot", out=place / "out", told=BALLS, until_idle=8.0)
    photographer.join()
    return place, said.getvalue()


def test_every_mistake_is_told_at_once_and_nothing_else(after_shoot):
    _, said = after_shoot
    warnings = [line for line in said.splitlines() if line.startswith("warning: ")]
    for told in (
        "flash_002b: the flash did not fire",
        "flash_005, flash_005b: lit from the same place",
        "flash_007b: the picture lies 7.",
        "flash_009b: is softer than the other frames",
    ):
        assert sum(told in line for line in warnings) == 1, told
    assert "flash_008b.dng is a copy of flash_008.dng" in said
    assert not [line for line in warnings if line.startswith("warning: half")], "what was begun and given up is nothing"
    # That its number is missing is true of the one that was renamed.
    sound = [f"flash_{i:03d}:" for i in range(12) if i != 6]
    assert not [line for line in warnings if any(f"warning: {name}" in line for name in sound)], warnings


def test_the_session_holds_each_photograph_once_and_process_goes_on_without_decoding(after_shoot):
    place, _ = after_shoot
    text = (place / "hot" / MANIFEST).read_text()
    assert text.count("diameter_mm = 100.0") == 2
    assert text.count("diameter_mm = 90.0") == 1
    codes = place / "out" / "frames" / "codes.npy"
    before = codes.stat().st_mtime_ns, codes.stat().st_ino
    run_session(place / "hot", "check", out=place / "out")
    assert (codes.stat().st_mtime_ns, codes.stat().st_ino) == before
    assert not (place / "out" / ".rgbn" / "decoded").exists(), "what was kept is in the store now"
    # The same as from the photographs alone.
    run_session(place / "hot", "check", out=place / "alone")
    one, other = Store(place / "out").load_frames(), Store(place / "alone").load_frames()
    assert one.names == other.names
    assert "flash_002b" not in one.names
    assert "flash_008b" not in one.names
    assert np.array_equal(one.codes, other.codes)
    assert np.array_equal(one.ambient, other.ambient)
    assert np.array_equal(one.gain, other.gain)
    assert one.saturation == other.saturation
    assert Store(place / "out").load_camera() == Store(place / "alone").load_camera()


def test_a_watch_goes_on_with_a_shoot_that_ended_and_leaves_a_changed_session_alone(after_shoot):
    from scene.errors import SessionError

    place, _ = after_shoot
    blurred(SESSION / "raw" / "flash_004.dng", place / "hot" / "flash_012.dng", sigma_px=0.8)
    watch_folder(place / "hot", out=place / "out", told=BALLS, until_idle=3.0)
    assert "flash_012" in Store(place / "out").load_frames().names
    watch_folder(place / "hot", out=place / "out", told=BALLS, until_idle=1.0)
    assert not (place / "out" / ".rgbn" / "decoded").exists(), "nothing was new, and no second copy is left"
    manifest = place / "hot" / MANIFEST
    manifest.write_text(manifest.read_text() + "# mine\n")
    pushed(SESSION / "raw" / "flash_004.dng", place / "hot" / "flash_013.dng")
    with pytest.raises(SessionError, match="is there already, and is not written over"):
        watch_folder(place / "hot", out=place / "out", told=BALLS, until_idle=1.0)
    assert manifest.read_text().endswith("# mine\n")


def test_a_watch_that_is_told_to_end_leaves_its_session(tmp_path):
    """SIGTERM is as good as Ctrl-C, and one more while it ends costs nothing; an ambient frame stood there first."""
    (tmp_path / "hot").mkdir()
    shutil.copy(SESSION / "raw" / "ambient_000.dng", tmp_path / "hot")
    os.utime(tmp_path / "hot" / "ambient_000.dng", (0, 0))
    words = [sys.executable, "-c", "from rgbn.cli import main; main()", "watch", "hot", "--out", "out"]
    environment = {**os.environ, "PYTHONPATH": str(SESSION.parents[1])}
    run = subprocess.Popen(words, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    said = run.stderr.readline()
    for source in (SESSION / "raw").glob("flash*"):
        shutil.copy(source, tmp_path / "hot")
    while "12 flash frames" not in said and (line := run.stderr.readline()):
        said += line
    run.terminate()
    while "the shoot is over" not in said and (line := run.stderr.readline()):
        said += line
    run.send_signal(signal.SIGINT)
    said += run.communicate(timeout=120)[1]
    assert run.returncode == 0, said
    assert (tmp_path / "hot" / MANIFEST).is_file()
    files = json.loads((tmp_path / "out" / ".rgbn" / "record.json").read_text())["files"]
    assert not [name for name in files if MANIFEST in name], "it is the user's"
    assert len(Store(tmp_path / "out").load_frames()) == 12


@pytest.mark.slow
def test_100_frames_by_four_hasty_writers_and_a_watch_killed_10_times(tmp_path):
    lost, doubled = killed_watch(tmp_path, count=100, kills=10)
    assert lost == []
    assert doubled == []

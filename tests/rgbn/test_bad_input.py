"""Each bad input ends with one clear message, exit code 2 (130 for Ctrl-C), and no half-written file."""

import errno
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from scene import files as files_module
from scene.files import write_png
from scene.output_folder import open_record

FIXTURE = Path(__file__).parents[2] / "fixtures" / "bumpy"
COMMAND = [str(Path(sys.executable).parent / "rgbn")]


@pytest.fixture
def session(tmp_path):
    """The fixture session, its frames as links, so that one can be spoilt."""
    folder = tmp_path / "session"
    (folder / "raw").mkdir(parents=True)
    for path in (FIXTURE / "raw").iterdir():
        (folder / "raw" / path.name).symlink_to(path)
    shutil.copytree(FIXTURE / "scan", folder / "scan")
    shutil.copy(FIXTURE / "session.toml", folder)
    return folder


def refused(result, *parts):
    code, _, message = result
    assert code == 2, message
    assert "Traceback" not in message
    faults = message[message.index("rgbn: ") :]
    for part in parts:
        assert part in faults
    return faults


def half_written(folder):
    return [path for path in folder.rglob("*") if path.is_file() and (".tmp" in path.name or path.parent.name == "tmp")]


def edit(session, old, new):
    path = session / "session.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_manifest_faults_are_told_all_at_once(run_rgbn, session):
    """A missing key, an unknown key and a glob that matches nothing, in one message with key paths."""
    edit(session, "raw/ambient_*.dng", "raw/dusk_*.dng")
    edit(session, 'kind = "white"', 'kynd = "white"')
    faults = refused(run_rgbn("process", session, "--out", session.parent / "out"), "dusk_", "kynd", "spheres")
    assert "3 faults" in faults
    assert not (session.parent / "out").exists()


def test_no_frames_table(run_rgbn, session):
    (session / "session.toml").write_text('name = "x"\n')
    refused(run_rgbn("check", session, "--out", session.parent / "out"), "frames")


def test_one_corrupt_raw(run_rgbn, session):
    victim = session / "raw" / "flash_003.dng"
    data = victim.read_bytes()
    victim.unlink()
    victim.write_bytes(data[: len(data) // 3])
    refused(run_rgbn("check", session, "--out", session.parent / "out"), "flash_003")
    assert not half_written(session.parent)
    assert not (session.parent / "out" / "frames" / "frames.json").exists()


def test_a_frame_of_another_size(run_rgbn, session):
    from twin.camera.virtual_camera import Sensor, write_dng

    victim = session / "raw" / "flash_004.dng"
    victim.unlink()
    shot = {"exposure_s": 0.01, "iso": 100, "aperture": 8.0, "focal_mm": 50.0, "time": datetime(2026, 1, 1, 12)}
    write_dng(victim, np.full((240, 320), 1000, np.uint16), Sensor(), **shot)
    refused(run_rgbn("check", session, "--out", session.parent / "out"), "flash_004", "320", "640")
    assert not half_written(session.parent)


def picture_session(folder, images, more=""):
    """A session of 16-bit linear PNG made by the test."""
    folder.mkdir()
    for index, image in enumerate(images):
        write_png(folder / f"flash_{index:03d}.png", (np.clip(image, 0, 1) * 65535).astype(np.uint16))
    (folder / "session.toml").write_text(f'[frames]\nflash = "flash_*.png"\nlinear = true\n{more}')
    return folder


def textures(count=6):
    rng = np.random.default_rng(0)
    return rng.uniform(0.2, 0.6, (120, 160, 3)) * rng.uniform(0.7, 1.0, (count, 1, 1, 1))


def test_jpeg_of_unknown_coding(run_rgbn, tmp_path):
    """Taken as linear without a word they bent normals by 10 degrees."""
    cv2 = pytest.importorskip("cv2")
    (tmp_path / "s").mkdir()
    for index in range(4):
        cv2.imwrite(str(tmp_path / "s" / f"flash_{index}.jpg"), np.full((40, 60, 3), 90 + index, np.uint8))
    (tmp_path / "s" / "session.toml").write_text('[frames]\nflash = "*.jpg"\n')
    refused(run_rgbn("check", tmp_path / "s", "--out", tmp_path / "out"), "frames.linear", "JPEG")


def test_a_scan_without_a_camera(run_rgbn, session):
    """One pixel is not one millimetre: said at once, where no ball of known diameter may tell the focal length."""
    text = (session / "session.toml").read_text()
    head, rest = text.split("[camera]")
    rest = re.sub("diameter_mm = .*", "", rest[rest.index("[[spheres]]") :])
    (session / "session.toml").write_text(head + rest)
    for index, path in enumerate(sorted((session / "raw").glob("flash_*.dng"))):
        path.unlink()
        picture = np.random.default_rng(index).integers(0, 60000, (48, 64, 3)).astype(np.uint16)
        write_png(session / "raw" / f"{path.stem}.png", picture)
    edit(session, "flash_*.dng", "flash_*.png")
    edit(session, 'ambient = "raw/ambient_*.dng"', "linear = true")
    refused(run_rgbn("check", session, "--out", session.parent / "out"), "object.ply", "[camera]")


def test_output_over_the_session_itself(run_rgbn, session):
    """A DiLiGenT folder has files of the output's names: they were overwritten."""
    before = {path: path.stat().st_size for path in session.rglob("*") if path.is_file()}
    for place in (session, session / "raw", session / "scan"):
        refused(run_rgbn("check", session, "--out", place), "--out")
    assert {path: path.stat().st_size for path in session.rglob("*") if path.is_file()} == before


def test_no_ball_found(run_rgbn, tmp_path):
    session = picture_session(tmp_path / "s", textures(), '[[spheres]]\nkind = "chrome"\n')
    refused(run_rgbn("calibrate", session, "--out", tmp_path / "out"), "no ball found (asked for: 1 chrome)")
    assert not (tmp_path / "out" / "lights.json").exists()


LIGHTS = '[lights]\nfile = "lights.lp"\n'


@pytest.mark.parametrize(
    ("directions", "part"),
    [([(0.1, 0, 1), (0.5, 0.5, 0.7)], "at least 3"), ([(0.0, 0, 1), (0.6, 0, 0.8), (-0.6, 0, 0.8)], "one plane")],
    ids=["two lights", "coplanar lights"],
)
def test_lights_that_cannot_do(run_rgbn, tmp_path, directions, part):
    session = picture_session(tmp_path / "s", textures(len(directions)), LIGHTS)
    rows = "".join(f"flash_{i:03d}.png {x} {y} {z}\n" for i, (x, y, z) in enumerate(directions))
    (session / "lights.lp").write_text(f"{len(directions)}\n{rows}")
    refused(run_rgbn("solve", session, "--out", tmp_path / "out"), part)


@pytest.mark.full
def test_scans_that_cannot_do(run_rgbn, session):
    head = "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    points = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n"
    index, faces = "property list uchar int vertex_indices\nend_header\n", "3 0 1 2\n3 0 1 3\n3 0 1 4\n"
    scans = {
        "empty": head.format(0) + "element face 0\n" + index,
        "points alone": head.format(5) + "end_header\n" + points,
        "torn": head.format(5) + "element face 3\n" + index + points + faces,
    }
    for kind, text in scans.items():
        (session / "scan" / "object.ply").write_text(text)
        refused(run_rgbn("align", session, "--out", session.parent / "out"), "object.ply")
        assert not (session.parent / "out" / "pose.json").exists(), kind


def test_a_full_disk(run_rgbn, session, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(files_module.os, "posix_fallocate", full)
    refused(run_rgbn("check", session, "--out", session.parent / "out"), "disk is full", "codes.npy")
    assert not half_written(session.parent)


def test_a_disk_that_is_really_full(session, tmp_path):
    """On a file system of 2 MB, where that can be mounted: no SIGBUS from the memory map, one message."""
    small = tmp_path / "small"
    small.mkdir()
    mount = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "none", str(small)], capture_output=True)
    if mount.returncode:
        pytest.skip("mounting a small file system is not allowed here")
    try:
        result = subprocess.run([*COMMAND, "check", session, "--out", small / "out"], capture_output=True, text=True)
        refused((result.returncode, result.stdout, result.stderr), "disk is full")
        assert not half_written(small)
    finally:
        subprocess.run(["umount", str(small)], check=True)


def test_an_output_folder_that_is_a_file(run_rgbn, session):
    (session.parent / "out").write_text("")
    refused(run_rgbn("check", session, "--out", session.parent / "out"), "--out")


def test_two_runs_in_one_folder(run_rgbn, session):
    with open_record(session.parent / "out"):
        refused(run_rgbn("check", session, "--out", session.parent / "out"), "another run")


@pytest.mark.parametrize(
    "words", [["proces", "x"], ["process"], ["solve", "x", "--method", "magic"], ["check", "x", "--ot", "y"]]
)
def test_a_slip_of_the_tongue(run_rgbn, words):
    code, _, _ = run_rgbn(*words)
    assert code == 2


def start(session, out):
    # A shell that runs the tests in the background ignores Ctrl-C, and its children inherit that.
    inherited = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return subprocess.Popen(
            [*COMMAND, "process", str(session), "--out", str(out)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
    finally:
        signal.signal(signal.SIGINT, inherited)


def wait_for(process, text):
    for line in process.stderr:
        if text in line:
            return
    raise AssertionError(f"{text!r} was never said")


@pytest.mark.parametrize("moment", ["check ...", "calibrate ...", pytest.param("align ...", marks=pytest.mark.full)])
def test_ctrl_c(session, moment):
    out = session.parent / "out"
    process = start(session, out)
    wait_for(process, moment)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=60)
    assert process.returncode == 130, message
    assert "stopped" in message
    assert "Traceback" not in message
    assert not half_written(session.parent)


def test_ctrl_c_while_a_compiled_module_loads():
    """What NumPy and SciPy make of it: an ImportError, caused by the KeyboardInterrupt."""
    message = subprocess.run(
        [
            sys.executable,
            "-c",
            "from rgbn.exit_codes import end_by\n"
            "error = ImportError('initialization failed')\n"
            "error.__cause__ = KeyboardInterrupt()\n"
            "end_by(error)",
        ],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    assert message.returncode == 130
    assert "stopped" in message.stderr
    assert "Traceback" not in message.stderr


@pytest.mark.full
@pytest.mark.slow
def test_a_killed_run_leaves_no_half_file_and_the_next_goes_on(run_rgbn, session):
    out = session.parent / "out"
    process = start(session, out)
    wait_for(process, "calibrate ...")
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    decoded = (out / "frames" / "codes.npy").stat().st_mtime_ns
    (out / ".rgbn" / "tmp").mkdir(exist_ok=True)
    (out / ".rgbn" / "tmp" / ".99.1.tmp.lights.json").write_text("left by a killed run")
    code, _, message = run_rgbn("calibrate", session, "--out", out)
    assert code == 0, message
    assert "check ..." not in message, "what was done is done"
    assert (out / "frames" / "codes.npy").stat().st_mtime_ns == decoded
    assert not half_written(out)

"""A disk that is full at any moment of a run: one message, nothing half-written, and the same command goes on."""

import hashlib
import json
import subprocess
import sys

import pytest

from tests.conftest import ROOT
from tests.lab.test_foreign_files import make_session

# Each run is a process of its own, forked from one that has loaded the libraries.
RUNS = """
import contextlib, io, json, os, subprocess, sys
import rgbn.cli, lab.run, lab.run, capture.photographs.decode, solve.solve, cv2, scene.output_folder
session, disk, sizes = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])

def run():
    reader, writer = os.pipe()
    child = os.fork()
    if not child:
        os.dup2(writer, 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.argv = ["rgbn", "solve", session, "--out", disk + "/out", "--method", "ls"]
        try:
            rgbn.cli.main()
        except SystemExit as end:
            os._exit(end.code)
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as said:
        text = said.read()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), text

for size in sizes:
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k", "none", disk], check=True)
    try:
        first, text = run()
        half = [n for place, _, names in os.walk(disk) for n in names if ".tmp." in n]
        subprocess.run(["mount", "-o", "remount,size=64m", disk], check=True)
        again = run()
        files = {}
        for place, folders, names in os.walk(disk + "/out"):
            folders[:] = [name for name in folders if name != ".rgbn"]
            for name in names:
                with open(os.path.join(place, name), "rb") as file:
                    files[os.path.relpath(os.path.join(place, name), disk)] = file.read().hex()
        print(json.dumps([size, first, text, half, again, files]), flush=True)
    finally:
        subprocess.run(["umount", disk], check=True)
"""


@pytest.mark.full
@pytest.mark.slow
def test_a_disk_of_any_size(tmp_path):
    make_session(tmp_path / "session")
    disk = tmp_path / "disk"
    disk.mkdir()
    probe = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=4k", "none", str(disk)], capture_output=True)
    if probe.returncode:
        pytest.skip("mounting a small file system is not allowed here")
    subprocess.run(["umount", str(disk)], check=True)
    sizes = [*range(4, 136, 16), 4096]
    command = [sys.executable, "-c", RUNS, str(tmp_path / "session"), str(disk), json.dumps(sizes)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    *_, (_, enough, _, _, _, whole) = rows
    assert enough == 0
    refused = 0
    for size, code, said, half, (again, said_again), files in rows:
        assert code in (0, 2), f"{size} KB: {said}"
        assert again == 0, f"{size} KB: {said_again}"
        assert not half, size
        if code:
            refused += 1
            assert "Traceback" not in said
            assert "the disk is full" in said or "No space left on device" in said, f"{size} KB: {said}"
        assert same(files) == same(whole), size
    assert refused > 5


def same(files):
    """Return the files' hashes; of the summary and the log, which tell when, only that they are there."""
    return {
        name: "" if name.endswith(("summary.json", "rgbn.log")) else hashlib.sha256(data.encode()).hexdigest()
        for name, data in files.items()
    }

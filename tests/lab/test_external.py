"""`--external`: another program as a method, from the command line to the report's numbers."""

import json
import shlex
import shutil
import sys

import numpy as np
import pytest

from tests.conftest import FIXTURE

PROGRAM = """
import sys
from pathlib import Path
import cv2, numpy as np
data, out = map(Path, sys.argv[1:])
if sys.argv[0].endswith("broken.py"):
    sys.exit("no weights here")
gray = np.stack([cv2.imread(str(data / name), -1).mean(-1) for name in (data / "filenames.txt").read_text().split()])
gray /= np.loadtxt(data / "light_intensities.txt").mean(1)[:, None, None]
normals = np.einsum("if,fhw->hwi", np.linalg.pinv(np.loadtxt(data / "light_directions.txt")), gray)
np.save(out / "normals.npy", normals / np.linalg.norm(normals, axis=-1, keepdims=True) * [1, -1, -1])
"""


@pytest.mark.full
def test_a_program_is_a_method_like_any_other_and_its_failure_one_message(rgbn_process, tmp_path):
    session, out = tmp_path / "session", tmp_path / "out"
    shutil.copytree(FIXTURE / "raw", session / "raw")
    lights = json.loads((FIXTURE / "truth.json").read_text())["directions_at_object"]
    rows = [
        f"{path.name} {x} {y} {z}\n" for path, (x, y, z) in zip(sorted(session.glob("raw/flash*")), lights, strict=True)
    ]
    (session / "lights.lp").write_text(f"{len(rows)}\n{''.join(rows)}")
    from scene.files import write_npy, write_png

    truth = np.load(FIXTURE / "truth.npz")
    write_png(session / "mask.png", truth["mask"])
    write_npy(session / "truth.npy", np.where(truth["mask"][..., None], truth["normals"], 0))
    (session / "session.toml").write_text(
        '[frames]\nflash = "raw/flash_*.dng"\nambient = "raw/ambient_*.dng"\n[lights]\nfile = "lights.lp"\n'
        '[object]\nmask = "mask.png"\nnormals = "truth.npy"\n'
    )
    (tmp_path / "fine.py").write_text(PROGRAM)
    (tmp_path / "broken.py").write_text(PROGRAM)

    def run(name):
        program = f"{shlex.quote(sys.executable)} {tmp_path / name}.py {{data}} {{out}}"
        more = ("--method", "ls", "--json", "--external", f"StandIn={program}")
        return rgbn_process("compare", session, "--out", out, *more)

    done = run("fine")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["solve"]["methods"]["StandIn"]["settings"]["axes"] == "(x, -y, -z)"
    errors = {name: row["real"]["median_deg"] for name, row in summary["compare"]["methods"].items()}
    assert errors["StandIn"] < errors["ls"] + 3
    assert (out / "normals" / "StandIn.npy").exists()
    assert "StandIn" in (out / "report.html").read_text()

    failed = run("broken")
    assert failed.returncode == 2
    assert "no weights here" in failed.stderr
    assert "Traceback" not in failed.stderr
    assert not (out / "normals" / "StandIn.npy").exists(), "no old result beside a failure"

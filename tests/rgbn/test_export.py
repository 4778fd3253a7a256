"""`rgbn export`: the lights of a session in another program's format."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from calibrate.known_lights.read_known import read_lights

FIXTURE = Path(__file__).parents[2] / "fixtures" / "bumpy"


def session_with_lights(folder):
    """Four of the fixture's frames, and lights by a .lp file."""
    (folder / "raw").mkdir(parents=True)
    for path in sorted((FIXTURE / "raw").glob("flash_00[0-3].dng")):
        shutil.copy(path, folder / "raw" / path.name)
    rows = [f"flash_{i:03d}.dng {x} {y} 0.8\n" for i, (x, y) in enumerate([(0.6, 0), (-0.6, 0), (0, 0.6), (0, -0.6)])]
    (folder / "l.lp").write_text("4\n" + "".join(rows))
    (folder / "session.toml").write_text('[frames]\nflash = "raw/*.dng"\n[lights]\nfile = "l.lp"\n')
    return folder


@pytest.mark.full
def test_lights_go_out_and_come_in_again(run_rgbn, tmp_path):
    session, out = session_with_lights(tmp_path / "session"), tmp_path / "out"
    code, printed, said = run_rgbn("export", session, "--out", out, "--format", "dome")
    assert code == 0, said
    path = Path(printed.strip())
    assert path == out / "export" / "lights.dome"
    third = json.loads(path.read_text())["directions"][2]
    np.testing.assert_allclose([third[axis] for axis in "xyz"], [0, 0.6, 0.8])
    names = tuple(f"flash_{i:03d}" for i in range(4))
    np.testing.assert_allclose(read_lights(path, names).directions, read_lights(session / "l.lp", names).directions)
    # What was exported does not outlive the lights it was made from.
    (session / "l.lp").write_text((session / "l.lp").read_text().replace("0.8", "0.9"))
    assert run_rgbn("export", session, "--out", out, "--format", "lp")[0] == 0
    assert sorted(file.name for file in (out / "export").iterdir()) == ["lights.lp"]

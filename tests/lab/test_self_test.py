"""`rgbn calibrate --self-test` on the fixture: small errors, honest sigmas, and a warning where they are not."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from compare.statistics.light_errors import sigma_doubts

FIXTURE = Path(__file__).parents[2] / "fixtures" / "bumpy"
COMMAND = [str(Path(sys.executable).parent / "rgbn")]


@pytest.mark.full
@pytest.mark.slow
@pytest.mark.render
def test_the_fixtures_balls(tmp_path):
    session, out = tmp_path / "session", tmp_path / "out"
    shutil.copytree(FIXTURE, session)
    text = (session / "session.toml").read_text()
    skip = ", ".join(f'"flash_{i:03d}"' for i in (1, 3, 5, 7, 9, 11))
    (session / "session.toml").write_text(text.replace("[frames]\n", f"[frames]\nskip = [{skip}]\n"))
    command = [*COMMAND, "calibrate", str(session), "--out", str(out), "--self-test", "--json"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    test = json.loads(run.stdout)["self_test"]
    assert test["calibrated"]
    assert test["model"] == "near"
    assert test["direction_error_deg_median"] < 0.4
    assert test["position_error_percent_median"] < 4
    assert test["intensity_error_percent_rms"] < 1.5
    whole = json.loads((out / "self_test.json").read_text())
    rows = whole["lights"]
    assert [row["name"] for row in rows] == [f"flash_{i:03d}" for i in (0, 2, 4, 6, 8, 10)]
    # It is a rendering that was calibrated, noise and all, not the lights handed through.
    assert min(row["direction_error_deg"] for row in rows) > 1e-4
    assert np.median([row["direction_error_deg"] for row in rows]) == pytest.approx(test["direction_error_deg_median"])
    assert not (out / "self_test").exists(), "gigabytes of rendered photographs are not left behind"
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "self_test ..." not in again.stderr, "done and current"


def test_a_session_without_balls_has_nothing_to_render(tmp_path):
    session = tmp_path / "session"
    (session / "raw").mkdir(parents=True)
    for path in sorted((FIXTURE / "raw").glob("flash_00[0-3].dng")):
        shutil.copy(path, session / "raw" / path.name)
    (session / "l.lp").write_text("4\na 0.5 0 0.8\nb -0.5 0 0.8\nc 0 0.5 0.8\nd 0 -0.5 0.8\n")
    (session / "session.toml").write_text('[frames]\nflash = "raw/*.dng"\n[lights]\nfile = "l.lp"\n')
    command = [*COMMAND, "calibrate", str(session), "--out", str(tmp_path / "out"), "--self-test"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 2
    assert "no ball" in run.stderr
    assert "Traceback" not in run.stderr


def test_dishonest_sigmas_are_told():
    honest = {"model": "near", "model_of_the_session": "near", "directions_inside_95": 0.92, "positions_inside_95": 1.0}
    assert sigma_doubts(honest) == []
    (told,) = sigma_doubts({**honest, "directions_inside_95": 0.5})
    assert "50% of the recovered directions" in told
    (told,) = sigma_doubts({**honest, "model": "distant"})
    assert "come out distant" in told

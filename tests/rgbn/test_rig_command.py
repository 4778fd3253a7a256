"""`rgbn rig`: output folders in, rig.json out; a session without balls takes its lights from it."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

import rgbn
from scene.files import write_json
from scene.store import Store
from tests.calibrate.test_rig import CAMERA, NAMES, noisy
from tests.lab.test_foreign_files import make_session


@pytest.fixture
def folders(tmp_path):
    """Output folders of three sessions of four lamps, as `calibrate` writes them."""
    for one in noisy(False, 3):
        store, rows = Store(tmp_path / one.name), [0, 3, 5, 8]
        store.save_lights(one.lights.only(rows))
        store.save_camera(CAMERA)
        write_json(store.path("calibration.json"), {"position_covariance_mm2": None, "evidence": []})
    return [tmp_path / f"s{k}" for k in range(3)]


def test_a_session_without_balls_takes_its_lights_from_the_rig(folders, tmp_path, run_rgbn, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, said = run_rgbn("rig", *folders, "--out", "Münze 😀.json")
    assert code == 0, said
    key = tomllib.loads(said.strip().rpartition("[lights] ")[2])
    assert Path(key["file"]).samefile("Münze 😀.json")
    code, out, said = run_rgbn("rig", *folders)
    assert all(NAMES[row] in out for row in (0, 3, 5, 8))
    assert "written: rig.json" in said
    np.testing.assert_allclose(
        [row["direction"] for row in json.loads((tmp_path / "rig.json").read_text())["frames"]],
        rgbn.rig(folders).lights.directions,
    )
    make_session(tmp_path / "pear")
    manifest = tmp_path / "pear" / "session.toml"
    manifest.write_text(manifest.read_text().replace('file = "known/lights.lp"', 'rig = "../rig.json"'))
    code, _, said = run_rgbn("calibrate", tmp_path / "pear", "--out", tmp_path / "out")
    assert code == 0, said
    found = Store(tmp_path / "out").load_lights()
    np.testing.assert_allclose(found.directions, rgbn.rig(folders).lights.directions)
    np.testing.assert_allclose(found.intensities, rgbn.rig(folders).lights.intensities)
    assert found.names == ("flash_0", "flash_1", "flash_2", "flash_3")
    # Lights that were read are no measurement.
    code, _, said = run_rgbn("rig", *folders, tmp_path / "out", "--out", tmp_path / "more.json")
    assert (code, (tmp_path / "more.json").exists()) == (2, False)
    assert "were read from a file, not measured" in said


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "found 0 session"),
        (("s0",), "found 1 session"),
        (("s0", "nowhere"), "nowhere: has no lights. Run `rgbn calibrate SESSION`"),
        (("s0", "s1", "--out", "rig.toml"), "the name must end in .json"),
        (("s0", "s1", "--out", "s0/camera.json"), "is there already, and holds no lamps"),
        (("s0", "s1", "--out", "three.json"), "three.json: is there already, and holds no lamps"),
        (
            ("s0", "s2"),
            "s2/calibration.json: is damaged (KeyError: 'evidence'). Remove it, and run `rgbn calibrate s2`",
        ),
        (("s0", "s1", "s1/../s0"), "s1/../s0: its lights are those of s0"),
    ],
)
def test_a_slip_is_one_message_and_nothing_is_written(folders, tmp_path, run_rgbn, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "three.json").write_text("3")
    (tmp_path / "s2" / "calibration.json").write_text("{}")
    before = sorted(path for path in tmp_path.rglob("*"))
    code, out, said = run_rgbn("rig", *words)
    assert (code, out) == (2, "")
    assert message in said
    assert sorted(path for path in tmp_path.rglob("*")) == before

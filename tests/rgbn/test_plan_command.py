"""`rgbn plan`: what it writes and prints, each fault in one message, and a session under way."""

import json
from pathlib import Path

import numpy as np
import pytest

from formats.meshes.ply_write import write_ply
from rgbn.plan_command import plan
from scene.errors import SceneError
from shoot.plan.plan_options import CameraOptions, ObjectOptions, ShootOptions
from shoot.plan.run_plan import run_plan

ROOT = Path(__file__).parents[2]
SMALL = CameraOptions(pixels=(900, 600))


def box(path):
    """Write a scan of a cube of 100 mm."""
    corners = np.array([[x, y, z] for x in (0, 100) for y in (0, 100) for z in (0, 100)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    write_ply(path, {"x y z": corners}, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))
    return path


@pytest.mark.parametrize(
    ("source", "options", "flashes", "words"),
    [
        ("notes.txt", {}, 8, "cannot read a mesh with the ending '.txt'"),
        ("no.ply", {}, 8, "there is no such scan or session"),
        ("broken.ply", {"unit": "mm"}, 8, "broken.ply"),
        ("box.ply", {}, 8, "a scan's file does not tell its unit"),
        ("box.ply", {"unit": "mm"}, 2, "--flashes 2: expected 4 to 200"),
        ("empty", {}, 8, "a folder without session.toml"),
        ("session", {}, 8, "matches no file"),
        (None, {"size_mm": -1.0}, 8, "--size-mm -1"),
        (None, {"albedo": 2.0}, 8, "--albedo 2"),
    ],
)
def test_each_fault_is_one_message_and_nothing_is_written(tmp_path, source, options, flashes, words):
    box(tmp_path / "box.ply")
    (tmp_path / "notes.txt").write_text("a cup")
    (tmp_path / "broken.ply").write_bytes(b"ply\nnonsense")
    (tmp_path / "empty").mkdir()
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / "session.toml").write_text('[frames]\nflash = "raw/*.dng"\n')
    place = None if source is None else tmp_path / source
    with pytest.raises(SceneError, match=words) as caught:
        run_plan(
            place, flashes, thing=ObjectOptions(**options), camera=SMALL, shoot=ShootOptions(), out=tmp_path / "out"
        )
    assert len(str(caught.value).splitlines()) == 1
    assert not (tmp_path / "out" / "plan.json").exists()


def test_a_scan_is_planned_written_and_told(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shoot = ShootOptions(chrome=(30.0, 30.0), white=(30.0,))
    scan = box(tmp_path / "box.ply")
    plan(scan, flashes=5, thing=ObjectOptions(unit="mm"), camera=SMALL, shoot=shoot, json=True)
    printed = json.loads(capsys.readouterr().out)
    written = json.loads((tmp_path / "out" / "plan-box" / "plan.json").read_text())
    assert written == {name: value for name, value in printed.items() if name != "folder"}
    assert len(written["flashes"]) == 5
    assert [ball["kind"] for ball in written["balls"]] == ["chrome", "chrome", "white"]
    assert written["object"]["size_mm"] == pytest.approx(100)
    # What the camera sees of a cube from above is one face; 100 mm fill 40 % of the picture.
    assert written["camera"]["mm_per_px"] * 0.4 * 600 == pytest.approx(100, rel=0.1)
    page = (tmp_path / "out" / "plan-box" / "plan.html").read_text()
    assert "plan of a shoot" in page
    plan(scan, flashes=5, thing=ObjectOptions(unit="mm"), camera=SMALL, shoot=shoot)
    told = capsys.readouterr().out
    assert "flashes, the most useful first" in told
    assert "plan.html" in "".join(told.split())


@pytest.mark.full
def test_a_session_under_way_is_continued(tmp_path):
    """The example's frames: as they are the lights so far, and the next ones lower the error."""
    facts = run_plan(
        ROOT / "fixtures" / "bumpy", 30, thing=ObjectOptions(), camera=CameraOptions(), shoot=ShootOptions(),
        out=tmp_path / "out",
    )  # fmt: skip
    there = facts["there"]
    assert there > 3
    assert [row["is_there"] for row in facts["flashes"]] == [True] * there + [False] * (30 - there)
    lights = json.loads((tmp_path / "out" / "lights.json").read_text())["frames"]
    assert [row["direction"] for row in facts["flashes"][:there]] == pytest.approx(
        np.array([light["direction"] for light in lights]), abs=0.05
    )
    errors = [row["error_median_deg"] for row in facts["flashes"][there - 1 :]]
    assert errors[-1] < errors[0]
    assert facts["minutes"] == pytest.approx(15 + (30 - there) * 20 / 60)

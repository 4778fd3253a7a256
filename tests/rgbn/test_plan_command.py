"""`rgbn plan`: what it writes and prints, each fault in one message, and a session under way."""

import json

import pytest

from formats.meshes.ply import write_ply
from shoot.plan.plan_options import PlanOptions
from shoot.plan.run_plan import run_plan
from tests.conftest import FIXTURE
from twin.description.object_mesh import built_in


def box(path):
    """Write a scan of a cube of 100 mm."""
    cube = built_in("cube")
    write_ply(path, {"x y z": 50 * cube.vertices}, cube.faces)
    return path


@pytest.mark.parametrize(
    ("source", "options", "words"),
    [
        ("notes.txt", [], "cannot read a mesh with the ending '.txt'"),
        ("no.ply", [], "there is no such scan or session"),
        ("broken.ply", ["--unit", "mm"], "broken.ply"),
        ("box.ply", [], "a scan's file does not tell its unit"),
        ("box.ply", ["--flashes", "2"], "--flashes. Must be >= 4"),
        ("empty", [], "holds neither session.toml"),
        ("session", [], "matches no file"),
        (None, ["--size-mm", "-1"], "--size-mm. Must be > 0"),
        (None, ["--albedo", "2"], "--albedo. Must be <= 1"),
        (None, ["--size-mm", "5", "--ball-mm", "20"], "no room in the picture for four of 20 mm. Take smaller ones"),
        (None, ["--size-mm", "5", "--ball-mm", "200"], "no room in the picture for four of 200 mm"),
        (
            None,
            ["--flash-mm", "1e6", "--ball-mm", "0.1", "--focal-mm", "1", "--sensor-mm", "1000"],
            "they tell nothing of flashes at",
        ),
        (None, ["--empty-pixels"], "Unknown option: --empty-pixels"),
        (None, ["--empty-azimuths-deg"], "Unknown option: --empty-azimuths-deg"),
    ],
)
def test_each_fault_is_one_message_and_nothing_is_written(tmp_path, run_rgbn, source, options, words):
    box(tmp_path / "box.ply")
    (tmp_path / "notes.txt").write_text("a cup")
    (tmp_path / "broken.ply").write_bytes(b"ply\nnonsense")
    (tmp_path / "empty").mkdir()
    (tmp_path / "session").mkdir()
    (tmp_path / "session" / "session.toml").write_text('[frames]\nflash = "raw/*.dng"\n')
    place = [] if source is None else [tmp_path / source]
    code, _, said = run_rgbn("plan", *place, "--pixels", "900", "600", *options, "--out", tmp_path / "out")
    assert code == 2
    assert words in said
    assert len([line for line in said.splitlines() if line.startswith("rgbn: ")]) == 1
    assert not (tmp_path / "out" / "plan.json").exists()


def test_a_scan_is_planned_written_and_told(tmp_path, run_rgbn, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["plan", box(tmp_path / "box.ply"), "--flashes", "5", "--unit", "mm", "--pixels", "900", "600"]
    words += ["--ball-mm", "30"]
    code, printed, said = run_rgbn(*words, "--json")
    assert code == 0, said
    written = json.loads((tmp_path / "out" / "plan-box" / "plan.json").read_text())
    assert written == {name: value for name, value in json.loads(printed).items() if name != "folder"}
    assert len(written["flashes"]) == 5
    assert [ball["kind"] for ball in written["balls"]] == ["chrome", "chrome", "chrome", "white"]
    assert written["object"]["size_mm"] == pytest.approx(100)
    # What the camera sees of a cube from above is one face; 100 mm fill 40 % of the picture.
    assert written["object"]["mm_per_px"] * 0.4 * 600 == pytest.approx(100, rel=0.1)
    page = (tmp_path / "out" / "plan-box" / "plan.html").read_text()
    assert "plan of a shoot" in page
    told = " ".join(run_rgbn(*words)[1].split())
    assert "flashes, the most useful first" in told
    assert "plan.html" in told
    assert "of a matte surface, shadows left out" in told


@pytest.mark.full
def test_a_session_under_way_is_continued(tmp_path):
    """The example's frames: as they are the lights so far, and the next ones lower the error."""
    facts = run_plan(FIXTURE, PlanOptions(flashes=30), out=tmp_path / "out")
    there, lights = facts["there"], json.loads((tmp_path / "out" / "lights.json").read_text())["frames"]
    assert [row["there"] for row in facts["flashes"]] == ["there"] * there + [""] * (30 - there)
    for row, light in zip(facts["flashes"], lights, strict=False):
        assert row["position_mm"] == pytest.approx(light["position_mm"], abs=1)
    errors = [row["error_median_deg"] for row in facts["flashes"][there - 1 :]]
    assert errors[-1] < errors[0]

"""The shelf of examples: each is what its line says, unpacks nowhere by mistake, and runs."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import rgbn
from capture.session.session import load_session
from rgbn.examples import EXAMPLES, TRUTH, fixture_folder, tell_example
from scene.errors import AlignError, SceneError

COMMAND = [str(Path(sys.executable).parent / "rgbn")]


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_fixture_is_unpacked_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert rgbn.example("fixture") == Path("fixture")
    assert files(tmp_path / "fixture") == files(fixture_folder())
    assert [path.name for path in tmp_path.iterdir()] == ["fixture"], "nothing unfinished stays"


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name != "fixture"])
def test_an_example_is_the_fixture_with_one_thing_changed(tmp_path, name):
    """Its photographs are the fixture's; no truth that its author did not have; no file but those it needs."""
    own, whole = files(rgbn.example(name, tmp_path / "here")), files(fixture_folder())
    assert {path: own[path] for path in whole if path.startswith("raw/")} == {
        path: text for path, text in whole.items() if path.startswith("raw/")
    }
    assert not set(own) & set(TRUTH)
    assert set(own) - set(whole) == ({"lights.lp"} if name == "known-lights" else set())
    assert ("session.toml" in own) == (name != "no-session-toml")
    assert ("scan/object.ply" in own) == (name in {"no-session-toml", "wrong"})


def test_sessions_say_what_their_lines_say(tmp_path):
    fixture = load_session(rgbn.example("fixture", tmp_path / "fixture"))
    bare = load_session(rgbn.example("no-scan", tmp_path / "no-scan"))
    known = load_session(rgbn.example("known-lights", tmp_path / "known-lights"))
    assert (fixture.name, bare.name, known.name) == ("bumpy", "no-scan", "known-lights")
    assert fixture.camera == bare.camera == known.camera
    assert [ball.kind for ball in bare.spheres] == [ball.kind for ball in fixture.spheres]
    assert bare.scan is None
    assert known.scan is None
    assert not known.spheres
    assert known.lights_file == tmp_path / "known-lights" / "lights.lp"


def test_known_lights_are_the_true_ones_in_the_frames_order(tmp_path):
    import json

    session = rgbn.open(rgbn.example("known-lights", tmp_path / "session"), out=tmp_path / "out")
    truth = json.loads((fixture_folder() / "truth.json").read_text())
    lights = session.lights
    np.testing.assert_allclose(lights.directions, truth["directions_at_object"], atol=1e-5)
    assert lights.names == session.frames.names
    assert not any("order" in flag for flags in lights.flags for flag in flags)


def test_all_slips_are_told_at_once_and_each_message_says_the_cure(tmp_path):
    folder = rgbn.example("wrong", tmp_path / "wrong")
    with pytest.raises(SceneError, match="4 faults") as told:
        rgbn.open(folder)
    for words in ("raw/flsh_*.dng", "'640 px'", "Did you mean diameter_mm?", "scans/object.ply"):
        assert words in str(told.value)


@pytest.mark.full
@pytest.mark.slow
def test_the_last_slip_shows_in_the_photographs(tmp_path):
    """What the first message says is put right; then the scan's unit is doubted, and once it is mended all runs."""
    folder = rgbn.example("wrong", tmp_path / "wrong")
    text = (folder / "session.toml").read_text()
    for wrong, right in (("flsh", "flash"), ('"640 px"', "640"), ("diametre", "diameter"), ("scans/", "scan/")):
        text = text.replace(wrong, right)
    (folder / "session.toml").write_text(text)
    session = rgbn.open(folder, out=tmp_path / "out")
    with pytest.raises(AlignError, match="scan_unit"):
        session.align()
    (folder / "session.toml").write_text(text.replace('scan_unit = "m"', 'scan_unit = "mm"'))
    assert np.isfinite(session.truth[session.mask]).mean() > 0.9


def test_nothing_of_the_user_is_written_over(tmp_path):
    (tmp_path / "mine").mkdir()
    assert rgbn.example("no-scan", tmp_path / "mine") == tmp_path / "mine", "an empty folder is taken"
    before = files(tmp_path)
    for place in (tmp_path / "mine", tmp_path / "mine" / "session.toml"):
        with pytest.raises(SceneError, match="is there already"):
            rgbn.example("fixture", place)
    with pytest.raises(SceneError, match="cannot be written"):
        rgbn.example("fixture", tmp_path / "mine" / "session.toml" / "below")
    with pytest.raises(SceneError, match="unknown; there are fixture, no-scan"):
        rgbn.example("mine", tmp_path / "new")
    assert files(tmp_path) == before
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_the_command_line_lists_and_unpacks(tmp_path, capsys):
    tell_example()
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(EXAMPLES)
    run = subprocess.run([*COMMAND, "example", "no-scan"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "rgbn process no-scan" in run.stdout
    assert load_session(tmp_path / "no-scan").name == "no-scan"
    run = subprocess.run([*COMMAND, "example", "no-scan"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (run.returncode, run.stderr.count("\n")) == (2, 1)

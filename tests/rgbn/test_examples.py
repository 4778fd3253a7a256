"""The shelf of examples: each is what its line says, unpacks nowhere by mistake, and runs."""

from pathlib import Path

import numpy as np
import pytest

import rgbn
from rgbn.examples import EXAMPLES, TRUTH, fixture_folder
from scene.errors import SceneError


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

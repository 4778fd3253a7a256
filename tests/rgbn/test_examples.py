"""The examples: each is what its line says, and unpacks nowhere by mistake."""

import pytest

import rgbn
from rgbn.examples import fixture_folder
from scene.errors import SceneError


def files(folder):
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_an_example_is_the_fixture_or_a_part_of_it_and_is_written_over_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    whole, own = files(fixture_folder()), files(rgbn.example("fixture"))
    assert own == whole
    bare = files(rgbn.example("no-session-toml", "mine"))
    assert {*whole} - {*bare} == {"session.toml", "truth.json", "truth.npz"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fixture", "mine"], "nothing unfinished stays"
    for name, place, told in (
        ("fixture", tmp_path / "mine", "is there already"),
        ("fixture", tmp_path / "fixture" / "session.toml", "is there already"),
        ("fixture", tmp_path / "fixture" / "session.toml" / "below", "cannot be written"),
        ("other", tmp_path / "new", "unknown; there are fixture, no-session-toml"),
    ):
        with pytest.raises(SceneError, match=told):
            rgbn.example(name, place)
    assert files(tmp_path / "fixture") == whole
    assert files(tmp_path / "mine") == bare

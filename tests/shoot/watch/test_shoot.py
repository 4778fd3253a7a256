"""The parts of a watch: photographs that stand in a folder, their roles, lights, and folders that cannot be watched."""

import os
import re
import shutil
import threading
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from capture.photographs.kept import Kept
from capture.survey.hot_folder import HotFolder, list_photographs
from scene.current import file_digest
from shoot.init.answers import Answers, Asking
from shoot.watch.shoot import named_in, warning_key
from shoot.watch.taken import PATIENCE_S, Taken, read_shot, sort_shots
from shoot.watch.watch_folder import _loop, whole_photographs
from tests.conftest import FIXTURE

RAW = FIXTURE / "raw"
SILENT = Asking(Answers({}), silent=True)


@pytest.fixture
def shot_of(tmp_path):
    """Return a function that takes a photograph of the fixture into a folder under a name of its own."""
    folder = tmp_path / "hot"
    folder.mkdir()

    def shot(source, name):
        path = folder / name
        shutil.copy(RAW / source, path)
        return read_shot(path, file_digest(path), Kept(tmp_path / "kept", "linear", False))

    return shot


@pytest.fixture
def taking(tmp_path):
    """A folder, and what is taken of it when a second has gone by."""
    folder, said = tmp_path / "hot", []
    folder.mkdir()
    hot, taken, now = HotFolder(), Taken(folder, tmp_path / "kept", SILENT, said.append, said.append), [0.0]

    def look(*, seconds=1.0):
        said.clear()
        fresh = []
        for _ in range(2):
            now[0] += seconds
            fresh += taken.renew(hot.see(list_photographs(folder), now[0]), now[0])[0]
        return [shot.name for shot in fresh], sorted(shot.name for shot in taken.shots.values()), " | ".join(said)

    return SimpleNamespace(folder=folder, look=look, taken=taken)


def test_each_photograph_is_taken_once_by_its_content(taking, monkeypatch):
    """Through renames, copies, other content under the same name, two that exchange their names, and a deletion."""
    folder, look = taking.folder, taking.look
    shutil.copy(RAW / "flash_000.dng", folder / "a.dng")
    shutil.copy(RAW / "flash_001.dng", folder / "b.dng")
    assert look() == (["a.dng", "b.dng"], ["a.dng", "b.dng"], "")
    assert look() == ([], ["a.dng", "b.dng"], "")
    # From here on nothing that is known is decoded again.
    monkeypatch.setattr("capture.photographs.develop.read_raw", None)
    shutil.copy(folder / "a.dng", folder / "0.dng")
    assert look() == ([], ["a.dng", "b.dng"], "0.dng is a copy of a.dng, and no other photograph")
    (folder / "a.dng").unlink()
    assert look() == ([], ["0.dng", "b.dng"], "")
    for before, after in (("0.dng", "c.tmp"), ("b.dng", "0.dng"), ("c.tmp", "b.dng")):
        (folder / before).rename(folder / after)
    assert look()[:2] == ([], ["0.dng", "b.dng"])
    # Elsewhere for so long that it was missed, as a slow renaming is.
    (folder / "b.dng").rename(folder.parent / "away.dng")
    assert look() == ([], ["0.dng"], "b.dng: is gone, or another stands in its place; it is left out")
    (folder.parent / "away.dng").rename(folder / "d.dng")
    assert look() == ([], ["0.dng", "d.dng"], "")
    (folder / "d.dng").unlink()
    assert look()[:2] == ([], ["0.dng"])
    monkeypatch.undo()
    shutil.copy(RAW / "flash_002.dng", folder / "0.dng")
    assert look()[:2] == (["0.dng"], ["0.dng"])


def test_a_file_that_is_never_whole_is_told_once_and_read_when_it_is(taking):
    data = (RAW / "flash_000.dng").read_bytes()
    (taking.folder / "half.dng").write_bytes(data[: len(data) // 2])
    assert taking.look() == ([], [], ""), "it may still grow"
    assert taking.taken.is_waiting
    fresh, counted, said = taking.look(seconds=PATIENCE_S)
    assert not fresh
    assert not counted
    assert re.match(r"half.dng: half written since \d\d:\d\d, or damaged.* Let the camera's program finish it", said)
    assert not taking.taken.is_waiting
    assert taking.look(seconds=PATIENCE_S)[2] == ""
    (taking.folder / "half.dng").write_bytes(data)
    assert taking.look()[:2] == (["half.dng"], ["half.dng"])
    assert not taking.taken.unreadable


def test_a_warning_is_the_same_though_its_numbers_change():
    names = ["flash_30", "flash_3"]
    first = warning_key("flash_3: lies 1.2 px off", names)
    assert warning_key("flash_3: lies 1.4 px off", names) == first
    assert warning_key("flash_30: lies 1.4 px off", names) != first, "another frame"
    assert named_in("flash_30, flash_4: no chrome ball shows the flash.", [*names, "flash_4"]) == [
        "flash_30",
        "flash_4",
    ]
    places = [warning_key(f"flash_3: the ball at ({u}, 50) px lies 3.{u} px off", names) for u in (10, 200)]
    assert places[0] != places[1], "another ball"


def test_a_frame_without_flash_is_the_ambient_one_or_a_misfire(shot_of, tmp_path):
    """Nothing tells them apart but the name of another that is the ambient frame."""
    lit = [shot_of(f"flash_{i:03d}.dng", f"IMG_{i}.dng") for i in range(4)]
    dark = shot_of("ambient_000.dng", "IMG_9.dng")
    roles, told = sort_shots([*lit, dark], tmp_path / "hot")
    assert [one.name for one in roles["flash"]] == [f"IMG_{i}.dng" for i in range(4)]
    assert roles["ambient"] == [dark]
    assert "taken for the ambient frame" in told[dark.digest]
    named = shot_of("ambient_000.dng", "ambient.dng")
    roles, told = sort_shots([*lit, dark, named], tmp_path / "hot")
    assert roles["ambient"] == [named]
    assert "did not fire" in told[dark.digest]
    assert dark not in roles["flash"]


@pytest.mark.parametrize(
    ("made", "words", "told"),
    [
        ([], [], "hot: there is no such folder. Give the folder that the camera's program writes into."),
        (["hot"], [], "is no folder"),
        (["hot/a.dng"], ["--out", "hot/out"], "lies in the folder"),
        (["hot/a.dng", "out/thesis.txt"], ["--out", "out"], "is not empty (thesis.txt)"),
        (["hot/session.toml"], ["--out", "out"], "session.toml: is there already, and is not written over"),
        (["hot/filenames.txt"], ["--out", "out"], "is a session in the DiLiGenT layout already"),
        (["hot/a.txt"], ["--out", "out", "--until-idle", "-1"], "for --until-idle. Must be > 0"),
        (["hot/a.txt"], ["--out", "out", "--until-idle", "0.1"], "0 photographs show the flash; a session needs 3"),
        (
            ["hot/a.txt"],
            ["--out", "out", "--chrome", "big"],
            "--chrome: big: expected millimetres, as in 76. `rgbn watch --help`",
        ),
    ],
)
def test_what_cannot_be_watched_is_one_message(run_rgbn, tmp_path, monkeypatch, made, words, told):
    monkeypatch.chdir(tmp_path)
    for name in made:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text("mine")
    code, _, err = run_rgbn("watch", "hot", *words)
    assert code == 2, err
    assert told in err
    assert "Traceback" not in err
    assert all(Path(name).read_text() == "mine" for name in made)


def test_a_photograph_is_judged_while_the_lights_of_those_before_are_fitted(tmp_path):
    judged, fitted, said = [], threading.Event(), []
    taken = SimpleNamespace(shots={}, is_waiting=False)

    def renew(files, now):
        # The second one comes while the first is followed.
        if not judged or (len(judged) == 1 and following.is_set()):
            taken.shots[len(judged)] = SimpleNamespace(name=f"{len(judged)}.dng")
        return [], len(taken.shots) > len(judged)

    following = threading.Event()

    def follow(frames, flash, ambient):
        following.set()
        assert fitted.wait(20), "the second photograph waited for it"
        return [f"of {len(flash)}"]

    def judge(shots):
        judged.append(len(shots))
        shoot.flash = shots
        if len(shots) == 2:
            fitted.set()
        return []

    taken.renew = renew
    shoot = SimpleNamespace(
        judge=judge, follow=follow, frames=1, flash=[], roles={"ambient": []}, new=lambda told: told
    )
    screen = SimpleNamespace(renew=lambda: None, warn=said.append, note=said.append)
    _loop(tmp_path, taken, shoot, screen, 1.0, threading.Event())
    assert judged == [1, 2]
    assert said == ["of 1", "of 2"]


def test_a_half_written_photograph_does_not_tell_a_session_from_others(tmp_path):
    """Its contents when the watch began were no later photograph's: in the end the folder was refused as another's."""
    for name, age_s in (("whole.dng", 60), ("half.dng", 0)):
        (tmp_path / name).write_bytes(b"II*\0")
        os.utime(tmp_path / name, (time.time() - age_s,) * 2)
    assert [file.name for file in whole_photographs(tmp_path)] == ["whole.dng"]

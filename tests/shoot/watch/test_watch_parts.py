"""The parts of a watch: what is told once, roles of photographs, the alarm, and folders that cannot be watched."""

import os
import shutil
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from calibrate.calibration import Calibration
from calibrate.detection.balls import Ball
from capture.photographs.kept import Kept, KeptStack
from scene.camera import Camera
from scene.current import file_digest
from scene.errors import CaptureError, SceneError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from scene.spheres import Sphere
from shoot.init.answers import Answers, Asking
from shoot.watch import lights_so_far
from shoot.watch.alarm import Alarm
from shoot.watch.judge import Told
from shoot.watch.lights_so_far import NEWEST, LightsSoFar, joined
from shoot.watch.screen import side_of
from shoot.watch.shots import read_shot, sort_shots
from shoot.watch.watch_folder import whole_photographs

RAW = Path(__file__).parents[3] / "fixtures" / "bumpy" / "raw"


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


def test_a_warning_is_told_once_though_its_numbers_change():
    told = Told()
    names = ["flash_3", "flash_30"]
    assert told.new(["flash_3: lies 1.2 px off"], names) == ["flash_3: lies 1.2 px off"]
    assert told.new(["flash_3: lies 1.4 px off"], names) == []
    assert told.new(["flash_30: lies 1.4 px off"], names) == ["flash_30: lies 1.4 px off"], "another frame"
    assert told.new(["flash_3, flash_30: lie 1.4 px off"], names) != []


def test_a_photograph_is_decoded_once_and_kept_as_it_was_read(shot_of, tmp_path, monkeypatch):
    from capture.photographs.raw import read_raw

    first = shot_of("flash_003.dng", "a.dng")
    assert np.array_equal(first.codes, read_raw(first.path).codes)
    monkeypatch.setattr("capture.photographs.develop.read_raw", None)
    again = shot_of("flash_003.dng", "a.dng")
    assert np.array_equal(again.codes, first.codes)
    assert np.array_equal(again.facts.small, first.facts.small)


def test_kept_pictures_are_read_as_one_array(shot_of):
    shots = [shot_of(f"flash_{i:03d}.dng", f"{i}.dng") for i in range(3)]
    stack, whole = KeptStack([one.codes for one in shots]), np.stack([one.codes for one in shots])
    assert stack.shape == whole.shape
    for key in (1, (1, slice(5, 9)), (slice(1, None), slice(2, 7), slice(None, None, 3)), ([2, 0], slice(0, 4))):
        assert np.array_equal(stack[key], whole[key])
    assert np.array_equal(stack[1:][0], whole[1])


def test_a_frame_without_flash_is_the_ambient_one_or_a_misfire(shot_of, tmp_path):
    """Nothing tells them apart but the name of another that is the ambient frame."""
    lit = [shot_of(f"flash_{i:03d}.dng", f"IMG_{i}.dng") for i in range(4)]
    dark = shot_of("ambient_000.dng", "IMG_9.dng")
    found = sort_shots([*lit, dark], tmp_path / "hot")
    assert [one.name for one in found.flash] == [f"IMG_{i}.dng" for i in range(4)]
    assert found.ambient == [dark]
    assert "taken for the ambient frame" in found.told[dark.digest]
    named = shot_of("ambient_000.dng", "ambient.dng")
    found = sort_shots([*lit, dark, named], tmp_path / "hot")
    assert found.ambient == [named]
    assert "did not fire" in found.told[dark.digest]
    assert dark not in found.flash


def test_half_a_photograph_is_none(tmp_path):
    path = tmp_path / "half.dng"
    data = (RAW / "flash_000.dng").read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(CaptureError, match=r"half.dng: cannot be decoded"):
        read_shot(path, "half", Kept(tmp_path / "kept", "linear", False))
    assert not list((tmp_path / "kept").glob("half*"))


def test_the_alarm_runs_its_command_with_the_warning_as_one_word_and_no_shell(tmp_path):
    program, heard = tmp_path / "hear.py", tmp_path / "heard"
    program.write_text(f"import sys; open({str(heard)!r}, 'a').write(repr(sys.argv[1:]) + '\\n')")
    with Alarm(f"'{sys.executable}' '{program}' first") as alarm:
        alarm.warn("-rf $(touch x); 'a' moved")
        alarm.warn("second")
    said = ["rgbn: -rf $(touch x); 'a' moved", "rgbn: second"]
    assert heard.read_text().splitlines() == [repr(["first", text]) for text in said]


def test_an_alarm_that_fails_is_told_and_ends_nothing(capsys):
    with Alarm("no-such-program-of-ours") as alarm:
        alarm.warn("a")
    assert "--on-warning no-such-program-of-ours: " in capsys.readouterr().err
    with pytest.raises(SceneError, match="--on-warning 'a: cannot be read"):
        Alarm("'a")
    with pytest.raises(SceneError, match="--on-warning: is empty"):
        Alarm(" ")


def test_sides_are_as_the_camera_sees_them():
    assert [side_of(angle) for angle in (0, 90, 180, 270, 359)] == ["right", "above", "left", "below", "right"]


@pytest.mark.parametrize(
    ("made", "words", "told"),
    [
        ([], [], "hot: there is no such folder. Give the folder that the camera's program writes into."),
        (["hot"], [], "is no folder"),
        (["hot/a.dng"], ["--out", "hot/out"], "lies in the folder"),
        (["hot/a.dng", "out/thesis.txt"], ["--out", "out"], "is not empty (thesis.txt)"),
        (["hot/session.toml"], ["--out", "out"], "session.toml: is there already, and a watch would write over it"),
        (["hot/filenames.txt"], ["--out", "out"], "is a session in the DiLiGenT layout already"),
        (["hot/a.txt"], ["--out", "out", "--until-idle", "-1"], "--until-idle -1: expected a number above 0"),
        (["hot/a.txt"], ["--out", "out", "--until-idle", "0.1"], "0 photographs show the flash; a session needs 3"),
        (["hot/a.txt"], ["--out", "out", "--on-warning", "'"], "--on-warning ': cannot be read"),
        (["hot/a.txt"], ["--out", "out", "--chrome", "big"], "--chrome: big: expected millimetres"),
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


def test_a_file_that_never_becomes_a_photograph_is_told_once(run_rgbn, tmp_path, monkeypatch):
    from capture.hot_folder import tracker

    monkeypatch.setattr(tracker, "PATIENCE_S", 1.5)
    monkeypatch.chdir(tmp_path)
    Path("hot").mkdir()
    Path("hot/broken.dng").write_bytes(b"no photograph")
    code, _, err = run_rgbn("watch", "hot", "--out", "out", "--until-idle", "0.2")
    assert code == 2
    assert err.count("warning: broken.dng: has not become a photograph.") == 1
    assert "0 photographs show the flash" in err


def test_lights_of_the_newest_frames_are_joined_to_those_before():
    """The whole, of parts that are relative to their own means; what is gone is left out, what nobody knows is told."""
    rng, names = np.random.default_rng(0), tuple("abcdefgh")
    positions, strength = rng.normal(0, 300, (8, 3)) + [0, 0, 900], rng.uniform(0.5, 2, (8, 3))
    sigma = rng.uniform(0.1, 1, (2, 8))
    flags = tuple((name,) for name in names)

    def part(rows):
        some = np.arange(8)[rows]
        lights = Lights(
            tuple(names[i] for i in some), unit(positions[some]), strength[some], positions[some], np.zeros(3),
            sigma[0, some], sigma[1, some], flags=tuple(flags[i] for i in some),
        )  # fmt: skip
        return Calibration([], lights.normalised(), np.zeros((0, len(some), 2)))

    whole = part(slice(None)).lights
    found = joined(part(slice(0, 6)), part(slice(3, 8)), names).lights
    for field in ("names", "flags", "directions", "intensities", "positions_mm", "direction_sigma_deg"):
        if field in ("names", "flags"):
            assert getattr(found, field) == getattr(whole, field)
        else:
            np.testing.assert_allclose(getattr(found, field), getattr(whole, field), err_msg=field)
    assert joined(part(slice(0, 6)), part(slice(3, 8)), names[1:]).lights.names == names[1:]
    assert joined(part(slice(0, 5)), part(slice(3, 7)), names) is None, "nobody knows h"
    assert joined(part(slice(0, 4)), part(slice(4, 8)), names) is None, "no frame tells the factor between the parts"


def test_all_lights_are_fitted_where_the_newest_lie_in_one_plane_or_a_photograph_was_replaced(monkeypatch):
    """Twenty flashes, the last of them along one arc, as a hand goes."""
    rng, fitted = np.random.default_rng(1), []
    tilt = np.radians(np.linspace(10, 60, 10))
    arc = np.stack([np.sin(tilt), 0 * tilt, np.cos(tilt)], -1)
    directions = np.concatenate([unit(rng.normal(0, 1, (10, 3)) + [0, 0, 3]), arc])
    names = tuple(f"flash_{i:02d}" for i in range(20))
    camera = Camera(4, 3, 5.0, 5.0, 1.5, 1.0)
    frames = Frames(names, np.zeros((20, 3, 4, 3), np.uint16), np.ones(20))

    def by_balls(some, camera, balls):
        fitted.append(len(some))
        rows = [names.index(name) for name in some.names]
        sigma = np.full(len(rows), 0.1)
        lights = Lights(some.names, directions[rows], np.ones((len(rows), 3)), None, np.zeros(3), sigma, sigma)
        lights.check()
        return Calibration([], lights, np.zeros((0, len(rows), 2)), camera=camera)

    monkeypatch.setattr(lights_so_far, "lights_of_balls", by_balls)
    monkeypatch.setattr(LightsSoFar, "camera", lambda *_: camera)
    watched = LightsSoFar(Asking(Answers(), silent=True))
    watched._balls = [Ball(Sphere("chrome", np.ones(2), 1.0), np.eye(3), frames, None)]
    for count, expected in ((10, [10]), (11, [NEWEST]), (20, [20])):
        fitted.clear()
        watched.update(frames.only(slice(0, count)), [], 1)
        assert fitted == expected, count
        assert watched.found.lights.names == names[:count]
        assert not watched.warnings
    fitted.clear()
    watched.update(frames, [], 1)
    assert fitted == [NEWEST, 20], "the newest eight lie in one plane"
    watched.fit_all()
    fitted.clear()
    watched.update(frames, [], 1)
    assert fitted == [20]


def test_a_half_written_photograph_does_not_tell_a_session_from_others(tmp_path):
    """Its contents when the watch began were no later photograph's: in the end the folder was refused as another's."""
    for name, age_s in (("whole.dng", 60), ("half.dng", 0)):
        (tmp_path / name).write_bytes(b"II*\0")
        os.utime(tmp_path / name, (time.time() - age_s,) * 2)
    assert [file.name for file in whole_photographs(tmp_path)] == ["whole.dng"]

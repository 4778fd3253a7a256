"""A folder of photographs to its session.toml, and on."""

import io
import json
import shutil
import sys

import numpy as np
import pytest

from capture.session.manifest import SessionCameraTable
from capture.session.session import load_session
from lab.run import run_session
from scene.errors import SceneError, SessionError
from scene.files import write_png
from scene.normals import angular_error_deg
from scene.store import Store
from shoot.init.answers import Answers
from shoot.init.init_session import init_sessions
from tests.conftest import FIXTURE

SIZES = {"chrome": (100.0,), "white": (90.0,)}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The fixture's files under names that say nothing, without its session.toml."""
    monkeypatch.chdir(tmp_path)
    place = tmp_path / "penguin"
    (place / "DCIM").mkdir(parents=True)
    for n, path in enumerate(sorted((FIXTURE / "raw").iterdir())):
        shutil.copy(path, place / "DCIM" / f"IMG_{4321 + n}.DNG")
        (place / "DCIM" / f"IMG_{4321 + n}.JPG").write_bytes(b"a preview")
    shutil.copytree(FIXTURE / "scan", place / "scan")
    return place


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """Four photographs of noise."""
    monkeypatch.chdir(tmp_path)
    return take_photographs(tmp_path / "my photographs")


def take_photographs(place, name="{}", seed=0):
    """Take four photographs of an object, whose place in the picture the seed tells, in noise."""
    place.mkdir(parents=True, exist_ok=True)
    there = np.zeros((40, 60, 1))
    there[:, 12 * seed : 12 * seed + 12] = 1
    for n in range(4):
        noise = np.random.default_rng(n).uniform(2000, 4000, (40, 60, 3))
        write_png(place / f"{name.format(n)}.png", (noise * (1 + 10 * there)).astype(np.uint16))
    return place


def lay_out(folder):
    return {path.relative_to(folder).as_posix(): path.stat().st_mtime_ns for path in folder.rglob("*")}


def balls(session):
    return sorted((spec.kind, spec.diameter_mm) for spec in session.spheres)


@pytest.mark.full
def test_two_questions_give_the_session_that_was_written_by_hand(folder, monkeypatch, capsys):
    before = lay_out(folder)
    monkeypatch.setattr(sys, "stdin", io.StringIO("100\n90\n"))
    ((draft, _, sheet),) = init_sessions(folder, told=Answers())
    assert capsys.readouterr().err.count("Enter") == 2
    after = lay_out(folder)
    assert after.pop("session.toml")
    assert after == before, "nothing else is touched"
    ours, theirs = load_session(folder), load_session(FIXTURE)
    # By its light alone the ambient frame is told from the others.
    assert [path.stat().st_size for path in ours.flash] == [path.stat().st_size for path in theirs.flash]
    assert [path.read_bytes() for path in ours.ambient] == [path.read_bytes() for path in theirs.ambient]
    assert balls(ours) == balls(theirs)
    assert (ours.scan_unit, ours.camera) == ("mm", None)
    assert sheet.is_file()
    assert any("13 .jpg" in note and "beside a file of the same name" in note for note in draft.notes)
    # What nobody has changed is written anew, with what is known now, and what was said before.
    init_sessions(folder, told=Answers(chrome=(60.0,)), yes=True)
    assert {spec.kind: spec.diameter_mm for spec in load_session(folder).spheres} == {"chrome": 60.0, "white": 90.0}


def test_only_its_own_file_is_written_anew(mine, tmp_path, monkeypatch):
    """And from inside of the folder, `rgbn init .`, its output lies beside it, not among what is read."""
    manifest = mine / "session.toml"
    monkeypatch.chdir(mine)
    said = Answers(focal_mm=50.0, sensor_mm=36.0)
    for answers in (said, Answers()):
        ((_, _, sheet),) = init_sessions(mine, told=answers, yes=True)
        assert load_session(mine).camera == SessionCameraTable(focal_mm=50.0, sensor_mm=36.0), "as it was said before"
    assert sheet == tmp_path / "out" / mine.name / "contact-sheet.png"
    assert sheet.is_file()
    assert sorted(path.name for path in mine.iterdir()) == [*(f"{n}.png" for n in range(4)), "session.toml"]
    # The file is the user's: no output folder's record has it, and it is written anew when its results are gone.
    assert list(json.loads((sheet.parent / ".rgbn" / "record.json").read_text())["files"]) == [sheet.name]
    shutil.rmtree(tmp_path / "out")
    init_sessions(mine, told=said, yes=True)
    written = manifest.read_text()
    manifest.write_text(written.replace("50.0", "51.0", 1))
    with pytest.raises(SessionError, match="is there already"):
        init_sessions(mine, told=Answers(), yes=True)
    # A link leads to a file of another place, whatever that holds.
    (tmp_path / "elsewhere.toml").write_text(written)
    manifest.unlink()
    manifest.symlink_to(tmp_path / "elsewhere.toml")
    with pytest.raises(SessionError, match="is there already"):
        init_sessions(mine, told=Answers(), yes=True)
    assert manifest.is_symlink()


def test_the_command_says_what_to_run_for_each_object(run_rgbn, tmp_path, monkeypatch):
    """Paths with blanks can be pasted; `next` named one object of several."""
    for name in ("a cat", "owl"):
        take_photographs(tmp_path / "all mine" / name)
    monkeypatch.chdir(tmp_path)
    code, told, _ = run_rgbn("init", tmp_path / "all mine", "--yes")
    assert code == 0
    assert [line for line in told.splitlines() if line.startswith("next")] == [
        f"next     rgbn process '{tmp_path}/all mine/{name}'" for name in ("a cat", "owl")
    ]
    code, _, said = run_rgbn("init", tmp_path / "all mine", "--chrome", "100;90")
    assert (code, "100;90: expected millimetres, as in 76" in said) == (2, True)


def test_a_photograph_that_is_called_a_chart_is_the_chart(mine):
    for name, wide in (("Color Checker", 60), ("chart_2", 60), ("chart_0", 30)):
        write_png(mine / f"{name}.png", np.full((40, wide, 3), 3000, np.uint16))
    ((draft, *_),) = init_sessions(mine, told=Answers(), yes=True)
    session = load_session(mine)
    assert session.chart == mine / "chart_2.png"
    assert len(session.flash) == 4
    assert "left out: chart_0.png, Color Checker.png: one photograph" in " ".join(draft.notes)


def test_several_objects_in_one_folder_are_no_session(mine, tmp_path):
    for seed, name in enumerate(("cat_{}", "owl_{}", "rock_{}")):
        take_photographs(tmp_path / "mixed", name, seed)
    with pytest.raises(SessionError, match=r"several objects \(cat 4, owl 4, rock 4\).*a folder of its own"):
        init_sessions(tmp_path / "mixed", told=Answers(), yes=True)
    for name in ("left_{}", "right_{}"):
        take_photographs(tmp_path / "same", name)
    ((draft, *_),) = init_sessions(tmp_path / "same", told=Answers(), yes=True)
    assert len(draft.photographs["flash"]) == 8, "two names of one object"


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["session.toml", "1.dng", "2.dng", "3.dng"], "is there already, and is not written over"),
        (["filenames.txt", "1.png", "2.png", "3.png"], "DiLiGenT layout already. Run: rgbn process"),
        (["1.png", "2.png"], "holds 2 photographs"),
        (["1.png", "2.png", "3.png"], "0 of 3 photographs can be read.\n.*1.png"),
        # The output folder is another's.
        (["../out/hot/thesis.txt"], r"is not empty \(thesis.txt\)"),
    ],
)
def test_what_is_refused(tmp_path, monkeypatch, names, words):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "hot"
    folder.mkdir() if "thesis" not in words else take_photographs(folder)
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    before = lay_out(tmp_path)
    with pytest.raises(SceneError, match=words):
        init_sessions(folder, told=Answers(), yes=True)
    assert lay_out(tmp_path) == before


@pytest.mark.full
@pytest.mark.slow
def test_lights_without_a_word_about_the_camera(folder, tmp_path, monkeypatch):
    """EXIF taken away: the balls tell the focal length; that the principal point is 16 px off the middle stays."""
    monkeypatch.setattr(
        "capture.camera.exif._exif_of_tags", lambda tags: __import__("capture.camera.exif").camera.exif.Exif()
    )
    init_sessions(folder, told=Answers(**SIZES), yes=True)
    run_session(folder, "calibrate", out=tmp_path / "unknown")
    run_session(FIXTURE, "calibrate", out=tmp_path / "known")
    unknown, known = Store(tmp_path / "unknown"), Store(tmp_path / "known")
    camera, true = unknown.load_camera(), known.load_camera()
    assert camera.source == "balls"
    assert abs(np.log(camera.fx / true.fx)) < 3 * camera.focal_sigma < 0.3
    lights, right = unknown.load_lights(), known.load_lights()
    assert lights.model == "near"
    off = angular_error_deg(lights.directions, right.directions)
    assert np.median(off) < np.rad2deg(16 / true.fx) + np.median(lights.direction_sigma_deg)


@pytest.mark.full
@pytest.mark.parametrize("place", ["psdata_pig/LightProbe-2", "uw_psm/png"])
def test_photographs_that_others_took(shared, tmp_path, monkeypatch, place):
    """A room-lit frame among the flashes hid a ball of 487 px and left one of 8; seven objects have a folder each."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(shared(f"real/{place}"), tmp_path / "theirs", ignore=shutil.ignore_patterns("*.txt"))
    made = init_sessions(tmp_path / "theirs", told=Answers(), yes=True)
    if place == "uw_psm/png":
        assert [draft.folder.name for draft, *_ in made] == ["buddha", "cat", "horse", "owl", "rock"]
        assert all(len(load_session(draft.folder).spheres) == 2 for draft, *_ in made)
    else:
        (ball,) = made[0][0].manifest.spheres
        assert (ball.kind, ball.radius_px) == ("chrome", pytest.approx(487, rel=0.03))
        assert any("ref.JPG is brighter" in note for note in made[0][0].notes)


@pytest.mark.full
@pytest.mark.slow
def test_somebody_elses_session_without_its_session_toml(shared, tmp_path, monkeypatch):
    """What init finds is what the session's own file says."""
    source = shared("sessions/bunny")
    monkeypatch.chdir(tmp_path)
    for part in ("raw", "scan"):
        shutil.copytree(source / part, tmp_path / "bunny" / part)
    answers = Answers(chrome=(76.0,), white=(70.0,), focal_mm=50.0, sensor_mm=36.0)
    init_sessions(tmp_path / "bunny", told=answers, yes=True)
    ours = load_session(tmp_path / "bunny")
    assert balls(ours) == balls(load_session(source))
    assert (ours.scan_unit, len(ours.flash), len(ours.ambient)) == ("mm", 12, 1)

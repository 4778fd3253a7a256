"""A folder of photographs to its session.toml, and on."""

import io
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from capture.session.session import load_session
from capture.session.session_types import Lens
from lab.run import run_session
from scene.errors import SceneError, SessionError
from scene.files import write_png
from scene.normals import angular_error_deg
from scene.rooms import ROOT
from scene.store import Store
from shoot.init.answers import Answers
from shoot.init.init_session import init_sessions

DIAMETERS = {"chrome": (100.0,), "white": (90.0,)}
FIXTURE = ROOT / "fixtures" / "bumpy"


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


def take_photographs(folder):
    """Four of noise."""
    for n in range(4):
        write_png(folder / f"{n}.png", np.random.default_rng(n).integers(2000, 60000, (40, 60, 3)).astype(np.uint16))


def lay_out(folder):
    return {path.relative_to(folder).as_posix(): path.stat().st_mtime_ns for path in folder.rglob("*")}


@pytest.mark.full
def test_two_questions_give_the_session_that_was_written_by_hand(folder, monkeypatch, capsys):
    before = lay_out(folder)
    monkeypatch.setattr(sys, "stdin", io.StringIO("100\n90\n"))
    (made,), questions = init_sessions(folder, Answers())
    assert questions == 2
    after = lay_out(folder)
    assert after.pop("session.toml")
    assert after == before, "nothing else is touched"
    ours, theirs = load_session(folder), load_session(FIXTURE)
    # By its light alone the ambient frame is told from the others.
    assert [path.stat().st_size for path in ours.flash] == [path.stat().st_size for path in theirs.flash]
    assert len(ours.ambient) == 1
    assert ours.ambient[0].read_bytes() == theirs.ambient[0].read_bytes()
    assert sorted((s.kind, s.diameter_mm) for s in ours.spheres) == sorted(
        (s.kind, s.diameter_mm) for s in theirs.spheres
    )
    assert (ours.scan_unit, ours.camera) == ("mm", None)
    assert made.sheet.is_file()
    assert any("13 .jpg" in note and "beside a file of the same name" in note for note in made.draft.notes)
    # What nobody has changed is written anew, with what is known now; a person's own words are not.
    init_sessions(folder, Answers({"chrome": (60.0,), "white": (58.0,)}, unit="mm"), silent=True)
    assert {s.diameter_mm for s in load_session(folder).spheres if s.kind == "chrome"} == {60.0}
    text = (folder / "session.toml").read_text()
    (folder / "session.toml").write_text(text.replace("60", "61", 1))
    with pytest.raises(SessionError, match="is there already"):
        init_sessions(folder, Answers(), silent=True)


@pytest.mark.full
@pytest.mark.slow
def test_lights_without_a_word_about_the_camera(folder, tmp_path, monkeypatch):
    """EXIF taken away: the balls tell the focal length; that the principal point is 16 px off the middle stays."""
    monkeypatch.setattr(
        "capture.camera.exif._exif_of_tags", lambda tags: __import__("capture.camera.exif").camera.exif.Exif()
    )
    answers = Answers(DIAMETERS)
    init_sessions(folder, answers, silent=True)
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
def test_a_tape_tells_the_focal_length(folder):
    """radius_px = fx radius_mm / distance, to the ball's own depth."""
    truth = Store(FIXTURE).read_json("truth.json")
    distance = -float(np.mean([ball["centre_mm"][2] for ball in truth["spheres"]]))
    answers = Answers(DIAMETERS, distance_mm=distance)
    init_sessions(folder, answers, silent=True)
    lens = load_session(folder).camera
    assert isinstance(lens, Lens)
    assert lens.fx == pytest.approx(truth["fx"], rel=0.03)


def test_from_inside_the_folder_the_sheet_lies_beside_it(tmp_path, monkeypatch):
    """`rgbn init .`: session.toml was written, and then its output refused, since it lay among what is read."""
    folder = tmp_path / "mine"
    folder.mkdir()
    take_photographs(folder)
    monkeypatch.chdir(folder)
    (made,), _ = init_sessions(Path("."), Answers(), silent=True)
    assert made.sheet == tmp_path / "out" / "mine" / "contact-sheet.png"
    assert made.sheet.is_file()
    assert sorted(path.name for path in folder.iterdir()) == [*(f"{n}.png" for n in range(4)), "session.toml"]


def test_only_its_own_file_is_written_anew(tmp_path, monkeypatch):
    folder, manifest = tmp_path / "mine", tmp_path / "mine" / "session.toml"
    folder.mkdir()
    take_photographs(folder)
    monkeypatch.chdir(tmp_path)
    init_sessions(folder, Answers(), silent=True)
    written = manifest.read_text()
    init_sessions(folder, Answers(), silent=True)
    assert manifest.read_text() == written
    manifest.write_text(written.replace("mine", "cup", 1))
    with pytest.raises(SessionError, match="is there already"):
        init_sessions(folder, Answers(), silent=True)
    # A link leads to a file of another place, whatever that holds.
    (tmp_path / "elsewhere.toml").write_text(written)
    manifest.unlink()
    manifest.symlink_to(tmp_path / "elsewhere.toml")
    with pytest.raises(SessionError, match="is there already"):
        init_sessions(folder, Answers(), silent=True)
    assert manifest.is_symlink()


def test_nothing_is_written_where_the_output_is_anothers(tmp_path, monkeypatch):
    folder, other = tmp_path / "mine", tmp_path / "out" / "mine"
    folder.mkdir()
    other.mkdir(parents=True)
    (other / "thesis.txt").write_text("years of work")
    take_photographs(folder)
    before = lay_out(tmp_path)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SceneError, match=r"is not empty \(thesis.txt\)"):
        init_sessions(folder, Answers(), silent=True)
    assert lay_out(tmp_path) == before


@pytest.mark.parametrize(
    ("words", "cure"),
    [
        (["--chrome", "100;90"], "--chrome 100;90: expected millimetres, as in 76"),
        (["--white", "0"], "expected millimetres from 0.1"),
        (["--sensor-mm", "36", "--pixel-um", "4"], "--sensor-mm, --pixel-um: each tells the size of the sensor"),
        (["--focal-mm", "-5"], "--focal-mm -5: expected a length above 0"),
        (["--focal-mm", "50", "--distance-mm", "900"], "each tells the focal length"),
    ],
)
def test_answers_that_cannot_be_meant(run_rgbn, tmp_path, words, cure):
    code, _, said = run_rgbn("init", tmp_path, *words)
    assert code == 2
    assert cure in said


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["session.toml", "1.dng", "2.dng", "3.dng"], "is there already, and is not written over"),
        (["filenames.txt", "1.png", "2.png", "3.png"], "DiLiGenT layout already. Run: rgbn process"),
        (["1.png", "2.png"], "holds 2 photographs"),
        (["1.png", "2.png", "3.png"], "0 of 3 photographs can be read.\n.*1.png"),
    ],
)
def test_what_is_refused(tmp_path, names, words):
    for name in names:
        (tmp_path / name).write_bytes(b"")
    before = lay_out(tmp_path)
    with pytest.raises(SessionError, match=words):
        init_sessions(tmp_path, Answers(), silent=True)
    assert lay_out(tmp_path) == before


@pytest.mark.full
@pytest.mark.slow
def test_somebody_elses_session_without_its_session_toml(tmp_path, monkeypatch):
    """What init finds is what the session's own file says."""
    source = ROOT / ".." / "shared" / "sessions" / "bunny"
    if not source.is_dir():
        pytest.skip("../shared/sessions/bunny is absent")
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "bunny"
    for part in ("raw", "scan"):
        shutil.copytree(source / part, folder / part)
    answers = Answers({"chrome": (76.0,), "white": (70.0,)}, lens=Lens(focal_mm=50.0, sensor_mm=36.0))
    init_sessions(folder, answers, silent=True)
    ours, theirs = load_session(folder), load_session(source)
    assert sorted((b.kind, b.diameter_mm) for b in ours.spheres) == sorted(
        (b.kind, b.diameter_mm) for b in theirs.spheres
    )
    assert (ours.scan_unit, len(ours.flash), len(ours.ambient)) == ("mm", 12, 1)

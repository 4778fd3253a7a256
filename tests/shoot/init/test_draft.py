"""What init asks, assumes and writes, without a photograph."""

import io
import sys
from dataclasses import replace

import numpy as np
import pytest

from capture.session.manifest import FramesTable, Manifest, SessionCameraTable, SphereTable
from capture.session.session import load_session
from capture.survey.folder_files import pattern_of
from scene.errors import SessionError
from scene.files import write_png
from scene.frames import Frames
from shoot.init.answers import Answers, Asking
from shoot.init.draft import Draft, is_unedited, notes_of, session_text, signed, unit_by_size
from shoot.init.init_session import contact_sheet


def asking(monkeypatch, text, answers=None, **more):
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    return Asking(answers or Answers(), **more)


def test_each_question_is_asked_once_until_its_answer_can_be_read(monkeypatch, capsys):
    asked = asking(monkeypatch, "about 3 inch\n-5\n76\n70, 50 mm\n0.2\n50\n36\n")
    for _ in ("one object", "another"):
        assert asked.diameters("chrome", [(1.0, 2.0), (3.0, 4.0)], 2) == (76.0, 76.0)
        assert asked.diameters("white", [], 2) == (70.0, 50.0)
        assert asked.camera(is_known=False) == {"focal_mm": 50.0, "sensor_mm": 36.0}
    told = capsys.readouterr().err
    assert told.count("expected") == 3
    assert "2 chrome balls at (1, 2), (3, 4) px; where they differ" in told
    with pytest.raises(SessionError, match="--white 70 50: 2 diameters, but 3 white balls"):
        asked.diameters("white", [], 3)
    # A focal length without the sensor's width tells nothing, of the first object and of the next.
    asked = asking(monkeypatch, "50\n\n")
    assert [asked.camera(is_known=False) for _ in ("one object", "another")] == [{}, {}]


@pytest.mark.parametrize("said", [(50.0, 40.0), (40.0,), ()])
def test_what_an_earlier_file_says_of_the_balls_holds_for_as_many(monkeypatch, said):
    balls = [{"kind": "chrome", "diameter_mm": mm} for mm in said]
    earlier = Answers.said_in(Manifest.model_validate({"frames": {"flash": "*.png"}, "spheres": balls}))
    assert earlier.chrome == said
    asked = asking(monkeypatch, "", silent=True, earlier=earlier)
    assert asked.diameters("chrome", [], 2) == {2: said, 1: 2 * said, 0: (None, None)}[len(said)]
    asked = asking(monkeypatch, "30\n", earlier=earlier)
    assert asked.diameters("chrome", [], 3) == (3 * said if len(said) == 1 else (30.0,) * 3), "of others it is asked"


@pytest.mark.parametrize(
    ("diagonal", "size", "unit"),
    [(450, 387, "mm"), (45, 387, "cm"), (0.45, 387, "m"), (17.7, 387, "inch"), (450, None, None), (35, 500, None)],
)
def test_the_objects_size_tells_the_scans_unit(diagonal, size, unit):
    """35 for 500 mm may be centimetres or inches: then none is told."""
    assert unit_by_size(diagonal, size) == unit


def ball(kind, u, v, radius, diameter=None):
    return SphereTable(kind=kind, center_px=[u, v], radius_px=radius, diameter_mm=diameter)


CHROME, SECOND, WHITE = ball("chrome", 100.0, 50.0, 38.0, 76.0), ball("chrome", 30.0, 90.0, 38.0, 76.0), \
    ball("white", 200.0, 90.5, 35.0, 70.0)  # fmt: skip


@pytest.fixture
def draft(tmp_path):
    """Balls of 1 mm a pixel; the object is 38 px large, of which 45 mm were scanned."""
    for name in ("flash_1", "flash_2", "flash_3", "ambient", "board_1", "board_2", "mask"):
        write_png(tmp_path / f"{name}.png", np.full((4, 6), 9, np.uint8))
    (tmp_path / "s.ply").write_bytes(b"")
    frames = Frames.from_linear(("a", "b", "c"), np.random.default_rng(0).uniform(0, 1, (3, 60, 90, 3)))
    manifest = Manifest(
        frames=FramesTable(flash=["flash_*.png"], ambient=["ambient.png"], linear=True), spheres=[CHROME, SECOND, WHITE]
    )
    known = Draft(manifest, tmp_path, 270, 180, frames, 3, notes=("left out: x.",))
    return measured(known.saying("object", mask="mask.png", scan="s.ply"))


def measured(draft, **answers):
    return draft.with_unit(np.array([[0, 0, 0], [36, 24, 12]]), 38.0, Asking(Answers(**answers)))


def loaded(draft):
    (draft.folder / "session.toml").write_text(session_text(draft))
    return load_session(draft.folder)


def test_what_was_found_is_what_the_session_says(draft):
    session = loaded(draft)
    assert [path.name for path in session.flash] == ["flash_1.png", "flash_2.png", "flash_3.png"]
    assert [path.name for path in session.ambient] == ["ambient.png"]
    assert (session.name, session.encoding, session.scan_unit) == (draft.folder.name, "linear", "mm")
    assert (session.mask.name, session.scan.name, session.camera) == ("mask.png", "s.ply", None)
    balls = [(spec.kind, spec.diameter_mm) for spec in session.spheres]
    assert balls == [("chrome", 76), ("chrome", 76), ("white", 70)]
    text = (draft.folder / "session.toml").read_text()
    assert "# - camera: not known: no EXIF" in text, "what is assumed stands in the file"
    assert "# - left out: x." in text
    assert is_unedited(signed(text))
    assert not is_unedited(signed(text).replace("76", "77"))


@pytest.mark.parametrize(
    ("balls", "with_circle"),
    [
        ([CHROME, SECOND, WHITE], []),
        ([CHROME, SECOND.model_copy(update={"diameter_mm": 60.0}), WHITE], ["chrome", "chrome"]),
    ],
    ids=["as found", "two diameters"],
)
def test_circles_are_written_where_it_is_known_which_ball_has_which_diameter(draft, balls, with_circle):
    written = draft.with_balls(balls).written.spheres
    assert [one.kind for one in written if one.center_px] == with_circle
    assert [one.diameter_mm for one in written] == [one.diameter_mm for one in balls]


@pytest.mark.parametrize(
    ("lacking", "said"),
    [
        (lambda one: one.with_balls([]), "no ball and no light file"),
        (lambda one: one.with_balls([]).saying("object", normals="n.npy"), "no ball and no light file"),
        (lambda one: one.with_balls([WHITE]), "no chrome ball; so lights have no positions"),
        (lambda one: one.with_balls([CHROME, ball("white", 9.0, 9.0, 5.0)]), "diameter of the white ball is not known"),
        (lambda one: one.saying("frames", ambient=None), "no ambient frame"),
        (lambda one: one.saying("frames", linear=False), "sRGB-encoded"),
        (lambda one: one.saying("object", scan=None), "no ground truth, no twin"),
        (lambda one: measured(one.with_balls([]).saying("lights", file="a.lp")), "unit is not known"),
        (lambda one: measured(one, unit="m"), "unit m, but the object looks 38 mm large"),
        (lambda one: one.saying("lights", file="a.lp"), "lights are read from a.lp"),
    ],
)
def test_what_is_missing_is_said_until_it_is_there(draft, lacking, said):
    assert (list(notes_of(draft)), draft.manifest.object.scan_unit) == (["left out: x."], "mm")
    found = list(notes_of(lacking(draft)))
    assert any(said in note for note in found)
    assert "left out: x." in found


@pytest.mark.parametrize(
    "lens", [{"focal_mm": 50.0, "sensor_mm": 36.0}, {"fx": 700.5}, {"focal_mm": 35.0, "model": "Nikon D700"}]
)
def test_the_camera_that_was_told(draft, lens):
    assert loaded(draft.saying("camera", **lens)).camera == SessionCameraTable(**lens)
    with pytest.raises(SessionError, match="without the size of the sensor"):
        session_text(draft.saying("camera", focal_mm=50.0))
    # In the words of session.toml's reader.
    with pytest.raises(SessionError, match=r"camera\.focal_mm: found 0\.5; expected 1 to 3000: millimetres"):
        draft.saying("camera", focal_mm=0.5)


def test_names_that_are_no_globs(tmp_path, draft):
    folder = tmp_path / 'a "quoted" [1]: x'
    folder.mkdir()
    names = [folder / f"f[{n}]*.png" for n in range(3)]
    for path in (*names, folder / "s[1].ply"):
        path.write_bytes(b"")
    there = replace(draft, folder=folder).saying("object", mask=None, scan="s[1].ply")
    there = there.saying("frames", flash=pattern_of(names, folder), ambient=None)
    session = loaded(there.noting("odd \x07 \udcff\nname"))
    assert list(session.flash) == names
    assert session.scan == folder / "s[1].ply"
    assert session.name == folder.name


@pytest.mark.parametrize("count", [3, 13, 40])
def test_the_sheet_shows_every_ball_where_it_is(draft, count):
    """Each circle's colour stands on its outline, and nowhere without the ball; as wide for any number of frames."""
    small = draft.small
    names, codes = tuple(f"f{i}" for i in range(count)), np.repeat(small.codes[:1], count, axis=0)
    draft = replace(draft, small=replace(small, names=names, codes=codes, gain=np.ones(count)))
    sheet, without = (contact_sheet(draft.with_balls(balls)).astype(int) for balls in ([CHROME, WHITE], []))
    assert sheet.shape == without.shape
    scale = sheet.shape[1] / draft.width
    for one, other in ((CHROME, WHITE), (WHITE, CHROME)):
        some = contact_sheet(draft.with_balls([other])).astype(int)
        for angle in np.linspace(0.3, 2.8, 9):
            u, v = scale * (np.array(one.center_px) + one.radius_px * np.array([np.cos(angle), np.sin(angle)]))
            assert np.abs(sheet[round(v), round(u)] - some[round(v), round(u)]).sum() > 60

"""What init asks, assumes and writes, without a photograph."""

import io
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from capture.session.session import load_session
from capture.session.session_types import Board, Lens
from capture.survey.board_layout import Layout
from scene.camera import Camera
from scene.errors import SessionError
from scene.frames import Frames
from shoot.init.answers import Answers, Asking
from shoot.init.contact_sheet import contact_sheet
from shoot.init.draft import Draft, DraftBall
from shoot.init.draft_notes import notes_of
from shoot.init.scan_unit import ScanSize, unit_by_size
from shoot.init.session_text import session_text


def asking(monkeypatch, text, answers=None):
    monkeypatch.setattr(sys, "stdin", io.StringIO(text))
    return Asking(answers or Answers())


def test_what_is_asked_once_holds_for_all_objects(monkeypatch, capsys):
    asked = asking(monkeypatch, "76\n70, 50 mm\ncm\n")
    assert asked.diameters("chrome", [(1.0, 2.0), (3.0, 4.0)], 2) == (76.0, 76.0)
    assert asked.diameters("white", [], 2) == (70.0, 50.0)
    assert asked.unit("a.ply", None) == "cm"
    assert asked.diameters("chrome", [], 1) == (76.0,)
    assert asked.unit("b.ply", None) == "cm"
    assert asked.count == 3
    assert "2 chrome balls at (1, 2), (3, 4) px; where they differ" in capsys.readouterr().err


def test_nonsense_is_asked_again_and_silence_is_no_answer(monkeypatch, capsys):
    asked = asking(monkeypatch, "about 3 inch\n-5\n3\n\n")
    assert asked.diameters("chrome", [], 1) == (3.0,)
    assert capsys.readouterr().err.count("expected millimetres") == 2
    assert asked.diameters("white", [], 1) == ()
    # The end of input: nobody is there, and nothing more is asked.
    assert asked.unit("a.ply", None) == "unknown"
    assert asked.is_linear("a.png") is False
    assert asked.count == 3


def test_what_is_known_is_not_asked(monkeypatch):
    given = Answers({"chrome": (76.0,), "white": (70.0,)}, "inch", linear=True)
    asked = asking(monkeypatch, "", given)
    assert asked.diameters("chrome", [], 3) == (76.0,) * 3
    assert asked.unit("a.ply", "mm") == "inch", "what the user says counts"
    assert asked.is_linear("a.png")
    assert Asking(Answers(), silent=True).unit("a.ply", "cm") == "cm", "what the picture tells is not asked"
    assert asked.count == 0
    with pytest.raises(SessionError, match="--chrome 76 50: 2 diameters, but 3 chrome balls"):
        asking(monkeypatch, "", Answers({"chrome": (76.0, 50.0)})).diameters("chrome", [], 3)


@pytest.mark.parametrize(
    ("diagonal", "size", "unit"),
    [
        (450, 387, "mm"),
        (45, 387, "cm"),
        (0.45, 387, "m"),
        (17.7, 387, "inch"),
        (450, None, None),
        (35, 500, None),
        (4, 387, None),
    ],
)
def test_the_objects_size_tells_the_scans_unit(diagonal, size, unit):
    """35 for 500 mm may be centimetres or inches, and 4 is nothing: then a person is asked."""
    assert unit_by_size(diagonal, size) == unit


@pytest.fixture
def draft(tmp_path):
    names = [
        "flash_1.png",
        "flash_2.png",
        "flash_3.png",
        "ambient.png",
        "board_1.png",
        "board_2.png",
        "mask.png",
        "s.ply",
    ]
    for name in names:
        (tmp_path / name).write_bytes(b"")
    paths = [tmp_path / name for name in names]
    frames = Frames.from_linear(("a", "b", "c"), np.random.default_rng(0).uniform(0, 1, (3, 60, 90, 3)))
    balls = (
        DraftBall("chrome", (100.0, 50.0), 30.0, 76.0),
        DraftBall("white", (200.0, 90.5), 20.25, None, by_hand=True),
    )
    return Draft(
        tmp_path, {"flash": paths[:3], "ambient": paths[3:4]}, 270, 180, frames, 3, linear=False, balls=balls,
        mask=paths[6], scan=paths[7], unit="cm", scan_size=ScanSize(3, (30.0, 20.0, 10.0)), notes=("left out: x.",),
    )  # fmt: skip


def loaded(draft):
    (draft.folder / "session.toml").write_text(session_text(draft))
    return load_session(draft.folder)


def test_what_was_found_is_what_the_session_says(draft):
    session = loaded(draft)
    assert [path.name for path in session.flash] == ["flash_1.png", "flash_2.png", "flash_3.png"]
    assert [path.name for path in session.ambient] == ["ambient.png"]
    assert (session.name, session.encoding, session.scan_unit) == (draft.folder.name, "srgb", "cm")
    assert (session.mask, session.scan, session.camera) == (draft.mask, draft.scan, None)
    chrome, white = session.spheres
    # A circle that was found is found again; one that a person placed is believed.
    assert (chrome.kind, chrome.diameter_mm, chrome.center_px) == ("chrome", 76.0, None)
    assert (white.kind, white.diameter_mm, white.center_px, white.radius_px) == ("white", None, (200.0, 90.5), 20.2)


@pytest.mark.parametrize(
    ("lacking", "said"),
    [
        ({"balls": ()}, "no ball and no light file"),
        ({"balls": (DraftBall("white", (9.0, 9.0), 5.0, 70.0),)}, "no chrome ball; so lights have no positions"),
        ({"photographs": {"flash": [Path("a.png")]}}, "no ambient frame"),
        ({"linear": False}, "sRGB-encoded"),
        ({"scan": None}, "no ground truth, no twin"),
        ({"unit": "unknown"}, "unit is not known"),
        ({"unit": "m"}, "36000 x 24000 x 12000 mm with unit m, but the object looks 38 mm large"),
        ({"lights": Path("a.lp")}, "lights are read from a.lp"),
    ],
)
def test_what_is_missing_is_said_until_it_is_there(draft, lacking, said):
    """The balls are 1 mm a pixel: the object of 38 px, of which 45 mm were scanned."""
    pairs = [DraftBall("chrome", (100.0, 50.0), 38.0, 76.0), DraftBall("white", (200.0, 90.5), 35.0, 70.0)]
    whole = replace(
        draft, balls=tuple(pairs), linear=True, unit="mm", across_px=38.0, scan_size=ScanSize(3, (36.0, 24.0, 12.0))
    )
    assert notes_of(whole) == ("left out: x.",)
    first, *others = notes_of(replace(whole, **lacking))
    assert said in first
    assert others == ["left out: x."]


def test_a_ball_where_no_lab_has_it(draft):
    """10 cm given as 10 mm: an eighth of a metre from the camera."""
    camera = Camera(900, 600, 1200.0, 1200.0, 449.5, 299.5)

    def doubts(camera, radius_px, *diameters_mm):
        balls = tuple(DraftBall("chrome", (100.0, 100.0), radius_px, mm) for mm in diameters_mm)
        return [note for note in notes_of(replace(draft, camera=camera, balls=balls)) if "from the camera" in note]

    (note,) = doubts(camera, 48.0, 100.0, 10.0, 76.0)
    assert note.startswith("a chrome ball of 10 mm would stand 0.12 m from the camera")
    assert doubts(camera, 48.0, 100.0) == []
    # In a picture of half the size, the same ball by the same camera.
    assert doubts(camera.scaled(450, 300, 0.5, 0.5), 24.0, 100.0, 10.0, 76.0) == [note]


@pytest.mark.parametrize(
    "lens", [Lens(focal_mm=50.0, sensor_mm=36.0), Lens(fx=700.5), Lens(focal_mm=35.0, model="Nikon D700")]
)
def test_the_camera_that_was_told(draft, lens):
    assert loaded(replace(draft, lens=lens)).camera == lens


def test_a_board_that_was_seen(draft):
    shots = [draft.folder / "board_1.png", draft.folder / "board_2.png"]
    photographs = {**draft.photographs, "board": shots}
    seen = replace(draft, photographs=photographs, board=Layout((11, 8), "DICT_4X4_1000", 0.7))
    assert loaded(seen).camera == Board(tuple(shots), (11, 8), 20.0, 14.0, "DICT_4X4_1000")
    assert loaded(replace(seen, board=Layout((9, 6)))).camera == Board(tuple(shots), (9, 6), 20.0)


def test_names_that_are_no_globs(tmp_path, draft):
    folder = tmp_path / 'a "quoted" [1]'
    folder.mkdir()
    names = [folder / f"f[{n}]*.png" for n in range(3)]
    for path in (*names, folder / "s[1].ply"):
        path.write_bytes(b"")
    session = loaded(replace(draft, folder=folder, photographs={"flash": names}, mask=None, scan=folder / "s[1].ply"))
    assert list(session.flash) == names
    assert session.scan == folder / "s[1].ply"
    assert session.name == folder.name


@pytest.mark.parametrize("count", [3, 12, 13, 17, 18, 40])
def test_the_sheet_is_as_wide_for_any_number_of_frames(draft, count):
    """Of 13 to 17 all were shown, more than a row of the sheet holds, and `init` ended with an error of ours."""
    small = draft.small
    names, codes = tuple(f"f{i}" for i in range(count)), np.repeat(small.codes[:1], count, axis=0)
    many = replace(draft, small=replace(small, names=names, codes=codes, gain=np.ones(count)))
    assert contact_sheet(many).shape[1] == contact_sheet(draft).shape[1]


def test_the_sheet_shows_every_ball_where_it_is(draft):
    """Each circle's colour stands on its outline, and nowhere without the ball."""
    sheet, without = (contact_sheet(replace(draft, balls=balls)).astype(int) for balls in (draft.balls, ()))
    assert sheet.shape == without.shape
    scale = sheet.shape[1] / draft.width
    for ball, others in ((draft.balls[0], draft.balls[1:]), (draft.balls[1], draft.balls[:1])):
        some = contact_sheet(replace(draft, balls=others)).astype(int)
        for angle in np.linspace(0.3, 2.8, 9):
            u, v = scale * (np.array(ball.center_px) + ball.radius_px * np.array([np.cos(angle), np.sin(angle)]))
            row, column = round(v), round(u)
            if row < scale * draft.height:
                assert np.abs(sheet[row, column] - some[row, column]).sum() > 60

"""What a person puts right of a capture, and what is written of it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from capture.session.session_types import Lens
from capture.survey.small_pictures import Small
from scene.errors import SceneError
from scene.frames import encode
from shoot.init.draft import DraftBall
from shoot.init.draft_notes import notes_of
from studio.new_session.edited_capture import EditedCapture, as_found
from studio.photograph.outlines import added, moved, of_kind, removed, resized
from studio.photograph.plane import Plane

SIZE = Plane(80, 60)


def written(capture, outlines):
    """Return the balls as session.toml gives them: kind, circle or None, diameter."""
    balls = capture.described(outlines).balls
    return [
        (ball.kind, (*ball.center_px, ball.radius_px) if ball.by_hand else None, ball.diameter_mm) for ball in balls
    ]


def test_a_circle_is_written_where_a_hand_has_placed_it_and_nowhere_else(found):
    capture, balls = EditedCapture.of(found), as_found(found)
    assert written(capture, balls) == [("chrome", None, None), ("chrome", None, None), ("white", None, None)]
    nudged = moved(balls, 0, (22.0, 16.0), SIZE)
    assert written(capture, nudged)[0] == ("chrome", (22.0, 16.0, 8.0), None)
    assert [circle for _, circle, _ in written(capture, nudged)[1:]] == [None, None]
    larger = resized(balls, 2, 9.0, SIZE)
    assert [circle for _, circle, _ in written(capture, larger)] == [None, None, (20.0, 45.0, 9.0)]
    more = added(balls, "white", (40.0, 30.0), SIZE)
    assert [circle for _, circle, _ in written(capture, more)] == [None, None, None, (40.0, 30.0, 7.5)]


@pytest.mark.parametrize(
    ("edit", "kinds"),
    [
        (lambda balls: removed(balls, 0), ["chrome"]),
        (lambda balls: removed(balls, 2), []),
        (lambda balls: moved(balls, 1, (40.0, 30.0), SIZE), ["chrome", "chrome"]),
        (lambda balls: of_kind(balls, 1, "white"), ["chrome", "white"]),
        (lambda balls: removed(added(balls, "white", (40.0, 30.0), SIZE), 2), ["white"]),
    ],
    ids=["removed", "the only one removed", "moved away", "turned", "another in its place"],
)
def test_what_was_given_up_is_not_found_again_in_place_of_a_kept_one(found, edit, kinds):
    """As many of a kind are looked for as are listed: the others of the kind that lost one get their circles."""
    rows = written(EditedCapture.of(found), edit(as_found(found)))
    assert [kind for kind, circle, _ in rows if circle] == kinds


def test_a_diameter_stays_with_its_ball(found):
    capture = replace(EditedCapture.of(found), diameters_mm={"chrome": 76.0, "white": 50.0})
    balls = as_found(found)
    assert written(capture, balls) == [("chrome", None, 76.0), ("chrome", None, 76.0), ("white", None, 50.0)]
    own = (balls[0], replace(balls[1], diameter_mm=60.0), balls[2])
    assert written(capture, own) == [
        ("chrome", (20.0, 15.0, 8.0), 76.0), ("chrome", (60.0, 15.0, 7.5), 60.0), ("white", None, 50.0)
    ]  # fmt: skip


def test_the_scans_unit_is_told_by_the_balls_or_by_a_person(found):
    """The object is 30 px across and a ball of 16 px is 40 mm: 75 mm, as the scan's 70.7 units are in millimetres."""
    capture, balls = EditedCapture.of(found), as_found(found)
    assert capture.described(balls).unit == "unknown"
    sized = replace(capture, diameters_mm={"chrome": 40.0})
    assert (sized.described(balls).unit, sized.draft.unit) == ("mm", "unknown")
    assert "77 mm large" in sized.described(balls).unit_told
    said = replace(sized, unit="cm")
    assert said.described(balls).unit == "cm"
    assert any("as with unit mm" in note for note in notes_of(said.described(balls)))
    assert not any("as with unit" in note for note in notes_of(replace(sized, unit="mm").described(balls)))


def test_notes_are_of_the_capture_as_it_is_now(found):
    capture, balls = EditedCapture.of(found), as_found(found)
    notes = notes_of(capture.described(balls))
    assert sum("diameter of the chrome balls" in note for note in notes) == 1
    assert not any("--chrome" in note for note in notes), "nobody stands at a command line"
    known = replace(capture, diameters_mm={"chrome": 40.0, "white": 40.0}).described(balls)
    assert notes_of(known) == ("left out: x.",)
    assert any("no ball and no light file" in note for note in notes_of(capture.described(())))


def test_a_photograph_gets_another_use_where_it_can_have_it(found, folder):
    capture = EditedCapture.of(found)
    flash = folder / "flash_3.png"
    without = capture.with_role(flash, "not used")
    assert without.role_of(flash) == "not used"
    assert flash not in without.draft.photographs["flash"]
    assert without.with_role(flash, "flash").draft.photographs == capture.draft.photographs
    assert "ambient" not in capture.with_role(folder / "ambient_0.png", "dark").draft.photographs
    with pytest.raises(SceneError, match="40 x 30 px"):
        capture.with_role(folder / "odd.png", "dark")
    fewer = without.with_role(folder / "flash_0.png", "not used")
    with pytest.raises(SceneError, match="3 flash frames are the fewest"):
        fewer.with_role(folder / "flash_1.png", "not used")


def test_a_ball_that_was_shot_apart_keeps_its_lights(found, folder):
    """One photograph a flash frame: with a frame, the ball's photograph of the same light is left out."""
    own = tuple(folder / f"ball_{n}.png" for n in range(5))
    capture = EditedCapture.of(replace(found, draft=replace(found.draft, balls=(DraftBall("chrome", files=own),))))
    without = capture.with_role(folder / "flash_1.png", "not used")
    (ball,) = without.described(()).balls
    assert ball.files == (own[0], *own[2:])
    with pytest.raises(SceneError, match="no photograph of its light"):
        without.with_role(folder / "flash_1.png", "flash")


def test_half_a_lens_is_said_to_be_half(found):
    capture = EditedCapture.of(found).with_lens(focal_mm=50.0)
    assert "not known yet" in capture.draft.camera_told
    whole = capture.with_lens(sensor_mm=36.0)
    assert whole.draft.lens == Lens(focal_mm=50.0, sensor_mm=36.0)
    assert whole.draft.camera.fx == pytest.approx(50 / 36 * 80, rel=0.06)
    assert EditedCapture.of(found).draft.assumed_camera.width == 80, "one as most are"


@pytest.mark.full
def test_three_shots_of_a_board_are_the_camera(found, folder):
    """Fewer are kept and said to be too few; a photograph that does not show the same board is none of them."""
    squares = np.kron(np.indices((6, 9)).sum(0) % 2, np.ones((20, 20)))
    shots = {}
    for index in range(4):
        turn = cv2.getRotationMatrix2D((90.0, 60.0), 4.0 * index, 1.0) + [[0, 0, 30], [0, 0, 30]]
        picture = cv2.warpAffine(squares, turn, (240, 180), borderValue=1.0) if index < 3 else np.full((180, 240), 0.5)
        path = folder / f"shot_{index}.png"
        codes = encode(np.repeat(0.1 + 0.8 * picture[..., None], 3, -1).astype(np.float32))
        shots[path] = Small(path, codes, 240, 180, 1, False)
    capture = EditedCapture.of(replace(found, small=found.small | shots))
    first, second, third, blank = shots
    two = capture.with_role(first, "board").with_role(second, "board")
    assert two.draft.board is None
    assert any("2 photographs of a board are not used" in note for note in notes_of(two.described(())))
    three = two.with_role(third, "board")
    assert three.draft.board.squares == (9, 6)
    assert three.draft.camera_told.startswith("3 shots of a chessboard")
    assert not any("board" in note for note in notes_of(three.described(())))
    with pytest.raises(SceneError, match="is not seen in it"):
        three.with_role(blank, "board")
    assert three.with_role(first, "not used").draft.board is None


def test_how_values_are_coded_is_said_as_it_is_now(found):
    capture = EditedCapture.of(found).with_draft(linear=False)
    assert sum("sRGB" in note for note in notes_of(capture.described(()))) == 1
    assert not any("sRGB" in note for note in notes_of(capture.with_draft(linear=True).described(())))

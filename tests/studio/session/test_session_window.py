"""A session's window without a browser: what is clicked, missing and run, and a shoot under way."""

import json
import time
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from capture.session.session import load_session
from scene.errors import SceneError
from scene.files import write_png
from scene.output_folder import open_record
from shoot.watch.watch_folder import MAP, STATUS, state_lines
from studio import window as windows
from studio.session import photograph_view
from studio.session.ball_edits import moved
from studio.session.photograph_view import PhotographView
from studio.session.plane import ROOT
from studio.session.session_rows import SESSION_ROWS, TABS
from studio.session.session_window import SessionWindow
from studio.session.spatial_view import SpatialView
from studio.studio_state import StudioState
from studio.widgets import plain
from studio.workspace import Workspace
from tests.conftest import until
from tests.studio.session.conftest import note_steps


@pytest.fixture
def reviewing(made, nobody, furnish):
    """Return what makes the window of a review of the folder that was made."""

    def furnished(*views, state=None, number=1):
        state = state or StudioState(area="Session", session=(made.folder, made.session))
        return furnish(SessionWindow(nobody(number), Workspace.at(made.folder.parent), state), SESSION_ROWS, *views)

    return furnished


def texts(window):
    """Return what the panels say."""
    return "\n".join(window.client.shown())


def folder_of(window, label):
    """Return the folder whose label begins so."""
    handles = window.client.gui._container_handle_from_uuid.values()
    return next(one for one in handles if (getattr(one, "label", None) or "").startswith(label))


def test_what_is_missing_breaks_no_tab(reviewing, made):
    """A ball is clicked without a camera to draw its knobs by, the twin is asked for where there is no frame."""
    for gone in ("camera.json", "lights.json", "frames/frames.json", "spheres.json"):
        (made.folder / gone).unlink()
        window = reviewing(PhotographView, SpatialView)
        for name in TABS:
            window.open_tab(name)
        window.choose(ball=1)
        assert not window.client.told


def test_the_warnings_are_counted_as_the_folder_is_now(reviewing, made):
    window = reviewing()
    window.open_tab("Verdict")
    folder = folder_of(window, "Warnings")
    assert folder.label == "Warnings (1)"
    with open_record(made.folder) as record, record.making("solve", "by the test") as entry:
        entry["warnings"] = ["<img src=x> is *bright*"]
    window.read_again()
    assert folder.label == "Warnings (2)"
    assert "\\<img src\\=x\\>" in texts(window)


def test_the_registered_scan_is_outlined_under_its_tab(reviewing):
    window = reviewing(PhotographView)
    window.open_tab("Scan")
    assert len(window.client.seen(f"{ROOT}/scan").points) > 20
    assert not window.client.told


def test_a_ball_is_added_where_it_is_clicked(reviewing, say, settle):
    """The next click is its middle, and no other's; it can be turned into one of the other kind."""
    window = reviewing(PhotographView)
    window.open_tab("Capture")
    window.open_tab("Balls")
    client, found, plane = window.client, window.outlines, window.plane

    def click(pixel):
        aim = plane.place(pixel)
        client.clicks(client.seen("/photograph/picture"), ray_origin=aim + [0, 0, 5], ray_direction=[0.0, 0.0, -1.0])
        settle(window)

    click((90.0, 20.0))
    say(window, "Add a white ball")
    click((100.5, 30.25))
    assert window.outlines[:3] == found
    assert window.outlines[3].center_px == pytest.approx([100.5, 30.25])
    assert (window.outlines[3].kind, window.outlines[3].radius_px, window.ball) == ("white", 13.0, 3)
    click((26.0, 92.0))
    assert (len(window.outlines), window.ball) == (4, 2), "the next click chooses a ball again"
    say(window, ("kind", "chrome"))
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "chrome", "white"]
    assert not window.is_found(window.outlines[2])
    say(window, ("centre, px", (27.0, 92.0)))
    assert window.outlines[2].center_px == [27.0, 92.0]
    say(window, "Remove this ball")
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "white"]
    say(window, ("frame", 3), "mark the object")
    assert (window.frame, window.how.marks_object) == (2, True)
    assert not client.told


def test_a_drag_is_undone_as_one_however_slow_it_is(reviewing, settle, monkeypatch):
    """A machine that is busy, or a hand that rests, sends the next place seconds later."""
    clock = SimpleNamespace(monotonic=count(0, 10).__next__)
    monkeypatch.setattr(photograph_view, "time", clock)
    monkeypatch.setattr(windows, "time", clock)
    window = reviewing(PhotographView)
    plane = window.plane
    window.choose_ball(0)
    found = window.outlines[0]
    window.client.camera.position = (0.0, 0.0, 5.0)
    for reach in (1.05, 1.1):
        places = plane.place(np.add(found.center_px, [[part * found.radius_px, 0] for part in (1, 1.02, reach)]))
        window.client.drags(window.client.seen(f"{ROOT}/rim"), *places)
    settle(window)
    assert [label for label, *_ in window.history.past] == ["resize ball 1"] * 2
    assert window.outlines[0].radius_px == pytest.approx(1.1 * found.radius_px, rel=0.01)
    window.undo()
    assert window.outlines[0].radius_px == pytest.approx(1.05 * found.radius_px, rel=0.01)
    window.undo()
    assert window.outlines[0] == found


def test_balls_are_as_found_again_whatever_was_done_to_them(reviewing, say):
    """The only white ball is taken for a mirror, and moved: its diameter comes back with it."""
    window = reviewing(PhotographView)
    found = window.outlines
    window.choose_ball(2)
    say(window, ("kind", "chrome"), ("centre, px", (30.0, 80.0)))
    assert [ball.diameter_mm for ball in window.outlines] == [100.0] * 3, "as large as all of its kind"
    say(window, "Back to the balls as found")
    assert window.outlines == found
    assert all(map(window.is_found, window.outlines))
    window.choose_ball(2)
    say(window, ("kind", "chrome"), ("kind", "white"))
    assert window.outlines[2].diameter_mm is None, "of another kind it was another size"


def test_a_diameter_that_was_kept_stays_when_the_balls_are_found_with_it(reviewing, made, say):
    """The session itself states none: what was typed is known from what was kept."""
    path = made.session / "session.toml"
    path.write_text(path.read_text().replace("diameter_mm = 90.0\n", ""))
    window = reviewing()
    window.open_tab("Balls")
    say(window, ("white balls, mm", 90.0), "Keep")
    window.read_again()
    assert [ball.diameter_mm for ball in window.history.state.found] == [100.0, 100.0, 90.0]
    assert not window.client.told[1:]


@pytest.fixture
def runs(made, monkeypatch):
    """The runs that were begun: session and step. Each says a line and ends at once."""
    begun = []

    class Ran(SimpleNamespace):
        def __init__(self, label, folder, arguments, place):
            verb, session, *out = arguments
            assert out == ["--out", str(made.folder)] == ["--out", str(folder)]
            assert place == made.folder.parent
            begun.append((load_session(Path(session)), verb))
            super().__init__(label=label, folder=folder, said=[], share=0.0, begun_s=0.0, fault="", is_stopped=False)
            self.is_over, self.is_told = False, False

    monkeypatch.setattr(windows, "Work", Ran)
    return begun


def test_a_run_takes_what_was_corrected_and_the_session_as_it_is_now(reviewing, made, say, settle, runs):
    """It says with what other programs: a folder that came from elsewhere may name any. A step's end is shown."""
    with open_record(made.folder, among_others=True) as record:
        record.note("settings", {"external": ["Net=python `net` {data} {out}"]})
    window = reviewing()

    def run(label):
        say(window, label)
        before = window.reading
        with open_record(made.folder) as record, record.making("compare", str(time.monotonic())) as entry:
            entry["warnings"] = []
        until(lambda: window.reading > before)
        before = window.reading
        window.work.is_over = True
        until(lambda: window.reading > before)
        settle(window)
        return runs[-1]

    window.open_tab("Verdict")
    assert "Net=python `net` {data} {out}" in texts(window)
    session, step = run("Run everything")
    assert (session.folder, step) == (made.session, "process")
    window.open_tab("Balls")
    window.correct(moved(window.outlines, 0, (40.0, 30.0), made.camera))
    text = (made.session / "session.toml").read_text()
    (made.session / "session.toml").write_text(text + 'scan_unit = "cm"\n')
    assert "what you corrected" in texts(window)
    session, step = run("Run up to Balls")
    assert (session.scan_unit, session.spheres[0].center_px, step) == ("cm", (40.0, 30.0), "calibrate")
    assert run("Run up to Balls")[0].spheres[0].center_px == (40.0, 30.0), "what was kept stays so"


def test_corrections_stay_while_the_balls_are_sought_anew(reviewing, made, runs, say):
    """A step that begins is forgotten first: for a while the folder has no balls that were found."""
    window = reviewing()
    window.open_tab("Balls")
    window.correct(moved(window.outlines, 0, (40.0, 30.0), made.camera))
    say(window, "Run up to Balls")
    assert window.is_busy
    with open_record(made.folder) as record:
        record.forget(["calibrate", "align", "solve", "trust", "twin", "compare"])
    (made.folder / "spheres.json").unlink(missing_ok=True)
    window.look_again()
    window.read_again()
    assert tuple(window.outlines[0].center_px) == (40.0, 30.0)


def test_what_fails_at_each_look_is_told_once(reviewing, runs, monkeypatch, settle):
    """While a run is at work everything is refreshed each second; what a person does is answered each time."""
    window, looks = reviewing(PhotographView), []

    def fail(self):
        looks.append(1)
        raise SceneError("the disk is gone")

    monkeypatch.setattr(SessionWindow, "plane", property(fail))
    window.client.says("Run up to Capture")
    until(lambda: len(looks) > 5)
    assert window.client.told == ["That cannot be done: the disk is gone"]
    window.post(lambda: window.open_tab("Balls"))
    settle(window)
    assert len(window.client.told) == 2


STATE = {
    "is_over": False, "flash": 3, "ambient": 1, "warnings": ["a: <b>moved</b>"], "lights": None,
    "normals": {
        "sigma_deg_median": 1.5, "share_under_wanted": 0.25, "wanted_deg": 1.0,
        "next_flash": {"zenith_deg": 45.0, "azimuth_deg": 180.0, "distance_mm": None, "sigma_deg": 1.2},
    },
}  # fmt: skip
SHOOT = SimpleNamespace(flash=[1, 2, 3], roles={"ambient": [4]}, newest=None, lights="3 lights")
STATE["told"] = state_lines(SHOOT, STATE["normals"])


def test_a_shoot_is_told_renewed_and_ends(reviewing, made):
    (made.folder / STATUS).write_text(json.dumps(STATE))
    window = reviewing()
    assert "3 flash frames" in texts(window)
    assert plain("45 degrees from the axis at 9:00") in texts(window)
    assert "<b>" not in texts(window)
    (made.folder / STATUS).write_text(json.dumps(STATE | {"is_over": True}))
    until(lambda: "3 flash frames" not in texts(window))
    (made.folder / STATUS).write_text('{"is_over": false, "flash": "many"}')
    until(lambda: window.client.told)
    assert "is no state of a shoot" in window.client.told[-1]


def test_a_first_shoot_is_shown_until_its_session_is_decoded(nobody, tmp_path, furnish):
    """A wall of what a folder lacks would tell its photographer nothing; the map is large."""
    folder = tmp_path / "out"
    with open_record(folder) as record:
        (folder / STATUS).write_text(json.dumps(STATE))
        write_png(folder / MAP, np.full((20, 30, 3), 90, np.uint8))
        window = SessionWindow(nobody(), Workspace.at(tmp_path), StudioState(area="Session", session=(folder, None)))
        furnish(window, SESSION_ROWS, PhotographView)
        assert "not made yet" not in texts(window)
        assert (window.plane.width, window.plane.height) == (30, 20)
        write_png(folder / MAP, np.full((40, 60, 3), 90, np.uint8))
        (folder / STATUS).write_text(json.dumps(STATE | {"flash": 4}))
        until(lambda: window.plane.width == 60)
        (folder / STATUS).write_text(json.dumps(STATE | {"is_over": True}))
        until(lambda: "The shoot is over" in texts(window))
        note_steps(record, {"check": {"result": {}, "warnings": []}})
    until(lambda: "check" in window.review.done)

"""A session's window without a browser: what is clicked, what is missing, what runs, and a shoot under way."""

import json
import threading
import time
from itertools import count
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from capture.session.session import load_session
from lab.options import Settings
from scene import rays
from scene.files import write_png
from scene.output_folder import open_record
from shoot.watch.status import MAP, STATUS
from studio import work_buttons
from studio.photograph import outline_marks, photograph_window
from studio.photograph.outline_marks import KNOB, OutlineMarks
from studio.photograph.outlines import moved
from studio.photograph.plane import ROOT
from studio.review import run_panel
from studio.review.photograph_view import PhotographView
from studio.review.review_window import ReviewWindow
from studio.review.run_panel import RunPanel, WarningsPanel
from studio.review.shoot_panel import ShootPanel
from studio.review.spatial_view import SCAN_SIZE, SpatialView
from studio.review.step_panels import CAPTURE, SESSION_TABS, balls_panel
from studio.tabs import TabbedPanels
from studio.widgets import Panel
from studio.workspace import Workspace
from tests.studio.review.conftest import note_steps


@pytest.fixture
def reviewing(made, nobody, no_preview, furnish):
    """Return what makes the window of a review of the folder that was made, with panels."""

    def furnished(*panels, desk=None, number=1):
        place = Workspace.at(made.folder.parent)
        window = ReviewWindow(nobody(number), place, no_preview, made.folder, made.session, desk)
        window.read()
        return furnish(window, panels)

    return furnished


def test_a_click_on_the_scan_is_met_in_the_windows_own_thread(reviewing, settle, monkeypatch):
    """Rays are cast there, against one tree a reading; what fails is told, as of any click."""
    window, threads, points = reviewing(SpatialView), [], []

    class Counted(rays.RayCaster):
        def __init__(self, mesh):
            threads.append(threading.current_thread().name)
            super().__init__(mesh)

    window.on_scan = points.append
    window.choose(is_scan_asked=True)
    mesh, client = window.review.scan_mesh, window.client
    monkeypatch.setattr(rays, "RayCaster", Counted)
    scale = SCAN_SIZE / (2 * mesh.radius_mm)
    for aside in (0.0, 2.0, 4.0):
        origin = np.array([aside, -3.0, 900.0])
        client.clicks(client.seen("/scan/mesh"), ray_origin=origin * scale, ray_direction=[0.0, 0.0, -1.0])
    settle(window)
    np.testing.assert_allclose([point[0] - mesh.center_mm[0] for point in points], [0, 2, 4], atol=1e-3)
    assert len(threads) == 1
    assert threads[0].startswith("window 1")
    window.read_again()
    monkeypatch.setattr(Counted, "__init__", lambda self, mesh: 1 / 0)
    client.clicks(client.seen("/scan/mesh"), ray_origin=np.zeros(3), ray_direction=[0.0, 0.0, -1.0])
    settle(window)
    assert "ZeroDivisionError" in client.told[-1]


def test_what_is_missing_breaks_no_tab(reviewing, made):
    """A ball is clicked without a camera to draw its knobs by, the twin is asked for where there is no frame."""
    tabs = lambda window: TabbedPanels(window, SESSION_TABS)  # noqa: E731
    for gone in ("camera.json", "lights.json", "frames/frames.json", "spheres.json"):
        (made.folder / gone).unlink()
        window = reviewing(tabs, PhotographView, SpatialView)
        for name in SESSION_TABS:
            window.open_tab(name)
        window.choose(ball=1)
        assert not window.client.told
        assert window.beside is None


def test_the_warnings_are_counted_as_the_folder_is_now(reviewing, made):
    window = reviewing(WarningsPanel)
    window.open_tab("Verdict")
    folder = window.panels[0]._folder
    assert folder.label == "Warnings (1)"
    with open_record(made.folder) as record, record.making("solve", "by the test") as entry:
        entry["warnings"] = ["<img src=x> is *bright*"]
    window.read_again()
    assert folder.label == "Warnings (2)"
    assert "\\<img src\\=x\\>" in window.panels[0]._layers._handles["warnings"][-1].content


def test_a_ball_is_added_where_it_is_clicked(reviewing, settle):
    """The next click is its middle, and no other's; it can be turned into one of the other kind."""
    window = reviewing(PhotographView, balls_panel, lambda window: Panel(window, CAPTURE))
    client, found, plane = window.client, window.outlines, window.plane

    def click(pixel):
        aim = plane.place(pixel)
        client.clicks(client.seen("/photograph/picture"), ray_origin=aim + [0, 0, 5], ray_direction=[0.0, 0.0, -1.0])
        settle(window)

    def say(label, value=True):
        client.says(label, value)
        settle(window)

    click((90.0, 20.0))
    say("Add a white ball")
    click((100.5, 30.25))
    assert window.outlines[:3] == found
    assert window.outlines[3].center_px == pytest.approx((100.5, 30.25))
    assert (window.outlines[3].kind, window.outlines[3].radius_px, window.ball) == ("white", 13.0, 3)
    click((26.0, 92.0))
    assert (len(window.outlines), window.ball) == (4, 2), "the next click chooses a ball again"
    say("kind", "chrome")
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "chrome", "white"]
    assert window.outlines[2].is_moved
    say("centre, px", (27.0, 92.0))
    assert window.outlines[2].center_px == (27.0, 92.0)
    say("Remove this ball")
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "white"]
    say("frame", 3)
    say("show", "mask")
    assert (window.frame, window.shown.overlay) == (2, "mask")
    assert not client.told


def test_a_drag_is_undone_as_one_however_slow_it_is(reviewing, settle, monkeypatch):
    """A machine that is busy, or a hand that rests, sends the next place seconds later."""
    clock = SimpleNamespace(monotonic=count(0, 10).__next__)
    monkeypatch.setattr(outline_marks, "time", clock)
    monkeypatch.setattr(photograph_window, "time", clock)
    window = reviewing()
    plane = window.plane
    window.choose_ball(0)
    OutlineMarks(window, lambda ball: KNOB).refresh(plane)
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


@pytest.fixture
def runs(made, monkeypatch):
    """The runs that were begun: session and step. Each says a line and ends at once."""
    begun = []

    class Ran(SimpleNamespace):
        def __init__(self, label, folder, arguments, told):
            assert arguments[:2] == ["-m", "studio.studio_run"]
            assert arguments[4] == str(made.folder) == str(folder)
            begun.append((load_session(Path(arguments[3])), arguments[2]))
            super().__init__(label=label, folder=folder, said=[], share=0.0, begun_s=0.0, fault="", is_stopped=False)
            self.is_over, self.told = True, told
            told("calibrate: 3.2 s")
            told("")

    monkeypatch.setattr(work_buttons, "Work", Ran)
    return begun


def test_a_run_takes_what_was_corrected_and_the_session_as_it_is_now(reviewing, made, settle, runs):
    """It says with what other programs: a folder that came from elsewhere may name any. A step's end is shown."""
    with open_record(made.folder, among_others=True) as record:
        Settings(external=("Net=python `net` {data} {out}",)).keep(record)
    window = reviewing(RunPanel)

    def run(label):
        before = window.reading
        window.client.says(label)
        for _ in range(3):
            settle(window)
        assert window.reading == before + 2, "when the step has ended, and in the end"
        return runs[-1]

    window.open_tab("Verdict")
    assert "Net=python `net` {data} {out}" in window.panels[-1]._what.content
    session, step = run("Run everything")
    assert (session.folder, step) == (made.session, "compare")
    window.open_tab("Balls")
    window.correct(moved(window.outlines, 0, (40.0, 30.0), made.camera))
    text = (made.session / "session.toml").read_text()
    (made.session / "session.toml").write_text(text + 'scan_unit = "cm"\n')
    assert "what you corrected" in window.panels[-1]._what.content
    session, step = run("Run up to Balls")
    assert (session.scan_unit, session.spheres[0].center_px, step) == ("cm", (40.0, 30.0), "calibrate")
    assert run("Run up to Balls")[0].spheres[0].center_px == (40.0, 30.0), "what was kept stays so"
    window.forget()
    assert run("Run up to Balls")[0].folder == made.session


def test_how_long_a_run_still_takes_is_told_from_the_steps_that_ended(reviewing, made, monkeypatch):
    """A tenth of the usual time took 10 s: the 90 % that are to come take 90 s, less what has gone by since."""
    with open_record(made.folder) as record:
        record.forget(["check", "calibrate", "align", "solve", "twin"])
    window, now = reviewing(RunPanel), SimpleNamespace(monotonic=lambda: 5.0)
    monkeypatch.setattr(run_panel, "time", now)
    (panel,) = window.panels
    window.open_tab("Verdict")
    panel._arguments()
    panel._hear("check: 2.0 s")
    assert panel._left_s() is None, "too little is known"
    panel._hear("calibrate: 8.0 s, 1 warnings")
    now.monotonic = lambda: 12.0
    assert panel._left_s() == pytest.approx(90 - 7)


def test_corrections_are_undone_and_outlive_the_window(reviewing, made):
    """A reload shows them as they were, not kept, and undo still takes them back."""
    window = reviewing()
    found = window.outlines
    window.correct(moved(found, 0, (40.0, 30.0), made.camera), "move ball 1")
    window.correct(moved(window.outlines, 1, (90.0, 40.0), made.camera), "move ball 2")
    window.close()
    again = reviewing(desk=window.desk, number=2)
    assert again.outlines[0].center_px == (40.0, 30.0)
    assert not again.is_kept_so
    again.undo()
    assert again.outlines[1] == found[1]
    again.undo()
    assert (again.outlines, again.is_kept_so) == (found, True)
    again.redo()
    assert again.outlines[0].center_px == (40.0, 30.0)


STATE = {
    "is_over": False, "flash": 3, "ambient": 1, "warnings": ["a: <b>moved</b>"], "lights": None,
    "normals": {
        "sigma_deg_median": 1.5, "share_under_wanted": 0.25, "wanted_deg": 1.0,
        "next_flash": {"zenith_deg": 45.0, "azimuth_deg": 180.0, "sigma_deg": 1.2},
    },
}  # fmt: skip


def test_a_shoot_is_shown_renewed_and_told_when_it_is_over(reviewing, made, settle):
    write_png(made.folder / MAP, np.full((20, 30, 3), 90, np.uint8))
    (made.folder / STATUS).write_text(json.dumps(STATE))
    window = reviewing(ShootPanel)
    (panel,) = window.panels
    assert not panel.is_alone
    assert panel._folder.visible
    assert "3 flash frames" in panel._text.content
    assert "<b>" not in panel._text.content
    assert (panel._picture.image == 90).all()
    (made.folder / STATUS).write_text(json.dumps(STATE | {"is_over": True}))
    end = time.monotonic() + 30
    while panel._folder.visible:
        assert time.monotonic() < end, "it looks for itself"
        time.sleep(0.1)
    (made.folder / STATUS).write_text('{"is_over": false, "flash": "many"}')
    window.post(panel.refresh)
    settle(window)
    assert "is no state of a shoot" in window.client.told[-1]


def test_a_first_shoot_stands_alone_until_its_session_is_decoded(nobody, no_preview, tmp_path, settle):
    """A wall of what a folder lacks would hide the shoot, and tell its photographer nothing."""
    folder, turned = tmp_path / "out", []
    with open_record(folder) as record:
        (folder / STATUS).write_text(json.dumps(STATE))
        window = ReviewWindow(nobody(), Workspace.at(tmp_path), no_preview, folder, None)
        window.turn = lambda: turned.append("turned")
        window.read()
        panel = ShootPanel(window)
        panel.refresh()
        assert panel.is_alone
        (folder / STATUS).write_text(json.dumps(STATE | {"is_over": True}))
        panel.refresh()
        assert "The shoot is over" in panel._text.content
        assert panel._folder.visible
        assert not turned, "its photographs are not decoded yet"
        note_steps(record, {"check": {"result": {}, "warnings": []}})
    end = time.monotonic() + 30
    while not turned:
        assert time.monotonic() < end
        time.sleep(0.1)
    window.close()

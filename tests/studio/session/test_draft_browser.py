"""From a folder of photographs to the report in a real browser, without a terminal."""

import json
import shutil

import numpy as np
import pytest

from capture.session.session import load_session
from scene.normals import angular_error_deg
from scene.rooms import ROOT
from studio.server import Studio
from studio.session.draft_window import DraftWindow
from studio.workspace import Workspace

pytestmark = [pytest.mark.slow]
FIXTURE = ROOT / "fixtures" / "bumpy"
FOUND = "Write session"
MOST_INTERACTIONS = 8


@pytest.fixture
def studio(tmp_path):
    """A studio in whose workspace the fixture's photographs and scan lie, without a session.toml."""
    for part in ("raw", "scan"):
        shutil.copytree(FIXTURE / part, tmp_path / "bumpy" / part)
    running = Studio(Workspace.at(tmp_path), port=0)
    yield running
    running.close()


def begin(visitor):
    """Choose the folder, and begin a session in it."""
    visitor.press("bumpy/")
    visitor.button("One folder up").wait_for()
    visitor.press("New session here")
    visitor.button(FOUND).wait_for()


@pytest.mark.full
def test_from_a_folder_to_the_report(visit, studio, tmp_path):
    """Nothing but the page is used; the report that is shown in it is the session's own."""
    visitor = visit(studio, "New session here")
    visitor.settle()
    visitor.keep("open")
    begin(visitor)
    visitor.fill("chrome balls, mm", 100)
    visitor.fill("white balls, mm", 90)
    visitor.tab("Object")
    visitor.fill("tolerance_deg", 25)
    visitor.settle()
    visitor.keep("new_session")
    visitor.press(FOUND)
    visitor.button("Run everything").wait_for()
    visitor.press("Run everything")
    report = visitor.page.frame_locator("#studio-report")
    report.get_by_text("iterative").first.wait_for(timeout=600_000)
    assert report.locator(".headline .badge").inner_text().lower() == "pass"
    assert visitor.interactions <= MOST_INTERACTIONS
    visitor.settle()
    visitor.keep("verdict")
    out = tmp_path / "out" / "bumpy"
    summary = json.loads((out / "summary.json").read_text())
    assert {"ls", "iterative"} <= set(summary["compare"]["methods"])
    truth = json.loads((FIXTURE / "truth.json").read_text())
    lights = visitor.window.review.lights.seen_from(np.array(truth["object_centre_mm"]))
    assert np.median(angular_error_deg(lights.directions, np.array(truth["directions_at_object"]))) < 1.5
    # Its scripts have no part in the studio's own page.
    frame = next(frame for frame in visitor.page.frames if "/report/" in frame.url)
    assert frame.evaluate("self.origin") == "null"
    # What is shown follows the tab: the view is the photograph's again, and the report's again.
    visitor.tab("Balls")
    visitor.page.locator("#studio-report").wait_for(state="detached")
    visitor.tab("Verdict")
    visitor.page.locator("#studio-report").wait_for()
    outside = [url for url in visitor.asked if studio.address.split("//")[1] not in url]
    assert all(url.startswith(("data:", "blob:")) for url in outside), "nothing is fetched from elsewhere"


@pytest.mark.full
def test_what_was_found_is_put_right_by_hand(visit, studio, tmp_path):
    folder = tmp_path / "bumpy"
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    visitor = visit(studio, "New session here")
    begin(visitor)
    window = visitor.window
    assert isinstance(window, DraftWindow)
    truth = json.loads((FIXTURE / "truth.json").read_text())
    centers = np.array([one["centre_px"] for one in truth["spheres"]])
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "white"]
    for ball in window.outlines:
        assert np.linalg.norm(centers - ball.center_px, axis=1).min() < 0.05 * ball.radius_px

    # The circle that is clicked is drawn larger by its rim.
    first, plane = window.outlines[0], window.plane
    visitor.click(plane.place(first.center_px))
    visitor.until(lambda: window.ball == 0, "the ball was clicked")
    visitor.settle()
    rim = plane.place(np.add(first.center_px, [first.radius_px, 0]))
    hand = plane.place(np.add(first.center_px, [1.05 * first.radius_px, 0]))
    visitor.drag(visitor.on_screen(rim), visitor.on_screen(hand))
    visitor.until(lambda: not window.is_found(window.outlines[0]), "the knob was dragged")
    visitor.settle()
    visitor.keep("new_session_ball")
    dragged = window.outlines[0]
    assert dragged.radius_px == pytest.approx(1.05 * first.radius_px, rel=0.02)
    assert dragged.center_px == pytest.approx(first.center_px)
    window.post(lambda: window.choose_ball(1))
    visitor.settle()
    visitor.press("Remove this ball")
    visitor.until(lambda: len(window.outlines) == 2, "a ball was removed")
    # By keys, and by the button.
    visitor.page.locator("canvas").first.focus()
    visitor.page.keyboard.press("Control+z")
    visitor.until(lambda: len(window.outlines) == 3, "taken back by Ctrl-Z")
    visitor.press("Redo: remove ball 2")
    visitor.until(lambda: len(window.outlines) == 2, "removed again")
    visitor.fill("chrome balls, mm", 100)
    # A reload of the page loses nothing.
    visitor.reload(FOUND)
    window = visitor.window
    assert [ball.diameter_mm for ball in window.outlines] == [100, None]
    visitor.fill("white balls, mm", 90)
    visitor.tab("Object")
    visitor.settle()
    visitor.keep("new_session_object")
    visitor.tab("session.toml")
    text = window.text
    visitor.press(FOUND)
    visitor.button("Run everything").wait_for()
    after = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert after.pop(folder / "session.toml").decode() == text
    assert after == before
    chrome, white = load_session(folder).spheres
    assert (chrome.kind, chrome.diameter_mm, white.kind, white.diameter_mm) == ("chrome", 100.0, "white", 90.0)
    assert chrome.center_px == pytest.approx(dragged.center_px, abs=0.05)
    assert chrome.radius_px == pytest.approx(dragged.radius_px, abs=0.05)
    assert white.center_px is None, "the white ball was not touched"

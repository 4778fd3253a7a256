"""A session begun in a real browser: from a folder of photographs to session.toml, to lights, to their review."""

import json
import shutil

import numpy as np
import pytest

from capture.session.session import load_session
from capture.survey.folder_files import survey
from scene.normals import angular_error_deg
from scene.rooms import ROOT
from studio.new_session.looking import Looking
from studio.new_session.new_session_window import NewSessionWindow
from studio.review.review_window import ReviewWindow
from studio.server import Studio
from studio.workspace import Workspace

pytestmark = [pytest.mark.slow]
FIXTURE = ROOT / "fixtures" / "bumpy"
FOUND = "Add a chrome ball"


@pytest.fixture
def studio(tmp_path):
    """A studio on the fixture's photographs and scan, without its session.toml."""
    for part in ("raw", "scan"):
        shutil.copytree(FIXTURE / part, tmp_path / "bumpy" / part)
    looking = Looking(survey(tmp_path / "bumpy"), tmp_path / "out" / "bumpy")
    running = Studio(Workspace.at(tmp_path), port=0, looking=looking)
    yield running
    running.close()


def settle(visitor):
    """Wait until the window has done what it was told, and that is drawn."""
    done = []
    visitor.window.post(lambda: done.append(True))
    visitor.until(lambda: done, "the window is at rest")
    visitor.frames(4)


def type_diameter(visitor, kind, value):
    """Type the diameter of a kind of balls, and wait until the window has it.

    Of what changes within 50 ms, in whatever input, viser's page sends the last alone. No person is that fast.
    """
    box = visitor.page.get_by_label(f"{kind} balls, mm", exact=True)
    visitor.page.wait_for_timeout(200)
    box.fill(str(value))
    box.press("Tab")
    visitor.until(lambda: visitor.window.capture.diameters_mm.get(kind) == value, f"the {kind} balls' diameter")


@pytest.mark.full
def test_from_a_folder_to_lights_in_one_page(visit, studio, tmp_path):
    folder = tmp_path / "bumpy"
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    visitor = visit(studio, FOUND)
    window = visitor.window
    assert isinstance(window, NewSessionWindow)
    assert window.capture is not None, "nothing can be put right before it was found"
    settle(visitor)
    visitor.keep("new_session")
    truth = json.loads((FIXTURE / "truth.json").read_text())
    centers = np.array([one["centre_px"] for one in truth["spheres"]])
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "white"]
    for ball in window.outlines:
        assert np.linalg.norm(centers - ball.center_px, axis=1).min() < 0.05 * ball.radius_px

    # The circle that is clicked is drawn larger by its rim.
    first, plane = window.outlines[0], window.plane
    visitor.page.mouse.click(*visitor.on_screen(plane.place(first.center_px)))
    visitor.until(lambda: window.ball == 0, "the ball was clicked")
    settle(visitor)
    rim = plane.place(np.add(first.center_px, [first.radius_px, 0]))
    hand = plane.place(np.add(first.center_px, [1.05 * first.radius_px, 0]))
    visitor.drag(visitor.on_screen(rim), visitor.on_screen(hand))
    visitor.until(lambda: window.outlines[0].is_moved, "the knob was dragged")
    settle(visitor)
    visitor.keep("new_session_ball")
    dragged = window.outlines[0]
    assert dragged.radius_px == pytest.approx(1.05 * first.radius_px, rel=0.02)
    assert dragged.center_px == pytest.approx(first.center_px)
    window.post(lambda: window.choose_ball(1))
    settle(visitor)
    visitor.press("Remove this ball")
    visitor.until(lambda: len(window.outlines) == 2, "a ball was removed")
    type_diameter(visitor, "chrome", 100)
    type_diameter(visitor, "white", 90)
    visitor.until(lambda: window.draft.unit == "mm", "the balls' diameters tell the scan's unit")

    visitor.tab("Write")
    visitor.see("Nothing is missing, nothing assumed")
    visitor.press("Write session.toml")
    visitor.see("Is written to")
    settle(visitor)
    visitor.keep("new_session_written")
    after = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert after.pop(folder / "session.toml").decode() == window.text
    assert after == before
    chrome, white = load_session(folder).spheres
    assert (chrome.kind, chrome.diameter_mm, white.kind, white.diameter_mm) == ("chrome", 100.0, "white", 90.0)
    assert chrome.center_px == pytest.approx(dragged.center_px, abs=0.05)
    assert chrome.radius_px == pytest.approx(dragged.radius_px, abs=0.05)
    assert white.center_px is None, "the white ball was not touched"

    visitor.press("Calibrate")
    visitor.button("Photograph").wait_for()
    visitor.until(lambda: isinstance(studio.windows[0], ReviewWindow), "the review takes the page")
    (reviewing,) = studio.windows
    assert reviewing.client is window.client
    lights = reviewing.review.lights.seen_from(np.array(truth["object_centre_mm"]))
    assert np.median(angular_error_deg(lights.directions, np.array(truth["directions_at_object"]))) < 1.5
    visitor.window = reviewing
    settle(visitor)
    visitor.keep("new_session_review")
    visitor.page.reload()
    visitor.button("Photograph").wait_for()

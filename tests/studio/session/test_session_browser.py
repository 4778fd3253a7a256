"""A session in a real browser: begun from a folder of photographs, put right, looked at step by step, and picked on."""

import json
import shutil

import numpy as np
import pytest

from align.pose.picks import read_picks
from capture.session.session import load_session
from scene.normals import angular_error_deg
from scene.rays import RayCaster
from studio.session.corrections import met
from studio.session.photograph_picture import PictureLook
from studio.session.plane import Plane
from studio.session.spatial_view import SCAN_SIZE
from tests.conftest import FIXTURE

pytestmark = [pytest.mark.slow, pytest.mark.full]
READY = "Show all of it"


@pytest.fixture
def at_session(run_studio):
    """Return what makes a studio at a session."""
    return lambda root, folder, session: run_studio(root, area="Session", session=(folder, session))


def strip_middle(window, index):
    """Return where the middle of a small picture stands, by the strip's rows of at most six."""
    frames = window.review.material.frames
    plane = Plane(frames.width, frames.height)
    columns, cell_high = 6, 200 * frames.height / frames.width + 30
    wide = 206 * columns
    across = (index % columns + 0.5) * 206 / wide
    return np.array([8 * (across - 0.5), -plane.high / 2 - 0.25 - 8 * (index // columns + 0.4) * cell_high / wide, 0.0])


def test_a_half_done_session_is_put_right(visit, calibrated, at_session):
    """No mask, no scan, no twin: said so. A ball is dragged wrong, run again, and found; a second window may go on."""
    studio = at_session(calibrated.root, calibrated.folder, calibrated.session)
    visitor = visit(studio, READY)
    window = visitor.window
    visitor.see("mask, scan, twin")
    visitor.see("not made yet")
    found = window.outlines[0]

    visitor.settle()
    visitor.click(strip_middle(window, 3))
    visitor.until(lambda: window.frame == 3, "the small picture was clicked")
    visitor.see(window.review.material.frames.names[3])

    visitor.tab("Verdict")
    visitor.see("There is no report yet")
    visitor.tab("Balls")
    visitor.settle()
    window.post(lambda: window.choose_ball(0))
    visitor.see("in 6 of 6 frames")
    visitor.settle()
    plane = Plane(320, 240)
    knob = plane.place(np.add(found.center_px, [found.radius_px, 0]))
    hand = plane.place(np.add(found.center_px, [1.1 * found.radius_px, 0]))
    visitor.drag(visitor.on_screen(knob), visitor.on_screen(hand))
    visitor.until(lambda: not window.is_found(window.outlines[0]), "the knob was dragged")
    visitor.settle()
    dragged = window.outlines[0]
    assert dragged.radius_px == pytest.approx(1.1 * found.radius_px, rel=0.02)
    assert dragged.center_px == pytest.approx(found.center_px)
    visitor.keep("review_ball")
    # A reload loses nothing of it; a whole drag is one thing to undo.
    visitor.reload("Undo: resize ball 1")
    window = visitor.window
    assert window.outlines[0] == dragged
    visitor.page.locator("canvas").first.focus()
    visitor.page.keyboard.press("Control+z")
    visitor.until(lambda: window.outlines[0] == found, "taken back")
    visitor.press("Redo: resize ball 1")
    visitor.until(lambda: window.outlines[0] == dragged, "made again")

    visitor.press("Run up to Balls")
    visitor.see("your own session.toml is as it was")
    visitor.until(lambda: window.state.work is None, "the steps have ended")
    (spec,) = load_session(calibrated.folder / "review").spheres
    assert spec.radius_px == pytest.approx(2 * dragged.radius_px), "full-size pixels of halved frames"
    assert (calibrated.session / "session.toml").read_text() == calibrated.text
    # The outline is found again from a circle that is a tenth too large. The window reads it after the work's end.
    visitor.until(lambda: window.is_found(window.outlines[0]), "what was found is read")
    # Both are as near to the truth, which is of twice the size.
    true = json.loads((FIXTURE / "truth.json").read_text())["spheres"][0]
    for ball in (found, window.outlines[0]):
        assert np.hypot(*np.subtract(ball.center_px, np.array(true["centre_px"]) / 2 - 0.25)) < 0.1
        assert ball.radius_px == pytest.approx(true["radius_px"] / 2, abs=0.1)

    # One window at a time, the newest; the one before is told so.
    other = visit(studio, "Run up to Balls")
    visitor.see("Load this page again")
    visitor.page.close()
    other.tab("Lights")
    other.until(lambda: other.window.view == "Lights in 3-D", "the view follows the tab")
    # What is not there is said, and the studio lives on.
    window = other.window
    window.post(lambda: window.open_tab("Capture"))
    window.post(lambda: window.choose(how=PictureLook(marks_object=True)))
    other.see("That cannot be done")
    other.tab("Scan")
    other.see("Not registered")


def test_a_whole_session_is_looked_at_and_picked_on(visit, made, tmp_path, at_session):
    """Four points clicked in the photograph and on the scan give the pose at which both were made."""
    visitor = visit(at_session(tmp_path, made.folder, made.session), READY)
    window = visitor.window
    visitor.tab("Twin")
    visitor.see("lays its frames over the photographs")
    visitor.tab("Scan")
    visitor.press("Start picking")
    visitor.until(lambda: window.on_photograph is not None, "picking has begun")
    mesh, plane = window.review.scan_mesh, Plane(160, 120)
    scale = SCAN_SIZE / (2 * mesh.radius_mm)
    towards = [(-25, 10), (22, 14), (3, -38), (8, 20)]
    for count, (x, y) in enumerate(towards, 1):
        point = met(RayCaster(mesh), mesh.center_mm + [x, y, 500.0], np.array([0.0, 0.0, -1.0]))
        pixel = made.camera.project(made.pose.apply(point[None]))[0]
        visitor.click(plane.place(pixel))
        visitor.until(lambda: window.view == "Scan", "the scan is asked for")
        visitor.click((point - mesh.center_mm) * scale)
        visitor.until(lambda: window.picks.pairs == count, "the pair is whole")  # noqa: B023
        np.testing.assert_allclose(window.picks.points[-1], point, atol=0.02 * mesh.radius_mm)
        np.testing.assert_allclose(window.picks.pixels[-1], pixel, atol=1.0)
    visitor.frames(2)
    visitor.keep("review_picks")
    visitor.press("Keep")
    visitor.see("your own session.toml is as it was")
    kept = load_session(made.folder / "review").picks
    assert kept == made.folder / "review" / "picks.csv"
    found = read_picks(kept, made.camera, mesh, unit="mm", half=False)
    assert (found.pose.inverse() @ made.pose).angle_deg() < 10


def test_the_wheel_enlarges_what_is_under_the_pointer_and_a_drag_moves_it(visit, made, tmp_path, at_session):
    """The photograph is never turned; in 3-D the same hand turns."""
    visitor = visit(at_session(tmp_path, made.folder, made.session), READY)
    window, plane, mouse = visitor.window, Plane(160, 120), visitor.page.mouse
    visitor.settle()
    visitor.page.wait_for_function("() => document.documentElement.dataset.flat === 'true'")
    camera, pixel = window.client.camera, plane.place((110.0, 75.0))
    at, high = visitor.on_screen(pixel), camera.position[2]
    mouse.move(*at)
    for _ in range(4):
        mouse.wheel(0, -240)
        visitor.frames(2)
    visitor.until(lambda: camera.position[2] < 0.8 * high, "enlarged")
    visitor.page.wait_for_timeout(300)
    assert np.linalg.norm(visitor.on_screen(pixel) - at) < 8, "what was under the pointer stays there"
    visitor.drag(at, at + [60, 40])
    visitor.until(lambda: np.linalg.norm(visitor.on_screen(pixel) - at - [60, 40]) < 10, "it follows the hand")
    np.testing.assert_allclose(camera.wxyz / np.sign(camera.wxyz[1]), [0, 1, 0, 0], atol=1e-3)
    visitor.tab("Lights")
    visitor.page.wait_for_function("() => document.documentElement.dataset.flat === 'false'")


MOST_INTERACTIONS = 8


@pytest.fixture
def studio(tmp_path, run_studio):
    """A studio in whose workspace the fixture's photographs and scan lie, without a session.toml."""
    for part in ("raw", "scan"):
        shutil.copytree(FIXTURE / part, tmp_path / "bumpy" / part)
    return run_studio(tmp_path)


def test_from_a_folder_to_the_report(visit, studio, tmp_path):
    """Nothing but the page is used; the report that is shown in it is the session's own."""
    visitor = visit(studio, "New session here")
    visitor.settle()
    visitor.keep("open")
    visitor.press("bumpy/")
    visitor.button("One folder up").wait_for()
    visitor.press("New session here")
    visitor.button("Write session.toml").wait_for()
    visitor.fill("chrome, mm", 100)
    visitor.fill("white, mm", 90)
    visitor.settle()
    visitor.keep("new_session")
    visitor.press("Write session.toml")
    visitor.button("Run everything").wait_for()
    visitor.settle()
    visitor.keep("new_session_seen")
    text = (tmp_path / "bumpy" / "session.toml").read_text()
    assert 'scan_unit = "mm"' in text, "the balls' diameters tell the scan's unit"
    (tmp_path / "bumpy" / "session.toml").write_text(text.replace("[object]\n", "[object]\ntolerance_deg = 25\n"))
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

"""A review's window without a browser: what is clicked, what is missing, and what is written."""

import threading
from dataclasses import replace

import cv2
import numpy as np
import pytest

from scene import rays
from scene.output_folder import open_record
from studio.review.balls_panel import BallsPanel
from studio.review.corrections import outlines_of
from studio.review.folder import Review
from studio.review.frames_panel import FramesPanel, WarningsPanel
from studio.review.photograph_view import PhotographView
from studio.review.recalibration import calibrate_again
from studio.review.review_window import ReviewWindow
from studio.review.spatial_view import SCAN_SIZE, SpatialView
from studio.review.twin_panel import TwinPanel
from studio.workspace import Workspace


@pytest.fixture
def reviewing(made, nobody, no_preview, furnish):
    """Return what makes the window of a review of the folder that was made, with panels."""

    def furnished(*panels):
        window = ReviewWindow(nobody(), Workspace.at(made.folder.parent), no_preview, made.folder, made.session)
        window.read()
        return furnish(window, panels)

    return furnished


def test_a_click_on_the_scan_is_met_in_the_windows_own_thread(reviewing, settle, monkeypatch, made):
    """Rays are cast there, against one tree a reading; what fails is told, as of any click."""
    window, threads, points = reviewing(SpatialView), [], []

    class Counted(rays.RayCaster):
        def __init__(self, mesh):
            threads.append(threading.current_thread().name)
            super().__init__(mesh)

    window.on_scan = points.append
    window.choose(view="Scan")
    mesh, client = window.review.scan_mesh, window.client
    monkeypatch.setattr(rays, "RayCaster", Counted)
    scale = SCAN_SIZE / (2 * mesh.radius_mm)
    for aside in (0.0, 2.0, 4.0):
        origin = np.array([aside, -3.0, 900.0])
        client.clicks(client.seen("/scan/mesh"), ray_origin=origin * scale, ray_direction=[0.0, 0.0, -1.0])
    settle(window)
    assert len(points) == 3
    np.testing.assert_allclose([point[0] - mesh.center_mm[0] for point in points], [0, 2, 4], atol=1e-3)
    assert len(threads) == 1
    assert threads[0].startswith("window 1")
    window.read_again()
    monkeypatch.setattr(Counted, "__init__", lambda self, mesh: 1 / 0)
    client.clicks(client.seen("/scan/mesh"), ray_origin=np.zeros(3), ray_direction=[0.0, 0.0, -1.0])
    settle(window)
    assert "ZeroDivisionError" in client.told[-1]


def test_what_is_missing_is_said_once_and_breaks_no_refresh(reviewing, made, settle):
    """A ball is clicked without a camera to draw its knobs by, the twin is asked for where there is no frame."""
    made.store.path("camera.json").unlink()
    window = reviewing(PhotographView, BallsPanel)
    window.choose(ball=1)
    window.refresh()
    assert not window.client.told
    made.store.path("frames", "frames.json").unlink()
    window = reviewing(TwinPanel, FramesPanel)
    window.client.says("beside the photograph", "the twin, same flash")
    settle(window)
    (told,) = set(window.client.told)
    assert "frames: " in told
    assert "fault of the studio" not in told


def test_calibrating_again_writes_nothing_into_the_folder(made, monkeypatch):
    """Not even the photographs of a ball that was shot apart, which it decodes; those are of the right ball."""
    raw = made.session / "raw"
    for index, name in enumerate(made.lights.names):
        for kind, level in (("flash", 90), ("ball", 30)):
            picture = np.full((120, 160, 3), level + 10 * index, np.uint8)
            cv2.imwrite(str(raw / name.replace("flash", kind)) + ".png", picture)
    text = (made.session / "session.toml").read_text()
    apart = 'kind = "white"\ndiameter_mm = 90.0\nframes = "raw/ball_*.png"\n'
    (made.session / "session.toml").write_text(text.replace('kind = "white"\ndiameter_mm = 90.0\n', apart))
    balls = [*made.spheres[:2], replace(made.spheres[2], apart=True)]
    made.store.save_spheres(balls, made.camera)
    review = Review.read(made.folder, made.session)
    asked = []
    monkeypatch.setattr("calibrate.calibrate.calibrate", lambda frames, camera, requests, **_: asked.extend(requests))
    before = {path: path.stat().st_mtime_ns for path in made.folder.rglob("*")}
    # One ball fewer than before: the others' numbers shift.
    calibrate_again(review, outlines_of(review)[1:])
    assert {path: path.stat().st_mtime_ns for path in made.folder.rglob("*")} == before
    assert [request.kind for request in asked] == ["chrome", "white"]
    seen = [asked[1].frames.read_pixels(index, np.array([5]), np.array([7]))[0].mean() for index in range(5)]
    np.testing.assert_allclose(seen, (30 + 10 * np.arange(5)) / 255, atol=1e-3)


def test_the_warnings_are_counted_as_the_folder_is_now(reviewing, made):
    window = reviewing(WarningsPanel)
    folder = window.panels[0]._folder
    assert folder.label == "Warnings (1)"
    with open_record(made.folder) as record, record.making("solve", "by the test") as entry:
        entry["warnings"] = ["<img src=x> is *bright*"]
    window.read_again()
    assert folder.label == "Warnings (2)"
    assert "\\<img src\\=x\\>" in window.panels[0]._layers._handles["warnings"][-1].content


def test_a_ball_is_added_where_it_is_clicked(reviewing, settle):
    """The next click is its middle, and no other's; it can be turned into one of the other kind."""
    window = reviewing(PhotographView, BallsPanel)
    client, found, plane = window.client, window.outlines, window.plane

    def click(pixel):
        aim = plane.place(pixel)
        client.clicks(client.seen("/photograph/picture"), ray_origin=aim + [0, 0, 5], ray_direction=[0.0, 0.0, -1.0])
        settle(window)

    click((90.0, 20.0))
    client.says("Add a white ball")
    settle(window)
    click((100.5, 30.25))
    assert window.outlines[:3] == found
    assert window.outlines[3].center_px == pytest.approx((100.5, 30.25))
    assert (window.outlines[3].kind, window.outlines[3].radius_px, window.ball) == ("white", 13.0, 3)
    click((26.0, 92.0))
    assert (len(window.outlines), window.ball) == (4, 2), "the next click chooses a ball again"
    client.says(client.input("kind"), "chrome")
    settle(window)
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "chrome", "white"]
    assert window.outlines[2].is_moved
    client.says("Remove this ball")
    settle(window)
    assert [ball.kind for ball in window.outlines] == ["chrome", "chrome", "white"]
    assert not client.told

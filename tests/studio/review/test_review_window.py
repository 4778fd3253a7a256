"""A review's window without a browser: what is clicked, what is missing, and what is written."""

import threading

import numpy as np
import pytest

from scene import rays
from scene.output_folder import open_record
from studio.review.balls_panel import BallsPanel
from studio.review.frames_panel import FramesPanel, WarningsPanel
from studio.review.photograph_view import PhotographView
from studio.review.result_panels import TwinPanel
from studio.review.review_window import ReviewWindow
from studio.review.spatial_view import SCAN_SIZE, SpatialView
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
    window.open_tab("Twin")
    assert window.beside is None
    assert not window.client.told


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

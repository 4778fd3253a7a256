"""The studio's server: viser on the loopback address, a window for each browser that comes."""

import contextlib
import io
import threading
from collections import deque
from dataclasses import replace
from typing import Any

from scene.errors import SceneError
from studio.background_process import Works
from studio.browser_window import BrowserWindow
from studio.desk import Desk, History
from studio.editor.editor_window import EditorWindow, begun
from studio.editor.files_panel import FilesPanel
from studio.editor.panels import CameraPanel, LightsPanel, MaterialsPanel, ObjectsPanel
from studio.editor.preview import Preview
from studio.editor.preview_panel import PreviewPanel
from studio.editor.scene_view import SceneView
from studio.guarded_server import GuardedServer
from studio.new_session.capture_panels import DiametersPanel, LensPanel, ObjectPanel, PhotographsPanel
from studio.new_session.found_panel import FoundPanel, TextPanel, WritePanel
from studio.new_session.new_session_window import NewSessionWindow
from studio.new_session.photographs_view import PhotographsView
from studio.opening import OpenPanel, OpenWindow
from studio.review.balls_panel import BallsPanel
from studio.review.frames_panel import FramesPanel, WarningsPanel, marks_of
from studio.review.light_sigmas import LightSigmas
from studio.review.photograph_view import PhotographView
from studio.review.result_panels import SolvePanel, TwinPanel, VerdictPanel
from studio.review.review_window import ReviewWindow
from studio.review.run_panel import RunPanel
from studio.review.scan_panel import ScanPanel
from studio.review.shoot_panel import ShootPanel
from studio.review.spatial_view import SpatialView
from studio.tabs import Header, TabbedPanels
from studio.workspace import Workspace

SCENE_TABS = {"Objects": ObjectsPanel, "Material": MaterialsPanel, "Lights": LightsPanel, "Camera": CameraPanel,
              "Dataset": FilesPanel}  # fmt: skip
SESSION_TABS = {"Capture": FramesPanel, "Balls": BallsPanel, "Lights": LightSigmas, "Scan": ScanPanel,
                "Solve": SolvePanel, "Twin": TwinPanel, "Verdict": VerdictPanel}  # fmt: skip
NEW_SESSION_TABS = {"Balls": DiametersPanel, "Photographs": PhotographsPanel, "Camera": LensPanel,
                    "Object": ObjectPanel, "session.toml": TextPanel}  # fmt: skip
PANEL_PX, SHOOT_PX = 430, 820
"""Width of the panels; of a shoot's, which is read from the tripod and has nothing beside it."""
MOST_LEFT = 8
"""Desks of closed windows that wait for the next ones."""


class Studio:
    """A server that runs until it is closed.

    port: 0: one that is free.
    desk: What each browser begins with; None: with nothing opened.
    Raises SceneError: the port is taken, or the address is none of this machine's.
    Who may speak to it, and what may be said, is `guarded_server`'s matter.
    """

    def __init__(
        self, workspace: Workspace, *, host: str = "127.0.0.1", port: int = 8080, desk: Desk | None = None
    ) -> None:
        _check_free(host, port)
        self._workspace, self._first, self._works = workspace, desk or Desk(), Works()
        self._windows: dict[int, BrowserWindow] = {}
        self._adding = threading.Semaphore(2)
        self._left: deque[Desk] = deque(maxlen=MOST_LEFT)
        with contextlib.redirect_stdout(io.StringIO()):
            self._guard = GuardedServer(host, port, label="rgbn studio", verbose=False)
        self._server = self._guard.server
        self._server.scene.set_up_direction("+y")
        self._server.scene.world_axes.visible = False
        # Shadows of the view's own lamps would be taken for those of the scene's lights, and they cost time.
        self._server.scene.configure_default_lights(cast_shadow=False)
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.preview = Preview()
        self._server.on_client_connect(self._come)
        self._server.on_client_disconnect(self._go)

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        host = self._server.get_host()
        return f"http://{f'[{host}]' if ':' in host else host}:{self._server.get_port()}"

    @property
    def windows(self) -> list[BrowserWindow]:
        """Of the browsers that are here."""
        return list(self._windows.values())

    def close(self) -> None:
        """Send the browsers away and stop."""
        windows = self.windows
        self._windows.clear()
        for window in windows:
            window.close()
        for window in windows:
            window.wait()
        self._works.stop_all()
        self.preview.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _come(self, client: Any) -> None:
        if client.client_id not in self._server.get_clients():
            return  # Windows that come and go faster than they get panels leave nothing.
        try:
            desk = self._left.pop()
        except IndexError:
            desk = self._new_desk()
        window = self._window_for(client, desk)
        if desk.has_work:
            window.notify("The work of the window that was closed last", "What was not saved is here as it was.")
        self._put(client, window)

    def _put(self, client: Any, window: BrowserWindow) -> None:
        self._windows[client.client_id] = window
        # What takes time is done in the window's own thread, which tells what is at fault.
        window.post(lambda: self._add_panels(window))
        if client.client_id not in self._server.get_clients():
            self._go(client)

    def _add_panels(self, window: BrowserWindow) -> None:
        # One after the other: windows that come and go would all hold what belongs to half of their panels.
        with self._adding:
            if window.is_gone:
                return
            # Before anything that may fail: from a folder that cannot be read there is a way out.
            window.panels.append(Header(window))
            window.panels[0].refresh()
            window.client.gui.main_panel.dock_right()
            window.client.gui.main_panel.set_width(PANEL_PX)
            if isinstance(window, ReviewWindow):
                self._furnish_session(window)
            elif isinstance(window, NewSessionWindow):
                window.panels.append(FoundPanel(window))
                tabs = TabbedPanels(window, NEW_SESSION_TABS, "Capture", when=lambda: window.capture is not None)
                window.panels += [tabs, WritePanel(window), PhotographsView(window)]
            elif isinstance(window, EditorWindow):
                window.list_files()
                window.panels += [TabbedPanels(window, SCENE_TABS, "Scene"), PreviewPanel(window), SceneView(window)]
            else:
                window.panels.append(OpenPanel(window))  # type: ignore[arg-type]
            if isinstance(window, NewSessionWindow):
                window.open(window.files)
            else:
                window.refresh()

    def _furnish_session(self, window: ReviewWindow) -> None:
        window.address_of = self._guard.page.address_of
        window.read()
        shoot = ShootPanel(window)
        if shoot.is_alone:
            window.client.gui.main_panel.set_width(SHOOT_PX)
            window.panels.append(shoot)
            return
        tabs = TabbedPanels(window, SESSION_TABS, "Steps", lambda: marks_of(window))
        # The tabs say what stands beside the photograph; what tells of files comes after what is looked at.
        warnings, run = WarningsPanel(window), RunPanel(window)
        window.panels += [tabs, PhotographView(window), SpatialView(window), shoot, warnings, run]
        window.open_tab(window.tab)

    def _new_desk(self) -> Desk:
        first = self._first
        scene = first.scene and History(replace(first.scene.state, saved=replace(first.scene.state.saved)))
        return replace(first, tabs={}, captures={}, sittings={}, scene=scene, works=self._works)

    def _window_for(self, client: Any, desk: Desk) -> BrowserWindow:
        place, window = (client, self._workspace, self.preview), None
        if desk.area == "Session" and desk.review is not None:
            window = ReviewWindow(*place, *desk.review, desk)
        elif desk.area == "New session" and desk.looking is not None:
            window = NewSessionWindow(*place, desk.looking, desk)
        elif desk.area == "Scene":
            window = EditorWindow(*place, desk.scene or begun(self._workspace, None, None), desk)
        window = window or OpenWindow(*place, desk)
        window.turn = lambda: self._turn(client, desk)
        return window

    def _turn(self, client: Any, desk: Desk) -> None:
        """Show a browser its desk's area, in another window."""
        if client.client_id in self._windows:
            self._windows[client.client_id].close()
            client.gui.reset()
            client.scene.reset()
            self._put(client, self._window_for(client, desk))

    def _go(self, client: Any) -> None:
        """Close the window of a browser that went away; its desk waits for the next that comes, as after a reload."""
        window = self._windows.pop(client.client_id, None)
        if window is None:
            return
        first = self._first
        if window.desk.has_work or (window.desk.area, window.desk.review) != (first.area, first.review):
            self._left.append(window.desk)
        window.close()


def _check_free(host: str, port: int) -> None:
    """Raise where the port cannot be had: viser would quietly take another."""
    import socket

    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise SceneError(
                f"--host {host} --port {port}: cannot be used ({error.strerror}). Choose another with --port, or 0 for "
                "one that is free."
            ) from error

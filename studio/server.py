"""The studio's server: viser on the loopback address, one browser's window at a time."""

import contextlib
import io
import socket
import threading
from functools import partial
from typing import Any

from scene.errors import SceneError
from studio.browser_window import BrowserWindow
from studio.desk import Desk
from studio.editor.editor_window import EditorWindow, begun
from studio.editor.files_panel import FilesPanel
from studio.editor.panels import CameraPanel, LightsPanel, MaterialsPanel, ObjectsPanel
from studio.editor.preview import Preview
from studio.editor.preview_panel import PreviewPanel
from studio.editor.scene_view import SceneView
from studio.new_session.capture_panels import DiametersPanel, LensPanel, ObjectPanel, PhotographsPanel
from studio.new_session.found_panel import FoundPanel, TextPanel, WritePanel
from studio.new_session.new_session_window import NewSessionWindow
from studio.new_session.photographs_view import PhotographsView
from studio.opening import OpenPanel, OpenWindow
from studio.photograph.waiting import WaitingView
from studio.review.photograph_view import PhotographView
from studio.review.review_window import ReviewWindow
from studio.review.run_panel import RunPanel, WarningsPanel, marks_of
from studio.review.shoot_panel import ShootPanel
from studio.review.spatial_view import SpatialView
from studio.review.step_panels import SESSION_TABS
from studio.served_page import LOOPBACK, ServedPage
from studio.tabs import Header, TabbedPanels
from studio.workspace import Workspace

SCENE_TABS = {"Objects": ObjectsPanel, "Material": MaterialsPanel, "Lights": LightsPanel, "Camera": CameraPanel,
              "Dataset": FilesPanel}  # fmt: skip
NEW_SESSION_TABS = {"Balls": DiametersPanel, "Photographs": PhotographsPanel, "Camera": LensPanel,
                    "Object": ObjectPanel, "session.toml": TextPanel}  # fmt: skip
PANEL_PX, SHOOT_PX = 430, 820
"""Width of the panels; of a shoot's, which is read from the tripod and has nothing beside it."""
ELSEWHERE = "The studio is open in another window, and it has one at a time."


class Studio:
    """A server that runs until it is closed. What is worked on outlives its window: the next one goes on with it.

    port: 0: one that is free.
    desk: What the browser begins with; None: with nothing opened.
    Raises SceneError: the port is taken.
    """

    def __init__(self, workspace: Workspace, *, port: int = 8080, desk: Desk | None = None) -> None:
        _check_free(port)
        self._workspace, self.desk, self.window = workspace, desk or Desk(), None
        self.window: BrowserWindow | None
        self._lock, self.page = threading.RLock(), ServedPage()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server = server = self.page.make_server(port)
        server.scene.set_up_direction("+y")
        server.scene.world_axes.visible = False
        # Shadows of the view's own lamps would be taken for those of the scene's lights, and they cost time.
        server.scene.configure_default_lights(cast_shadow=False)
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        for label, modifier in (("Undo", "cmd/ctrl"), ("Redo", "cmd/ctrl+shift")):
            command = server.gui.add_command(label, hotkey="Z", modifier=modifier)
            command.on_trigger(partial(self._press, label.lower()))
        self.preview = Preview()
        server.on_client_connect(self._come)
        server.on_client_disconnect(self._go)

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        return f"http://{LOOPBACK}:{self._server.get_port()}"

    def close(self) -> None:
        """Send the browser away and stop."""
        with self._lock:
            window, self.window = self.window, None
        if window is not None:
            window.close()
            window.wait()
        if self.desk.work is not None and not self.desk.work.is_over:
            self.desk.work.stop()
        self.preview.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _press(self, verb: str, event: Any) -> None:
        window = self.window
        if window is not None and event.client_id == window.client.client_id:
            window.post(getattr(window, verb))

    def _come(self, client: Any) -> None:
        with self._lock:
            if self.window is None:
                self._show(client)
            else:
                self._offer(client)
            if client.client_id not in self._server.get_clients():
                self._go(client)

    def _go(self, client: Any) -> None:
        """Let a browser go. One that waits takes its place: a page that is loaded again may come before it goes."""
        with self._lock:
            if self.window is None or self.window.client.client_id != client.client_id:
                return
            self.window.close()
            self.window = None
            waiting = [one for number, one in self._server.get_clients().items() if number != client.client_id]
            if waiting:
                self._show(waiting[-1])

    def _offer(self, client: Any) -> None:
        """Tell a browser that another one is at work here, and let it take over."""
        client.gui.reset()
        client.scene.reset()
        client.gui.add_markdown(ELSEWHERE)
        client.gui.add_button("Work in this window").on_click(lambda event: self._take_over(client))

    def _take_over(self, client: Any) -> None:
        with self._lock:
            before = self.window
            self._show(client)
            if before is not None and before.client.client_id in self._server.get_clients():
                self._offer(before.client)

    def _show(self, client: Any) -> None:
        """Show a browser what is worked on, in a window of its area."""
        if self.window is not None:
            self.window.close()
        client.gui.reset()
        client.scene.reset()
        self.window = window = self._make_window(client)
        window.turn = partial(self._turn, window)
        # What takes time is done in the window's own thread, which tells what is at fault.
        window.post(lambda: self._add_panels(window))

    def _turn(self, window: BrowserWindow) -> None:
        with self._lock:
            if self.window is window:
                self._show(window.client)

    def _make_window(self, client: Any) -> BrowserWindow:
        desk, place = self.desk, (client, self._workspace, self.preview)
        if desk.area == "Session" and desk.review is not None:
            return ReviewWindow(*place, *desk.review, desk)
        if desk.area == "New session" and desk.looking is not None:
            return NewSessionWindow(*place, desk.looking, desk)
        if desk.area == "Scene":
            return EditorWindow(*place, desk.scene or begun(self._workspace, None, None), desk)
        return OpenWindow(*place, desk)

    def _add_panels(self, window: BrowserWindow) -> None:
        # Before anything that may fail: from a folder that cannot be read there is a way out.
        window.panels.append(Header(window))
        window.panels[0].refresh()
        window.client.gui.main_panel.dock_right()
        window.client.gui.main_panel.set_width(PANEL_PX)
        if isinstance(window, ReviewWindow):
            self._furnish_session(window)
        elif isinstance(window, NewSessionWindow):
            first = lambda: next(iter(window.files.photographs.get("flash", ())), None)  # noqa: E731
            window.panels += [FoundPanel(window), WaitingView(window, lambda: window.is_looking, first)]
            tabs = TabbedPanels(window, NEW_SESSION_TABS, when=lambda: window.capture is not None)
            window.panels += [tabs, WritePanel(window), PhotographsView(window)]
            window.open(window.files)
        elif isinstance(window, EditorWindow):
            window.list_files()
            window.panels += [TabbedPanels(window, SCENE_TABS), PreviewPanel(window), SceneView(window)]
        elif isinstance(window, OpenWindow):
            window.panels.append(OpenPanel(window))
        window.refresh()

    def _furnish_session(self, window: ReviewWindow) -> None:
        window.address_of = self.page.address_of
        window.read()
        shoot = ShootPanel(window)
        if shoot.is_alone:
            window.client.gui.main_panel.set_width(SHOOT_PX)
            window.panels.append(shoot)
            return
        # The tabs say what stands beside the photograph; what tells of files comes after what is looked at.
        tabs = TabbedPanels(window, SESSION_TABS, lambda: marks_of(window.review))
        warnings, run = WarningsPanel(window), RunPanel(window)
        window.panels += [tabs, PhotographView(window), SpatialView(window), shoot, warnings, run]


def _check_free(port: int) -> None:
    """Raise where the port cannot be had: viser would quietly take another."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((LOOPBACK, port))
        except OSError as error:
            raise SceneError(
                f"--port {port}: cannot be used ({error.strerror}). Choose another, or 0 for one that is free."
            ) from error

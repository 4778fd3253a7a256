"""The studio's server: viser on the loopback address, a window for each browser that comes."""

import contextlib
import io
import threading
from collections import deque
from pathlib import Path
from typing import Any

from scene.errors import SceneError
from studio.browser_window import BrowserWindow
from studio.editor.camera_panel import CameraPanel, PreviewPanel
from studio.editor.editor_window import EditorWindow, History, begun
from studio.editor.edits import start_scene
from studio.editor.files_panel import FilesPanel
from studio.editor.lights_panel import LightsPanel
from studio.editor.materials_panel import MaterialsPanel
from studio.editor.objects_panel import ObjectsPanel
from studio.editor.preview import Preview
from studio.editor.scene_view import SceneView
from studio.guarded_server import GuardedServer
from studio.new_session.capture_panels import DiametersPanel, LensPanel, ObjectPanel, PhotographsPanel
from studio.new_session.found_panel import FoundPanel
from studio.new_session.looking import Looking
from studio.new_session.new_session_window import NewSessionWindow
from studio.new_session.photographs_view import PhotographsView
from studio.new_session.write_panel import WritePanel
from studio.results.panel import ResultsPanel
from studio.review.balls_panel import BallsPanel
from studio.review.frames_panel import FramesPanel, WarningsPanel
from studio.review.hemisphere import HemispherePanel
from studio.review.photograph_view import PhotographView
from studio.review.review_window import ReviewWindow
from studio.review.run_panel import RunPanel
from studio.review.scan_panel import ScanPanel
from studio.review.spatial_view import SpatialView
from studio.review.twin_panel import TwinPanel
from studio.workspace import Workspace
from twin.description.description import TwinScene

EDITOR_TABS = {"Objects": ObjectsPanel, "Material": MaterialsPanel, "Lights": LightsPanel, "Camera": CameraPanel,
               "File": FilesPanel}  # fmt: skip
REVIEW_TABS = {"Frames": FramesPanel, "Balls": BallsPanel, "Lights": HemispherePanel, "Scan": ScanPanel,
               "Twin": TwinPanel, "Results": ResultsPanel, "Warnings": WarningsPanel, "Run": RunPanel}  # fmt: skip
NEW_SESSION_TABS = {"Balls": DiametersPanel, "Photographs": PhotographsPanel, "Camera": LensPanel,
                    "Object": ObjectPanel, "Write": WritePanel}  # fmt: skip
WARM = -1
"""The window of nobody."""
MOST_LEFT = 8
"""Scenes of closed windows that wait for the next ones."""


class Studio:
    """A server that runs until it is closed.

    port: 0: one that is free.
    scene: What each browser begins with; None: a new scene.
    folder: Of that scene.
    review: An output folder and its session (None: the one that it names), to be reviewed instead of a scene.
    looking: Folders without session.toml, in which sessions are begun instead.
    Raises SceneError: the port is taken, or the address is none of this machine's.
    Who may speak to it, and what may be said, is `guarded_server`'s matter.
    """

    def __init__(
        self,
        workspace: Workspace,
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        scene: TwinScene | None = None,
        folder: Path | None = None,
        review: tuple[Path, Path | None] | None = None,
        looking: Looking | None = None,
    ) -> None:
        _check_free(host, port)
        self._looking = looking
        self._workspace, self._scene, self._folder, self._review = workspace, scene, folder, review
        self._windows: dict[int, BrowserWindow] = {}
        self._adding = threading.Semaphore(2)
        self._left: deque[History] = deque(maxlen=MOST_LEFT)
        with contextlib.redirect_stdout(io.StringIO()):
            self._guard = GuardedServer(host, port, label="rgbn studio", verbose=False)
        self._server = self._guard.server
        self._server.scene.set_up_direction("+y")
        self._server.scene.world_axes.visible = False
        # Shadows of the view's own lamps would be taken for those of the scene's lights, and they cost time.
        self._server.scene.configure_default_lights(cast_shadow=False)
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.preview = Preview()
        # Kernels are compiled before the first browser waits for them.
        if review is None and looking is None:
            self.preview.request(WARM, scene or start_scene(), 0, lambda drawn: self.preview.forget(WARM))
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
        self.preview.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _come(self, client: Any) -> None:
        if client.client_id not in self._server.get_clients():
            return  # Windows that come and go faster than they get panels leave nothing.
        self._put(client, self._window_for(client))

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
            if isinstance(window, ReviewWindow):
                window.read()
                _add_tabs(window, REVIEW_TABS, width=480)
                # The twin's panel says what stands beside the photograph.
                views: tuple[Any, ...] = (PhotographView, SpatialView)
            elif isinstance(window, NewSessionWindow):
                window.panels.append(FoundPanel(window))
                window.tabs = _add_tabs(window, NEW_SESSION_TABS, width=480, visible=False)
                views = (PhotographsView,)
            else:
                assert isinstance(window, EditorWindow)
                window.list_files()
                window.panels.append(PreviewPanel(window))
                _add_tabs(window, EDITOR_TABS, width=340)
                views = (SceneView,)
            if not window.is_gone:
                window.panels += [view(window) for view in views]
                window.refresh()
            if isinstance(window, NewSessionWindow):
                window.open(window.files)

    def _window_for(self, client: Any) -> BrowserWindow:
        place, looking = (client, self._workspace, self.preview), self._looking
        review = self._review or (looking and looking.only_session)
        if review:
            return ReviewWindow(*place, *review)
        if looking is not None:
            return NewSessionWindow(*place, looking, lambda *review: self._turn(client, ReviewWindow(*place, *review)))
        try:
            history = self._left.pop()
        except IndexError:
            return EditorWindow(*place, begun(self._workspace, self._scene, self._folder))
        window = EditorWindow(*place, history)
        window.notify("The scene of the window that was closed last", "File, New scene: begins anew.")
        return window

    def _turn(self, client: Any, window: BrowserWindow) -> None:
        """Show a browser this window instead of its own."""
        if client.client_id in self._windows:
            self._windows[client.client_id].close()
            client.gui.reset()
            client.scene.reset()
            self._put(client, window)

    def _go(self, client: Any) -> None:
        """Close the window of a browser that went away; its scene waits for the next that comes, as after a reload."""
        window = self._windows.pop(client.client_id, None)
        if window is None:
            return
        if isinstance(window, EditorWindow) and (window.history.past or window.history.future):
            self._left.append(window.history)
        window.close()


def _add_tabs(window: BrowserWindow, panels: dict[str, Any], *, width: int, visible: bool = True) -> Any:
    """Add panels by the words on their tabs, in the order in which they are refreshed; return the group of tabs."""
    gui = window.client.gui
    tabs = gui.add_tab_group(visible=visible)
    for label, panel in panels.items():
        if window.is_gone:
            return tabs
        with tabs.add_tab(label):
            window.panels.append(panel(window))
    gui.main_panel.dock_right()
    gui.main_panel.set_width(width)
    return tabs


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

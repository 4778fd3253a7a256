"""The studio's server: viser on the loopback address, one browser's window at a time."""

import contextlib
import io
import threading
from functools import partial
from typing import Any

from lab.session_place import is_session
from scene.errors import SceneError
from studio.editor.editor_window import EditorWindow
from studio.editor.preview import Preview, PreviewPanel
from studio.editor.scene_rows import SCENE_ROWS
from studio.editor.scene_view import SceneView
from studio.opening import OPEN_ROWS, OpenWindow
from studio.served_page import LOOPBACK, ServedPage
from studio.session.new_session import NEW_ROWS, NewWindow
from studio.session.photograph_view import PhotographView
from studio.session.session_rows import SESSION_ROWS
from studio.session.session_window import SessionWindow
from studio.session.spatial_view import SpatialView
from studio.studio_state import StudioState
from studio.window import Window
from studio.workspace import Workspace

PAGES: dict[type[Window], tuple[Any, ...]] = {
    OpenWindow: (OPEN_ROWS,),
    NewWindow: (NEW_ROWS,),
    SessionWindow: (SESSION_ROWS, [SpatialView, PhotographView]),
    EditorWindow: (SCENE_ROWS, [PreviewPanel, SceneView]),
}
"""What each window shows: its rows of widgets, and its views."""
ELSEWHERE = "The studio is open in another window, and it has one at a time. Load this page again to work here."


class Studio:
    """A server that runs until it is closed. What is worked on outlives its window: the next one goes on with it.

    port: 0: one that is free.
    state: What the browser begins with; None: with nothing opened.
    Raises SceneError: the port is taken.
    """

    def __init__(self, workspace: Workspace, *, port: int = 8080, state: StudioState | None = None) -> None:
        self._workspace, self.state, self.window = workspace, state or StudioState(), None
        self.window: Window | None
        self._lock, self.page, self.preview = threading.RLock(), ServedPage(), Preview()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server = server = self.page.make_server(port)
            if port and server.get_port() != port:
                # viser takes the next one that is free.
                server.stop()
                raise SceneError(f"--port {port}: cannot be used. Choose another, or 0 for one that is free.")
        server.scene.set_up_direction("+y")
        server.scene.world_axes.visible = False
        # Shadows of the view's own lamps would be taken for those of the scene's lights, and they cost time.
        server.scene.configure_default_lights(cast_shadow=False)
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        for label, modifier in (("Undo", "cmd/ctrl"), ("Redo", "cmd/ctrl+shift")):
            command = server.gui.add_command(label, hotkey="Z", modifier=modifier)
            command.on_trigger(partial(self._press, label.lower()))
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
        if self.state.work is not None and not self.state.work.is_over:
            self.state.work.stop()
        self.preview.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _press(self, verb: str, event: Any) -> None:
        window = self.window
        if window is not None and event.client_id == window.client.client_id:
            window.post(getattr(window, verb))

    def _come(self, client: Any) -> None:
        """Work in the browser that came last; the one before is told so."""
        with self._lock:
            if client.client_id not in self._server.get_clients():
                return  # It is gone already.
            before = self.window
            self._show(client)
        if before is not None and before.client is not client:
            before.wait()
            before.client.gui.reset()
            before.client.scene.reset()
            before.client.gui.add_markdown(ELSEWHERE)

    def _go(self, client: Any) -> None:
        with self._lock:
            if self.window is not None and self.window.client.client_id == client.client_id:
                self.window.close()
                self.window = None

    def _show(self, client: Any) -> None:
        """Show a browser what is worked on, in a window of its area."""
        before = self.window
        if before is not None:
            before.close()
        self.window = window = self._make_window(client)
        window.turn = partial(self._turn, window)
        # What takes time is done in the window's own thread, which tells what is at fault.
        window.post(lambda: self._begin(window, before))

    def _begin(self, window: Window, before: Window | None) -> None:
        """Clear a browser's page, which nothing may write meanwhile, and show a window on it."""
        if before is not None and before.client is window.client:
            before.wait()
        window.client.gui.reset()
        window.client.scene.reset()
        window.show(*PAGES[type(window)])

    def _turn(self, window: Window) -> None:
        with self._lock:
            if self.window is window:
                self._show(window.client)

    def _make_window(self, client: Any) -> Window:
        state, place = self.state, (client, self._workspace, self.state)
        if state.area == "Session" and state.session is not None:
            session = state.session[1]
            if session is not None and not is_session(session):
                return NewWindow(*place)
            return SessionWindow(*place, address_of=self.page.address_of)
        return EditorWindow(*place, self.preview) if state.area == "Scene" else OpenWindow(*place)

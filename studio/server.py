"""The studio's server: viser on the loopback address, a desk for each browser that comes."""

import contextlib
import io
import threading
from collections import deque
from pathlib import Path
from typing import Any

from scene.errors import SceneError
from studio.browser_desk import BrowserDesk
from studio.editor.camera_panel import CameraPanel
from studio.editor.desk import Desk, begun
from studio.editor.edits import start_scene
from studio.editor.files_panel import FilesPanel
from studio.editor.history import History
from studio.editor.lights_panel import LightsPanel
from studio.editor.materials_panel import MaterialsPanel
from studio.editor.objects_panel import ObjectsPanel
from studio.editor.preview import Preview
from studio.editor.preview_panel import PreviewPanel
from studio.editor.stage import Stage
from studio.front_door import FrontDoor
from studio.review.panels import furnish
from studio.review.review_desk import ReviewDesk
from studio.workspace import Workspace
from twin.description.description import TwinScene

WARM = -1
"""The desk of nobody."""
MOST_LEFT = 8
"""Scenes of closed windows that wait for the next ones."""


class Studio:
    """A server that runs until it is closed.

    port: 0: one that is free.
    scene: What each browser begins with; None: a new scene.
    folder: Of that scene.
    review: An output folder and its session (None: the one that it names), to be reviewed instead of a scene.
    Raises SceneError: the port is taken, or the address is none of this machine's.
    Who may speak to it, and what may be said, is `front_door`'s matter.
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
    ) -> None:
        _check_free(host, port)
        self._workspace, self._scene, self._folder, self._review = workspace, scene, folder, review
        self._desks: dict[int, BrowserDesk] = {}
        self._furnishing = threading.Semaphore(2)
        self._left: deque[History] = deque(maxlen=MOST_LEFT)
        with contextlib.redirect_stdout(io.StringIO()):
            self._door = FrontDoor(host, port, label="rgbn studio", verbose=False)
        self._server = self._door.server
        self._server.scene.set_up_direction("+y")
        self._server.scene.world_axes.visible = False
        # Shadows of the view's own lamps would be taken for those of the scene's lights, and they cost time.
        self._server.scene.configure_default_lights(cast_shadow=False)
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.preview = Preview()
        # Kernels are compiled before the first browser waits for them.
        if review is None:
            self.preview.wish(WARM, scene or start_scene(), 0, lambda drawn: self.preview.forget(WARM))
        self._server.on_client_connect(self._come)
        self._server.on_client_disconnect(self._go)

    @property
    def address(self) -> str:
        """Where a browser finds it."""
        host = self._server.get_host()
        return f"http://{f'[{host}]' if ':' in host else host}:{self._server.get_port()}"

    @property
    def desks(self) -> list[BrowserDesk]:
        """Of the browsers that are here."""
        return list(self._desks.values())

    def close(self) -> None:
        """Send the browsers away and stop."""
        desks = self.desks
        self._desks.clear()
        for desk in desks:
            desk.close()
        for desk in desks:
            desk.wait()
        self.preview.close()
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _come(self, client: Any) -> None:
        if client.client_id not in self._server.get_clients():
            return  # Windows that come and go faster than they are furnished leave no desks.
        desk = self._desk_for(client)
        self._desks[client.client_id] = desk
        # What takes time is done in the desk's own thread, which tells what is at fault.
        desk.post(lambda: self._furnish(desk))
        if client.client_id not in self._server.get_clients():
            self._go(client)

    def _furnish(self, desk: BrowserDesk) -> None:
        # One after the other: windows that come and go would all hold what belongs to half of their panels.
        with self._furnishing:
            if not desk.is_gone:
                _furnish(desk)

    def _desk_for(self, client: Any) -> BrowserDesk:
        if self._review is not None:
            return ReviewDesk(client, self._workspace, self.preview, *self._review)
        try:
            history = self._left.pop()
        except IndexError:
            return Desk(client, self._workspace, self.preview, begun(self._workspace, self._scene, self._folder))
        desk = Desk(client, self._workspace, self.preview, history)
        desk.tell("The scene of the window that was closed last", "File, New scene: begins anew.")
        return desk

    def _go(self, client: Any) -> None:
        """Close the desk of a browser that went away; its scene waits for the next that comes, as after a reload."""
        desk = self._desks.pop(client.client_id, None)
        if desk is None:
            return
        if isinstance(desk, Desk) and (desk.history.past or desk.history.future):
            self._left.append(desk.history)
        desk.close()


def _furnish(desk: BrowserDesk) -> None:
    """Put the panels on a desk."""
    if isinstance(desk, ReviewDesk):
        furnish(desk)
        return
    assert isinstance(desk, Desk)
    desk.list_files()
    gui = desk.client.gui
    gui.main_panel.dock_right()
    gui.main_panel.set_width(340)
    desk.panels.append(PreviewPanel(desk))
    tabs = gui.add_tab_group()
    for label, panel in (("Objects", ObjectsPanel), ("Material", MaterialsPanel), ("Lights", LightsPanel),
                         ("Camera", CameraPanel), ("File", FilesPanel)):  # fmt: skip
        if desk.is_gone:
            return
        with tabs.add_tab(label):
            desk.panels.append(panel(desk))
    desk.panels.append(Stage(desk))
    desk.refresh()


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

"""The area in which a folder is chosen, and what lies in it is opened."""

from functools import partial
from pathlib import Path
from typing import Any

from studio.browser_window import BrowserWindow
from studio.opening import Kind, entries, kind_of, lay
from studio.widgets import Layers, code

HERE = {"folder": "New session here", "session": "Open this session", "results": "Open these results"}
"""What is done with the folder itself, by what it is."""


class OpenWindow(BrowserWindow):
    """What a browser opens things in: folders below the workspace."""

    area = "Open"

    @property
    def folder(self) -> Path:
        """The one that is looked into."""
        return self.desk.folder or self.workspace.root

    def _refresh_panels(self) -> None:
        for panel in self.panels:
            self.attempt(panel.refresh)

    def look_into(self, folder: Path) -> None:
        """Show another folder of the workspace."""
        self.desk.folder = self.workspace.path(folder)
        self.refresh()

    def open(self, path: Path) -> None:
        """Open something in the area that is for it."""
        lay(self.desk, self.workspace, self.workspace.path(path))
        self.turn()


class OpenPanel:
    """The folders and scenes in a folder; what is to be done with the folder itself."""

    def __init__(self, window: OpenWindow) -> None:
        self._window, gui = window, window.client.gui
        self._layers = Layers()
        self._where = gui.add_markdown("")
        self._up = window.button("One folder up", lambda: window.look_into(window.folder.parent))
        self._begin = window.button(HERE["folder"], lambda: window.open(window.folder), kind="main")
        self._list = gui.add_folder("In this folder")
        window.button("New scene", lambda: window.go("Scene"))

    def refresh(self) -> None:
        """List the folder as it is now."""
        window, folder = self._window, self._window.folder
        self._where.content = (
            f"{code(str(folder))}\n\nChoose a folder of photographs, a session, its output folder, or a scene."
        )
        self._up.visible = folder != window.workspace.root
        self._begin.label = HERE[kind_of(folder) or "folder"]
        found = tuple(entries(folder))
        self._layers.draw("entries", (folder, found), lambda: self._add(found))

    def _add(self, found: tuple[tuple[Path, Kind], ...]) -> list[Any]:
        window = self._window
        with self._list:
            if not found:
                return [window.client.gui.add_markdown("Nothing that can be opened.")]
            return [
                window.button(f"{path.name}/", partial(window.look_into, path))
                if kind == "folder"
                else window.button(f"{path.name}: {kind}", partial(window.open, path))
                for path, kind in found
            ]

"""One browser's window for a scene: the scene with its past, to be undone, and what is selected."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from scene.current import file_digest
from studio.browser_window import BrowserWindow
from studio.desk import Desk, History
from studio.editor.edits import start_document
from studio.editor.preview import Drawn, Preview
from studio.workspace import MOST_FILES, Listing, Workspace
from twin.description.description import TwinScene
from twin.description.scene_toml import SceneDocument

Edit = Callable[[SceneDocument], SceneDocument]
FILE = "scene.toml"


@dataclass(eq=False)
class Saved:
    """What a row of documents is saved as: those that were made of each other by changes share it.

    name: What the browser calls the folder that it is to be saved to.
    folder: Where it was opened from, or saved to last; None: nowhere yet.
    digest: Of its file as it was then: another window may have saved since.
    """

    name: str = "scene"
    folder: Path | None = None
    digest: str | None = None


@dataclass(frozen=True)
class Edited:
    """A document, and what it is saved as."""

    document: SceneDocument
    saved: Saved


def begun(workspace: Workspace, document: SceneDocument | None, folder: Path | None) -> History[Edited]:
    """Return the history of a document, None: a new one, without a past; `folder` is where it was opened from."""
    document, digest = document or start_document(), None if folder is None else file_digest(folder / FILE)
    name = workspace.name(folder) if folder else document.name or "scene"
    return History(Edited(document, Saved(name, folder, digest)))


class EditorWindow(BrowserWindow):
    """What a browser makes a scene on. Its panels call `change`; whatever changed, all panels are refreshed.

    history: The document, and what was done to it; it lies on the desk.
    """

    area = "Scene"

    def __init__(
        self, client: Any, workspace: Workspace, preview: Preview, history: History[Edited], desk: Desk | None = None
    ) -> None:
        super().__init__(client, workspace, preview, desk)
        self.desk.scene = history
        self.object, self.light, self.picked = 0, 0, "object"
        self.listing, self._is_keeping = Listing(), False
        self._scene = self.document, self.document.scene()
        self.show_preview: Callable[[Drawn], None] = lambda drawn: None

    @property
    def history(self) -> History[Edited]:
        """What can be undone."""
        assert self.desk.scene is not None
        return self.desk.scene

    @property
    def document(self) -> SceneDocument:
        """What is edited."""
        return self.history.state.document

    @property
    def scene(self) -> TwinScene:
        """What the document says."""
        if self._scene[0] is not self.document:
            self._scene = self.document, self.document.scene()
        return self._scene[1]

    def change(self, label: str, edit: Edit) -> bool:
        """Make the document another one; return whether it could be. A fault is told, and the document stays."""
        done = self.attempt(lambda: self._do(label, replace(self.history.state, document=edit(self.document))))
        # What could not be done is taken out of the input that asked for it.
        self.refresh()
        return done

    def drag(self, edit: Edit) -> None:
        """Show in the preview what the scene would be; nothing is kept of it."""
        self.attempt(lambda: self._request(edit(self.document).scene()))

    def restore(self, history: History[Any]) -> None:
        """Take a document of the past or of the future."""
        self._keep(history)
        self.refresh()

    def restart(self, label: str, document: SceneDocument, saved: Saved) -> None:
        """Work on another document. It can be taken back as any change can."""
        self.object, self.light = 0, 0
        self._do(label, Edited(document, saved))
        self.refresh()

    def _do(self, label: str, state: Edited) -> None:
        # Raises where the document says no scene.
        self._scene = state.document, state.document.scene()
        self._keep(self.history.did(label, state, time.monotonic(), self._input))

    def select(self, what: str, index: int) -> None:
        """Give an object or a light the gizmo: `what` is "object" or "light"."""
        self.picked = what
        setattr(self, what, index)
        self._keep(self.history)
        self.refresh()

    def on_upload(self, handle: Any, use: Callable[[str], Any]) -> Any:
        """Keep a file that was sent in the workspace, and call `use` with its name there. Return the handle."""

        async def _(event: Any) -> None:
            # The button would keep the content until the next file comes.
            name, content = event.target.value.name, event.target.value.content
            event.target.value.content = b""
            if self._is_keeping:
                self.show_fault(f"{name}: the last file is just being read. Send it again after that.")
            else:
                self._is_keeping = True
                self.post(lambda: use(self._kept(name, content)))

        handle.on_upload(_)
        return handle

    def _kept(self, name: str, content: bytes) -> str:
        self._is_keeping = False
        name = self.workspace.keep_upload(name, content)
        self.list_files()
        return name

    def name_of(self, path: Path) -> str:
        """Return what a file is called: by its place in the workspace, or its name alone."""
        inside = path.resolve().is_relative_to(self.workspace.root)
        return self.workspace.name(path) if inside else path.name

    def list_files(self) -> None:
        """Look for files in the workspace again; the panels' lists show them at the next refresh."""
        self.listing = self.workspace.listing()
        if self.listing.is_cut:
            self.notify(
                "Not every file is listed",
                f"The lists end at {MOST_FILES} files. Start the studio in a smaller folder to see the others.",
            )

    def _refresh_panels(self) -> None:
        with self.client.atomic():
            for panel in self.panels:
                panel.refresh()
        self._request(self.scene)

    def _keep(self, history: History[Edited]) -> None:
        self.desk.scene = history
        self.object = min(self.object, len(self.document.objects) - 1)
        self.light = min(self.light, len(self.scene.lights) - 1)

    def _request(self, scene: TwinScene) -> None:
        self.preview.request(self.client.client_id, scene, min(self.light, len(scene.lights) - 1), self._drawn)

    def _drawn(self, drawn: Drawn) -> None:
        self.post(lambda: self.show_preview(drawn))

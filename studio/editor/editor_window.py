"""One browser's window for a scene: the scene with its past, to be undone, and what is selected."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from studio.browser_window import BrowserWindow
from studio.editor.edits import start_scene
from studio.editor.preview import Drawn, Preview
from studio.workspace import MOST_FILES, Listing, Workspace
from twin.description.description import TwinScene

Edit = Callable[[TwinScene], TwinScene]
LONGEST = 200
TOGETHER_S = 1.0
"""Changes by one input that follow each other faster are undone together: digits typed, a slider drawn."""


@dataclass(eq=False)
class Document:
    """What is saved as one: the scenes that were made of each other by changes share it.

    name: What the browser calls the folder that it is to be saved to.
    folder: Where it was opened from, or saved to last; None: nowhere yet.
    """

    name: str = "scene"
    folder: Path | None = None


Step = tuple[str, TwinScene, Document]


@dataclass(frozen=True)
class History:
    """A scene with its past.

    past, future: The label is of the change that led away from the scene (past), or to it (future).
    last: Of the last change, where an input made it.
    document: Of the scene.
    """

    scene: TwinScene
    past: tuple[Step, ...] = ()
    future: tuple[Step, ...] = ()
    last: tuple[str, Any, float] | None = None
    document: Document = field(default_factory=Document)

    def did(
        self, label: str, scene: TwinScene, now_s: float, control: Any = None, *, document: Document | None = None
    ) -> "History":
        """Return the history after a change.

        control: The input that made it; None: none did, and it is undone alone. document: None: the scene's so far.
        """
        was = self.last if control is not None else None
        goes_on = was is not None and was[:2] == (label, control) and now_s - was[2] < TOGETHER_S and self.past
        past = self.past if goes_on else (*self.past, self._left(label, scene))[-LONGEST:]
        last = None if control is None else (label, control, now_s)
        return History(scene, past, (), last, document or self.document)

    def undone(self) -> "History":
        """Return the history before the last change; itself where there is none."""
        if not self.past:
            return self
        *past, (label, scene, document) = self.past
        return History(scene, tuple(past), (self._left(label, scene), *self.future), document=document)

    def redone(self) -> "History":
        """Return the history with the change that was undone last; itself where there is none."""
        if not self.future:
            return self
        (label, scene, document), *future = self.future
        return History(scene, (*self.past, self._left(label, scene)), tuple(future), document=document)

    def _left(self, label: str, now: TwinScene) -> Step:
        """Return the scene as it is kept when another takes its place: without what it has worked out of itself.

        Two hundred scenes would each keep their vertices in the camera frame.
        """
        vars(self.scene).pop("points", None)
        shared = {id(one) for one in now.objects}
        for one in self.scene.objects:
            if id(one) not in shared:
                vars(one).pop("placed", None)
        return label, self.scene, self.document


def begun(workspace: Workspace, scene: TwinScene | None, folder: Path | None) -> History:
    """Return the history of a scene, None: a new one, without a past; `folder` is where it was opened from."""
    scene = scene or start_scene()
    return History(scene, document=Document(workspace.name(folder) if folder else scene.name, folder))


class EditorWindow(BrowserWindow):
    """What a browser makes a scene on. Its panels call `change`; whatever changed, all panels are refreshed.

    history: The scene, and what was done to it.
    """

    def __init__(self, client: Any, workspace: Workspace, preview: Preview, history: History) -> None:
        super().__init__(client, workspace, preview)
        self.history = history
        self.object, self.light, self.picked = 0, 0, "object"
        self.listing, self._is_keeping = Listing(), False
        self.show_preview: Callable[[Drawn], None] = lambda drawn: None

    @property
    def scene(self) -> TwinScene:
        return self.history.scene

    def change(self, label: str, edit: Edit) -> bool:
        """Make the scene another one; return whether it could be. A fault is told, and the scene stays."""
        now = time.monotonic()
        done = self.attempt(lambda: self._keep(self.history.did(label, edit(self.scene), now, self._input)))
        # What could not be done is taken out of the input that asked for it.
        self.refresh()
        return done

    def drag(self, edit: Edit) -> None:
        """Show in the preview what the scene would be; nothing is kept of it."""
        self.attempt(lambda: self._request(edit(self.scene)))

    def undo(self) -> None:
        """Take the last change back."""
        self._keep(self.history.undone())
        self.refresh()

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        self._keep(self.history.redone())
        self.refresh()

    def restart(self, label: str, scene: TwinScene, document: Document) -> None:
        """Work on another scene. It can be taken back as any change can."""
        self.object, self.light = 0, 0
        self._keep(self.history.did(label, scene, time.monotonic(), document=document))
        self.refresh()

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
                if not self.post(lambda: use(self._kept(name, content)), droppable=True):
                    self._is_keeping = False

        handle.on_upload(_)
        return handle

    def _kept(self, name: str, content: bytes) -> str:
        self._is_keeping = False
        name = self.workspace.keep_upload(name, content)
        self.list_files()
        return name

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

    def _keep(self, history: History) -> None:
        self.history = history
        self.object = min(self.object, len(self.scene.objects) - 1)
        self.light = min(self.light, len(self.scene.lights) - 1)

    def _request(self, scene: TwinScene) -> None:
        self.preview.request(self.client.client_id, scene, min(self.light, len(scene.lights) - 1), self._drawn)

    def _drawn(self, drawn: Drawn) -> None:
        self.post(lambda: self.show_preview(drawn))

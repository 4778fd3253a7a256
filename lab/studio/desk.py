"""One browser's desk: its scene with its past, what is selected, its panels. Nothing of it is shared with another's."""

import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, Protocol

from pydantic import ValidationError

from lab.studio.edits import start_scene
from lab.studio.history import History
from lab.studio.preview import Drawn, Preview
from lab.studio.workspace import Workspace
from scene.errors import SceneError
from twin.description import TwinScene

Edit = Callable[[TwinScene], TwinScene]


class Panel(Protocol):
    """What shows a scene."""

    def refresh(self) -> None:
        """Show the desk's scene as it is now."""
        ...


class Desk:
    """What a browser works on. Its panels call `change`; whatever changed, all panels are refreshed.

    Parameters
    ----------
    client : viser.ClientHandle
    workspace : Workspace
    preview : Preview
    scene : TwinScene or None
        None: a new one.
    folder : Path or None
        Where the scene was opened from, and is saved to.

    Notes
    -----
    Everything runs in the desk's one thread, in the order in which the browser said it.
    """

    def __init__(
        self,
        client: Any,
        workspace: Workspace,
        preview: Preview,
        scene: TwinScene | None = None,
        folder: Path | None = None,
    ) -> None:
        self.client, self.workspace, self.folder = client, workspace, folder
        self.history = History(scene or start_scene())
        self.object, self.light, self.picked = 0, 0, "object"
        self.panels: list[Panel] = []
        self.show_preview: Callable[[Drawn], None] = lambda drawn: None
        self._preview = preview
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=f"desk {client.client_id}")
        self._closers: list[Callable[[], None]] = []
        self._is_gone = False

    @property
    def scene(self) -> TwinScene:
        return self.history.scene

    def change(self, label: str, edit: Edit) -> bool:
        """Make the scene another one; return whether it could be. A fault is told, and the scene stays."""
        return self.attempt(lambda: self._adopt(self.history.did(label, edit(self.scene), time.monotonic())))

    def drag(self, edit: Edit) -> None:
        """Show in the preview what the scene would be; nothing is kept of it."""
        self.attempt(lambda: self._wish(edit(self.scene)))

    def undo(self) -> None:
        """Take the last change back."""
        self._adopt(self.history.undone())

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        self._adopt(self.history.redone())

    def restart(self, scene: TwinScene, folder: Path | None) -> None:
        """Work on another scene, without a past."""
        self.folder, self.object, self.light = folder, 0, 0
        self._adopt(History(scene))

    def select(self, what: str, index: int) -> None:
        """Give an object or a light the gizmo: `what` is "object" or "light"."""
        self.picked = what
        setattr(self, what, index)
        self.refresh()

    def refresh(self) -> None:
        """Show the scene as it is now, everywhere."""
        self.object = min(self.object, len(self.scene.objects) - 1)
        self.light = min(self.light, len(self.scene.lights) - 1)
        with self.client.atomic():
            for panel in self.panels:
                panel.refresh()
        self._wish(self.scene)

    def attempt(self, work: Callable[[], Any]) -> bool:
        """Do something; tell what was at fault, if anything was, and live on."""
        try:
            work()
        except SceneError as error:
            self.tell_fault(str(error))
        except ValidationError as error:
            self.tell_fault("; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()))
        except Exception as error:
            if self._is_gone:
                return False  # There is nobody to show it to: viser warns of every message.
            traceback.print_exc()
            self.tell_fault(f"a fault of the studio, not of the input: {type(error).__name__}: {error}")
        else:
            return True
        return False

    def tell_fault(self, text: str) -> None:
        """Show what was at fault until it is closed."""
        self.client.add_notification("That cannot be done", text, color="red")

    def tell(self, title: str, text: str = "") -> None:
        """Show what was done, for a while."""
        self.client.add_notification(title, text, color="green", auto_close_seconds=8.0)

    def post(self, work: Callable[[], Any]) -> None:
        """Do something in the desk's thread, after what it is at."""
        try:
            self._thread.submit(self.attempt, work)
        except RuntimeError:
            return  # The browser is gone.

    def on_input(self, handle: Any, use: Callable[[Any], Any]) -> Any:
        """Call `use` with the value of an input that a person changes. Return the handle."""

        async def _(event: Any) -> None:
            # What the program writes into an input comes by here too, without a client.
            if event.client is not None:
                value = event.target.value
                self.post(lambda: use(value))

        handle.on_update(_)
        return handle

    def on_click(self, handle: Any, use: Callable[[], Any]) -> Any:
        """Call `use` when a button is pressed. Return the handle."""

        async def _(event: Any) -> None:
            if event.client is not None:
                self.post(use)

        handle.on_click(_)
        return handle

    def on_upload(self, handle: Any, use: Callable[[str], Any]) -> Any:
        """Keep a file that was sent in the workspace, and call `use` with its name there. Return the handle."""

        async def _(event: Any) -> None:
            sent = event.target.value
            self.post(lambda: use(self.workspace.keep_upload(sent.name, sent.content)))

        handle.on_upload(_)
        return handle

    def on_close(self, work: Callable[[], None]) -> None:
        """Do something when the browser goes away."""
        self._closers.append(work)

    def close(self) -> None:
        """End what runs for a browser that went away."""
        self._is_gone = True
        self._preview.forget(self.client.client_id)
        for work in self._closers:
            work()
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _adopt(self, history: History) -> None:
        self.history = history
        self.refresh()

    def _wish(self, scene: TwinScene) -> None:
        self._preview.wish(self.client.client_id, scene, min(self.light, len(scene.lights) - 1), self._drawn)

    def _drawn(self, drawn: Drawn) -> None:
        self.post(lambda: self.show_preview(drawn))

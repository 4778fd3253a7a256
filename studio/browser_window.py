"""What each area's window has: a thread that does what the browser says in order, panels, and words for faults."""

import traceback
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.errors import SceneError
from studio.desk import Area, Desk, History
from studio.editor.preview import Preview
from studio.workspace import Workspace

Array = NDArray[np.float64]
KINDS = {"main": "blue", "other": "gray", "danger": "red"}
"""Colours of buttons: the one that a tab is for, others, and those that destroy; `page/studio.css` makes them plain."""


class BrowserWindow:
    """An area of the studio as the browser shows it.

    What the browser says is done in the window's one thread, in the order in which it was said. A rendering, a run of
    the steps and a look for balls have threads or processes of their own, which come back by `post`.
    """

    area: Area = "Open"
    is_flat = False
    """Whether a photograph is shown, which is moved and not turned."""
    report = ""
    """Address of the report that lies over the view."""

    def __init__(self, client: Any, workspace: Workspace, preview: Preview, desk: Desk | None = None) -> None:
        self.client, self.workspace, self.preview = client, workspace, preview
        self.desk = desk or Desk()
        self.turn: Callable[[], Any] = lambda: None
        """Shows the desk's area, in another window."""
        self.panels: list[Any] = []
        """What is shown: each has a `refresh`."""
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=f"window {client.client_id}")
        self._inputs: deque[Any] = deque()
        """Those that a person has changed, and nothing has been done yet about it."""
        self._input: Any = None
        self._is_behind = False
        self.is_gone = False
        """Another window has taken its place: nothing more is done for it."""

    def refresh(self) -> None:
        """Show everything as it is now; while more input waits, after that.

        An input that is being typed into would else be given the number that it had a moment ago.
        """
        self._is_behind = bool(self._inputs)
        if not self._is_behind:
            self._refresh_panels()

    def _refresh_panels(self) -> None:
        for panel in self.panels:
            self.attempt(panel.refresh)

    @property
    def tab(self) -> str:
        """The tab that is open."""
        return self.desk.tabs.get(self.area, "")

    @tab.setter
    def tab(self, name: str) -> None:
        self.desk.tabs[self.area] = name

    def open_tab(self, name: str) -> None:
        """Turn to a tab."""
        self.tab = name
        self.refresh()

    def go(self, area: Area) -> None:
        """Turn to another area."""
        self.desk.area = area
        self.turn()

    @property
    def history(self) -> History[Any] | None:
        """What can be undone; None: nothing can be changed here."""
        return None

    def restore(self, history: History[Any]) -> None:
        """Take a state of the past, or of the future, and show it."""
        raise NotImplementedError

    def undo(self) -> None:
        """Take the last change back."""
        if self.history is not None:
            self.restore(self.history.undone())

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        if self.history is not None:
            self.restore(self.history.redone())

    def attempt(self, work: Callable[[], Any]) -> bool:
        """Do something, unless the window is gone; tell what was at fault, if anything was, and live on."""
        if self.is_gone:
            return False
        try:
            work()
        except SceneError as error:
            self.show_fault(str(error))
        except Exception as error:
            if not self.is_gone:  # Else there is nobody to show it to.
                traceback.print_exc()
                self.show_fault(f"a fault of the studio, not of the input: {type(error).__name__}: {error}")
        else:
            return True
        return False

    def show_fault(self, text: str) -> None:
        """Show what was at fault until it is closed."""
        self.client.add_notification("That cannot be done", text, color="red")

    def notify(self, title: str, text: str = "") -> None:
        """Show what was done, for a while."""
        self.client.add_notification(title, text, color="green", auto_close_seconds=8.0)

    def post(self, work: Callable[[], Any]) -> None:
        """Do something in the window's thread, after what it is at."""
        with suppress(RuntimeError):  # It is gone.
            self._thread.submit(self.attempt, work)

    def on_input(self, handle: Any, use: Callable[[Any], Any]) -> Any:
        """Call `use` with the value of an input as a person has changed it. Return the handle.

        The input itself may hold another value by then.
        """

        async def _(event: Any) -> None:
            # What the program writes into an input comes by here too, without a client.
            if event.client is not None:
                value = event.target.value
                self._inputs.append(handle)
                self.post(lambda: self._take(use, value))

        handle.on_update(_)
        return handle

    def _take(self, use: Callable[[Any], Any], value: Any) -> None:
        self._input = self._inputs.popleft()
        try:
            use(value)
        finally:
            self._input = None
            if self._is_behind:
                self.refresh()

    def on(
        self, listen: Callable[..., Any], use: Callable[..., Any], said: Callable[[Any], tuple] = lambda event: ()
    ) -> None:
        """Call `use` at each event of a person's that `listen` is given a listener of, such as `handle.on_click`.

        said: Given the event as it comes, returns what `use` is called with; default: nothing.
        """

        async def _(event: Any) -> None:
            if event.client is not None:
                values = said(event)
                self.post(lambda: use(*values))

        listen(_)

    def button(self, label: str, use: Callable[[], Any], kind: str = "other", **look: Any) -> Any:
        """Add a button that calls `use`; kind: a key of `KINDS`. Return the handle."""
        handle = self.client.gui.add_button(label, **{"color": KINDS[kind], **look})
        self.on(handle.on_click, use)
        return handle

    def on_ray(self, handle: Any, use: Callable[[Array, Array], Any]) -> None:
        """Call `use` with origin and direction (3,) of the ray by which something in the view is clicked."""
        self.on(handle.on_click, use, lambda event: (np.array(event.ray_origin), np.array(event.ray_direction)))

    def look(self, middle: ArrayLike, away: ArrayLike) -> None:
        """Look at a point (3,) of the view from `away` (3,) of it, y upward."""
        camera, middle = self.client.camera, np.asarray(middle, np.float64)
        camera.position, camera.look_at, camera.up_direction = np.add(middle, away), middle, (0.0, 1.0, 0.0)

    def look_straight(self, middle: ArrayLike, wide: float, high: float) -> None:
        """Look along z at what stands about a point (3,) in the plane of x and y, so near that all of it is seen."""
        camera = self.client.camera
        tangent = np.tan(camera.fov / 2)
        self.look(middle, [0.0, 0.0, 0.54 * max(high / tangent, wide / (tangent * max(camera.aspect, 0.3)))])

    def close(self) -> None:
        """Do nothing more: what waits is dropped, and what is at work is let come to an end."""
        if not self.is_gone:
            self.is_gone = True
            self._thread.submit(self.preview.forget, self.client.client_id)
            self._thread.shutdown(wait=False)

    def wait(self) -> None:
        """Return when everything has ended, after `close`."""
        self._thread.shutdown(wait=True)

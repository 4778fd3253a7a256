"""What each area's window has: a thread that does what the browser says in order, panels, and words for faults."""

import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.errors import SceneError
from studio.studio_state import Area, Edits, History, RunningJob, StudioState, Work
from studio.tabs import HEADER
from studio.widgets import Panel, Row
from studio.workspace import Workspace

Array = NDArray[np.float64]
PANEL_PX = 430
"""Width of the panels."""
EVERY_S = 1.0
"""So often a window looks at what goes on in the background."""


class Window:
    """An area of the studio as the browser shows it.

    What the browser says is done in the window's one thread, in the order in which it was said. A rendering, a run of
    the steps and a look for balls have threads or processes of their own, which the window looks at every second.
    """

    area: Area = "Open"
    first_tab = ""
    """The tab that is open first."""
    edited: Path | str = ""
    """Where the state has what is put right or made here."""
    is_flat = False
    """Whether a photograph is shown, which is moved and not turned."""
    report = ""
    """Address of the report that lies over the view."""
    work_told = ""
    """What came of the last work, as Markdown."""

    def __init__(self, client: Any, workspace: Workspace, state: StudioState | None = None) -> None:
        self.client, self.workspace, self.state = client, workspace, state or StudioState()
        self.turn: Callable[[], Any] = lambda: None
        """Shows the state's area, in another window."""
        self.panels: list[Any] = []
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=f"window {client.client_id}")
        self._inputs: deque[Any] = deque()
        """Those that a person has changed, and nothing has been done yet about it."""
        self._input: Any = None
        self._is_behind, self._gone = False, threading.Event()
        self._is_ticking, self._told = False, set[str]()

    @property
    def is_gone(self) -> bool:
        """Whether another window has taken its place: nothing more is done for it."""
        return self._gone.is_set()

    def show(self, rows: Sequence[Row], views: Sequence[Callable[[Any], Any]] = ()) -> None:
        """Begin with a page of rows, and with views, each of which has a `refresh`."""
        # The way out stands before anything that may fail.
        self.panels.append(Panel(self, HEADER))
        self.panels[0].refresh()
        self.begin()
        self.client.gui.main_panel.dock_right()
        self.client.gui.main_panel.set_width(PANEL_PX)
        self.panels += [Panel(self, rows), *(view(self) for view in views)]
        self.refresh()

        def follow() -> None:
            while not self._gone.wait(EVERY_S):
                self.post(self._tick)

        threading.Thread(target=follow, daemon=True).start()

    def begin(self) -> None:
        """Read what is to be shown."""

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

    def choose(self, **changes: Any) -> None:
        """Look at something else that is kept here, by its names; what is not said stays."""
        assert vars(self).keys() >= changes.keys()
        vars(self).update(changes)
        self.refresh()

    def _tick(self) -> None:
        self._is_ticking = True
        try:
            self.look_again()
        finally:
            self._is_ticking = False

    def look_again(self) -> None:
        """Show what goes on in the background: how far the work is, and once how it ended; and what else is new."""
        work = self.work
        is_new = work is not None and not work.is_told
        if work is not None and is_new and work.is_over:
            work.is_told = True
            if work.fault:
                self.show_fault(work.fault)
            elif not work.is_stopped:
                self.state.work = None
                self.work_ended()
        if self.follow() or is_new:
            self.refresh()

    def follow(self) -> bool:
        """Look at what goes on beside the work; return whether there is anything new to be shown."""
        return False

    @property
    def tab(self) -> str:
        """The tab that is open."""
        return self.state.tabs.get(self.area, self.first_tab)

    @tab.setter
    def tab(self, name: str) -> None:
        self.state.tabs[self.area] = name

    def open_tab(self, name: str) -> None:
        """Turn to a tab."""
        self.tab = name
        self.refresh()

    def go(self, area: Area) -> None:
        """Turn to another area."""
        self.state.area = area
        self.turn()

    @property
    def edits(self) -> Edits | None:
        """What is put right or made here, and what is kept of it; it outlives the window."""
        return self.state.edits.get(self.edited)

    @property
    def history(self) -> History[Any] | None:
        """What can be undone; None: nothing can be changed here."""
        return self.edits.history if self.edits else None

    def did(self, label: str, state: Any, held_s: float | None = None) -> None:
        """Take another state. held_s: When the hand took what it drags; all of a drag is undone together."""
        if self.edits is not None:
            now_s = time.monotonic() if held_s is None else held_s
            self.edits.history = self.edits.history.did(label, state, now_s, self._input or held_s)

    def undo(self) -> None:
        """Take the last change back."""
        if self.edits is not None:
            self.edits.history = self.edits.history.undone()
            self.refresh()

    def redo(self) -> None:
        """Make the change again that was taken back last."""
        if self.edits is not None:
            self.edits.history = self.edits.history.redone()
            self.refresh()

    def job(self) -> RunningJob | None:
        """Return what the window's button begins; None: it has none."""
        return None

    def work_ended(self) -> None:
        """Show what came of it."""

    @property
    def work(self) -> Work | None:
        """What writes the window's folder, or wrote it last."""
        work, job = self.state.work, self.job()
        return work if work is not None and job is not None and work.folder == job.folder else None

    @property
    def is_busy(self) -> bool:
        """Whether the folder is being written."""
        return self.work is not None and not self.work.is_over

    def begin_work(self) -> None:
        """Begin. Raises SceneError: something is at work, which takes all of the machine."""
        other = self.state.work
        if other is not None and not other.is_over:
            raise SceneError(f"{other.folder.name}: {other.label} is at work. Stop it first, or wait.")
        if job := self.job():
            # Saving may give the folder its place.
            words, job = job.words(), self.job() or job
            self.state.work = Work(job.label, job.folder, words, self.workspace.root)
        self.refresh()

    def attempt(self, work: Callable[[], Any]) -> None:
        """Do something, unless the window is gone; tell what was at fault, if anything was, and live on."""
        try:
            if not self.is_gone:
                work()
        except SceneError as error:
            self.show_fault(str(error))
        except Exception as error:
            if not self.is_gone:  # Else there is nobody to show it to.
                traceback.print_exc()
                self.show_fault(f"a fault of the studio, not of the input: {type(error).__name__}: {error}")

    def show_fault(self, text: str) -> None:
        """Show what was at fault until it is closed; once, where nobody did anything."""
        if self._is_ticking and text in self._told:
            return
        self._told.add(text)
        self.client.add_notification("That cannot be done", text, color="red")

    def notify(self, title: str, text: str = "") -> None:
        """Show what was done, for a while."""
        self.client.add_notification(title, text, color="green", auto_close_seconds=8.0)

    def post(self, work: Callable[[], Any]) -> None:
        """Do something in the window's thread, after what it is at."""
        with suppress(RuntimeError):  # It is gone.
            self._thread.submit(self.attempt, work)

    def on_input(self, handle: Any, use: Callable[[Any], Any]) -> None:
        """Call `use` with the value of an input as a person has changed it: it may hold another value by then."""

        async def _(event: Any) -> None:
            # What the program writes into an input comes by here too, without a client.
            if event.client is not None:
                value = event.target.value
                self._inputs.append(handle)
                self.post(lambda: self._take(use, value))

        handle.on_update(_)

    def _take(self, use: Callable[[Any], Any], value: Any) -> None:
        self._input = self._inputs.popleft()
        try:
            use(value)
        except SceneError:
            # What could not be done is taken out of the input that asked for it.
            self._is_behind = True
            raise
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
        self._gone.set()
        self._thread.shutdown(wait=False)

    def wait(self) -> None:
        """Return when everything has ended, after `close`."""
        self._thread.shutdown(wait=True)

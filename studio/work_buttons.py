"""The button that begins work on a folder, the one that stops it, and how far it is."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scene.errors import SceneError
from studio.background_process import Work
from studio.browser_window import KINDS, BrowserWindow
from studio.widgets import plain


class WorkButtons:
    """A button that begins work on a folder, one that stops it, a bar and what it says.

    folder: Returns the one that is written. begin: Returns the process' arguments; it raises SceneError where it cannot
    be begun. ended: Called where it ended well, while this window looked on. heard: Called with each line that it says.
    left_s: Returns how long it will still take, about; None: that is not known.
    """

    def __init__(
        self, window: BrowserWindow, label: str, folder: Callable[[], Path], begin: Callable[[], Sequence[str]],
        ended: Callable[[], Any], heard: Callable[[str], Any] = lambda line: None,
        left_s: Callable[[], float | None] = lambda: None,
    ) -> None:  # fmt: skip
        self._window, self._folder, self._begin, self._ended, self._heard = window, folder, begin, ended, heard
        self._left_s = left_s
        self._start = window.button(label, self.start, kind="main")
        self._stop = window.button("Stop", self._halt, kind="danger", visible=False)
        self._bar = window.client.gui.add_progress_bar(0, visible=False, animated=True)
        self.text = window.client.gui.add_markdown("")

    @property
    def _work(self) -> Work | None:
        """What writes the folder, or wrote it last."""
        work = self._window.desk.work
        return work if work is not None and work.folder == self._folder() else None

    @property
    def is_busy(self) -> bool:
        """Whether the folder is being written."""
        return self._work is not None and not self._work.is_over

    def start(self) -> None:
        """Begin. Raises SceneError: something is at work, which takes all of the machine."""
        desk = self._window.desk
        if desk.work is not None and not desk.work.is_over:
            raise SceneError(f"{desk.work.folder.name}: {desk.work.label} is at work. Stop it first, or wait.")
        arguments = self._begin()
        desk.work = Work(self._start.label, self._folder(), arguments, self._told)
        self._show()

    def refresh(self, label: str, *, disabled: bool = False, is_main: bool = True) -> None:
        """Show what is at work on the folder; `label` is what would be begun."""
        self._start.label, self._start.color = label, KINDS["main" if is_main else "other"]
        if self._work is not None:
            # Begun before the page was loaded again, it is told here from now on.
            self._work.told = self._told
        self._show()
        self._start.disabled = self.is_busy or disabled

    def _told(self, line: str) -> None:
        self._window.post(lambda: self._take(line))

    def _take(self, line: str) -> None:
        self._show()
        if line:
            self._heard(line)
        elif self._work is not None and self._work.fault:
            self._window.show_fault(self._work.fault)
        elif self._work is not None and not self._work.is_stopped:
            self._window.desk.work, self.text.content = None, ""
            self._ended()

    def _halt(self) -> None:
        if self._work is not None:
            self._work.stop()

    def _show(self) -> None:
        work = self._work
        self._stop.visible = self._bar.visible = self._start.disabled = self.is_busy
        if work is None:
            return
        self._bar.value = 100 * work.share
        if not work.is_over:
            said = "\n".join(f"- {plain(text)}" for text in work.said)
            left_s, spent_s = self._left_s(), time.monotonic() - work.begun_s
            left = "" if left_s is None else f", roughly {max(left_s, 5.0) / 60:.1f} min left"
            self.text.content = f"**{plain(work.label)}**, {spent_s:.0f} s so far{left}\n\n{said}"
        elif work.is_stopped:
            self.text.content = f"Stopped. What is done is kept; **{plain(work.label)}** goes on from there."
        elif work.fault:
            self.text.content = f"**Stopped by a fault.** {plain(work.fault)}"

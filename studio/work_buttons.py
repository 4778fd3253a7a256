"""The button that begins work on a folder, the one that stops it, and how far it is."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from studio.background_process import Work
from studio.browser_window import KINDS, BrowserWindow
from studio.widgets import plain


class WorkButtons:
    """A button that begins work on a folder, one that stops it, a bar and what it says.

    folder: Returns the one that is written. begin: Returns the process' arguments; it raises SceneError where it cannot
    be begun. ended: Called where it ended well, while this window looked on. heard: Called with each line that it says.
    """

    def __init__(
        self, window: BrowserWindow, label: str, folder: Callable[[], Path], begin: Callable[[], Sequence[str]],
        ended: Callable[[], Any], heard: Callable[[str], Any] = lambda line: None,
    ) -> None:  # fmt: skip
        self._window, self._folder, self._begin, self._ended, self._heard = window, folder, begin, ended, heard
        self._start = window.button(label, self.start, kind="main")
        self._stop = window.button("Stop", self._halt, kind="danger", visible=False)
        self._bar = window.client.gui.add_progress_bar(0, visible=False, animated=True)
        self.text = window.client.gui.add_markdown("")
        self._seen: Work | None = None
        """What is looked on at."""

    @property
    def is_busy(self) -> bool:
        """Whether the folder is being written."""
        work = self._window.desk.works.of(self._folder())
        return work is not None and not work.is_over

    def start(self) -> None:
        """Begin, unless it is at work."""
        arguments = self._begin()
        self._seen = self._window.desk.works.begin(self._folder(), self._start.label, arguments, self._told)
        self._show()

    def refresh(self, label: str, *, disabled: bool = False, is_main: bool = True) -> None:
        """Show what is at work on the folder; `label` is what would be begun."""
        self._start.label, self._start.color = label, KINDS["main" if is_main else "other"]
        work = self._window.desk.works.of(self._folder())
        if work is not None and not work.is_over:
            # Begun before the page was loaded again, it is told here from now on.
            self._seen, work.told = work, self._told
        self._show(disabled)

    def _told(self, line: str) -> None:
        self._window.post(lambda: self._take(line))

    def _take(self, line: str) -> None:
        work, self._seen = self._seen, None if not line else self._seen
        self._show_work(work)
        if line:
            self._heard(line)
        elif work is not None and work.fault:
            self._window.show_fault(work.fault)
        elif work is not None and not work.is_stopped:
            self.text.content = ""
            self._ended()

    def _halt(self) -> None:
        if self._seen is not None:
            self._seen.stop()

    def _show(self, disabled: bool = False) -> None:
        self._start.disabled = self.is_busy or disabled
        self._stop.visible = self._bar.visible = self.is_busy
        if self._seen is not None:
            self._show_work(self._seen)

    def _show_work(self, work: Work | None) -> None:
        if work is None:
            return
        self._stop.visible = self._bar.visible = self._start.disabled = not work.is_over
        self._bar.value = 100 * work.share
        if not work.is_over:
            said = "\n".join(f"- {plain(text)}" for text in work.said)
            self.text.content = f"**{plain(work.label)}**, {work.seconds:.0f} s so far\n\n{said}"
        elif work.is_stopped:
            self.text.content = f"Stopped. What is done is kept; **{plain(work.label)}** goes on from there."
        elif work.fault:
            self.text.content = f"**Stopped by a fault.** {plain(work.fault)}"

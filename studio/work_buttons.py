"""The button that begins work on a folder, in whichever window: what is at work there is shown in all of them."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from studio.background_process import Work
from studio.browser_window import KINDS, BrowserWindow
from studio.widgets import plain


class WorkButtons:
    """A button that begins work on a folder, one that stops it, a bar and what it says.

    folder: Returns the one that is written. begin: Returns the process' arguments; it raises SceneError where it cannot
    be begun. ended: Called where it ended well, while this window looked on.
    """

    def __init__(
        self, window: BrowserWindow, label: str, folder: Callable[[], Path], begin: Callable[[], Sequence[str]],
        ended: Callable[[], Any],
    ) -> None:  # fmt: skip
        self._window, self._folder, self._begin, self._ended = window, folder, begin, ended
        self._start = window.button(label, self.start, kind="main")
        self._stop = window.button("Stop", self._halt, kind="danger", visible=False)
        self._bar = window.client.gui.add_progress_bar(0, visible=False)
        self.text = window.client.gui.add_markdown("")
        self._seen: Work | None = None
        window.on_close(lambda: self._watch(None))

    @property
    def is_busy(self) -> bool:
        """Whether the folder is being written, by whatever window it was begun."""
        work = self._window.desk.works.of(self._folder())
        return work is not None and not work.is_over

    def start(self) -> None:
        """Begin, unless it is at work."""
        arguments = self._begin()
        self._watch(self._window.desk.works.begin(self._folder(), self._start.label, arguments))
        self._show()

    def refresh(self, label: str, *, disabled: bool = False, is_main: bool = True) -> None:
        """Show what is at work on the folder; `label` is what would be begun."""
        self._start.label, self._start.color = label, KINDS["main" if is_main else "other"]
        work = self._window.desk.works.of(self._folder())
        if work is not None and not work.is_over and work is not self._seen:
            self._watch(work)
        self._show(disabled)

    def _watch(self, work: Work | None) -> None:
        if self._seen is not None and self._changed in self._seen.watchers:
            self._seen.watchers.remove(self._changed)
        self._seen = work
        if work is not None:
            work.watchers.append(self._changed)

    def _changed(self) -> None:
        self._window.post(self._show)

    def _halt(self) -> None:
        if self._seen is not None:
            self._seen.stop()

    def _show(self, disabled: bool = False) -> None:
        work = self._seen
        is_busy = self._stop.visible = self._bar.visible = work is not None and not work.is_over
        self._start.disabled = is_busy or disabled
        if work is None:
            return
        self._bar.value = 100 * work.share
        said = "\n".join(f"- {plain(text)}" for text in work.said)
        if is_busy:
            self.text.content = f"**{plain(work.label)}**\n\n{said}"
        elif work.is_stopped:
            self.text.content = f"Stopped. What is done is kept; **{plain(work.label)}** goes on from there."
        elif work.fault:
            self.text.content = f"**Stopped by a fault.** {plain(work.fault)}"
        if not is_busy and work.watchers.count(self._changed):
            work.watchers.remove(self._changed)
            if work.fault:
                self._window.show_fault(work.fault)
            elif not work.is_stopped:
                self.text.content = ""
                self._ended()

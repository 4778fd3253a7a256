"""Work of the command line in a process of its own: it can be stopped, and what breaks it spares the studio."""

import re
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from scene.errors import SceneError
from scene.rooms import ROOT
from studio.browser_window import BrowserWindow
from studio.widgets import plain

LINES = 8
"""The last ones that are shown."""


class BackgroundProcess:
    """Python at work with these arguments. All that is told comes from a thread of this.

    said: Called with each line of the standard error.
    ended: Called at the end with an empty text, or with what was at fault; not after `stop`.
    """

    def __init__(self, arguments: Sequence[str], said: Callable[[str], Any], ended: Callable[[str], Any]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._is_stopped = False
        self._reader = threading.Thread(target=self._read, args=(said, ended), daemon=True)
        self._reader.start()

    def stop(self) -> None:
        """End the process; what it has done is kept, and the same work goes on from there."""
        self._is_stopped = True
        self._process.terminate()
        self.wait()

    def wait(self) -> None:
        """Return when the process has ended and everything was told."""
        self._reader.join()

    def _read(self, said: Callable[[str], Any], ended: Callable[[str], Any]) -> None:
        lines = []
        with self._process:
            for line in self._process.stderr or ():
                lines.append(line.rstrip())
                said(line.strip())
        code = self._process.returncode
        if not self._is_stopped:
            ended("" if code == 0 else _fault(lines) or f"the process ended with code {code}.")


def _fault(lines: list[str]) -> str:
    """Return the message that ended the process: from the line that the command line begins with its name."""
    starts = [number for number, line in enumerate(lines) if line.startswith("rgbn: ")]
    return "\n".join(lines[starts[-1] :] if starts else lines[-12:]).removeprefix("rgbn: ")


class WorkButtons:
    """Buttons that begin work in a process, one work at a time; one that stops it, a bar and what it says.

    works: By the words on a button, what returns the process' arguments; it raises SceneError where it cannot be begun.
    ended: Called where it ended well. idle: Called whenever nothing is at work any more.
    """

    def __init__(
        self, window: BrowserWindow, works: Mapping[str, Callable[[], Sequence[str]]], ended: Callable[[], Any],
        idle: Callable[[], Any] = lambda: None,
    ) -> None:  # fmt: skip
        self._window, self._label, self._ended, self._idle = window, "", ended, idle
        gui = window.client.gui
        self._starts = [
            window.button(label, partial(self._start, label, begin), color="green") for label, begin in works.items()
        ]
        self._stop = window.button("Stop", self._halt, color="red", disabled=True)
        self._bar = gui.add_progress_bar(0, visible=False)
        self.text = gui.add_markdown("")
        self._process: BackgroundProcess | None = None
        self._said: list[str] = []
        window.on_close(lambda: self._process and self._process.stop())

    @property
    def is_busy(self) -> bool:
        return self._process is not None

    def check_idle(self) -> None:
        """Raise SceneError while something is at work."""
        if self.is_busy:
            raise SceneError(f"{self._label}: it is at work. Stop it first, or wait.")

    def disable(self, is_disabled: bool) -> None:
        """Let nothing be begun, or let it again."""
        for button in self._starts:
            button.disabled = is_disabled

    def _start(self, label: str, begin: Callable[[], Sequence[str]]) -> None:
        self.check_idle()
        arguments, post, self._label = begin(), self._window.post, label
        self._said, self._bar.value, self.text.content = [], 0, "At work ..."
        self._process = BackgroundProcess(
            arguments, lambda line: post(lambda: self._tell(line)), lambda fault: post(lambda: self._end(fault))
        )
        self._show()

    def _tell(self, line: str) -> None:
        if not self.is_busy:
            return
        if count := re.search(r": (\d+) of (\d+)", line):
            self._bar.value = 100 * int(count[1]) / max(int(count[2]), 1)
            # A count takes the place of the one before it.
            self._said = [text for text in self._said if not text.startswith(line[: count.start(1)])]
        self._said = [*self._said, line][-LINES:]
        self.text.content = "\n".join(f"- {plain(text)}" for text in self._said)

    def _end(self, fault: str) -> None:
        self._rest()
        if fault:
            self.text.content = f"**Stopped by a fault.** {plain(fault)}"
            self._window.show_fault(fault)
        else:
            self._ended()

    def _halt(self) -> None:
        if self._process is not None:
            self._process.stop()
            self._rest()
            self.text.content = f"Stopped. What is done is kept; **{self._label}** goes on from there."

    def _rest(self) -> None:
        self._process = None
        self._show()
        self._idle()

    def _show(self) -> None:
        self.disable(self.is_busy)
        self._bar.visible = self.is_busy
        self._stop.disabled = not self.is_busy

"""Work of the command line in a process of its own: it can be stopped, and what breaks it spares the studio."""

import re
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scene.errors import SceneError
from scene.rooms import ROOT

LINES = 8
"""The last ones that are shown."""
MOST_AT_WORK = 4
"""Processes of a studio at a time."""


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


class Work:
    """One piece of work in a process, as it stands: whoever looks at it is told of each change.

    said: What it said last. share: How much of what it is at is done, 0 to 1.
    fault: Why it ended badly. watchers: Called, in whatever thread, when something changed.
    """

    def __init__(self, label: str, arguments: Sequence[str]) -> None:
        self.label, self.said, self.share = label, list[str](), 0.0
        self.fault, self.is_over, self.is_stopped = "", False, False
        self.watchers: list[Callable[[], Any]] = []
        self._process = BackgroundProcess(arguments, self._tell, self._end)

    def stop(self) -> None:
        """End it."""
        self.is_stopped = self.is_over = True
        self._process.stop()
        self._changed()

    def _tell(self, line: str) -> None:
        if count := re.search(r": (\d+) of (\d+)", line):
            self.share = int(count[1]) / max(int(count[2]), 1)
            # A count takes the place of the one before it.
            self.said = [text for text in self.said if not text.startswith(line[: count.start(1)])]
        self.said = [*self.said, line][-LINES:]
        self._changed()

    def _end(self, fault: str) -> None:
        self.fault, self.is_over = fault, True
        self._changed()

    def _changed(self) -> None:
        for tell in list(self.watchers):
            tell()


class Works:
    """What is at work in a studio, by the folder that it writes: it goes on when the page that began it is closed."""

    def __init__(self) -> None:
        self._works: dict[Any, Work] = {}
        self._lock = threading.Lock()

    def of(self, folder: Path) -> Work | None:
        """Return what writes a folder, or wrote it last."""
        return self._works.get(folder)

    def begin(self, folder: Path, label: str, arguments: Sequence[str]) -> Work:
        """Begin something. Raises SceneError: the folder is being written, or too much is at work."""
        with self._lock:
            busy = [work for work in self._works.values() if not work.is_over]
            if (known := self._works.get(folder)) in busy and known is not None:
                raise SceneError(f"{folder.name}: {known.label} is at work. Stop it first, or wait.")
            if len(busy) >= MOST_AT_WORK:
                raise SceneError(f"{len(busy)} things are at work, the most at a time. Wait for one, or stop one.")
            self._works[folder] = work = Work(label, arguments)
        return work

    def stop_all(self) -> None:
        """End everything."""
        for work in list(self._works.values()):
            if not work.is_over:
                work.stop()

"""Work of the command line in a process of its own: it can be stopped, and what breaks it spares the studio."""

import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scene.rooms import ROOT
from studio.widgets import Row, button, plain, text

LINES = 8
"""The last ones that are shown."""
RGBN = "from lab import progress; progress.EVERY_S = 1.0; from rgbn.cli import main; main()"
"""The command line, which tells a page of work under way more often than a log."""


@dataclass(frozen=True)
class Job:
    """What a window's button begins.

    folder: That is written. words: Makes those of the command line; it raises SceneError where it cannot be begun.
    is_main: It is what the tab is for. is_possible: Something to work on is there.
    """

    label: str
    folder: Path
    words: Callable[[], list[str]]
    is_main: bool = True
    is_possible: bool = True


class Work:
    """The command line at work with these words on a folder; a window looks at it once a second.

    said: What it said last. share: How much of what it is at is done, 0 to 1. fault: Why it ended badly.
    is_told: A window has shown how it ended.
    """

    def __init__(self, label: str, folder: Path, words: Sequence[str]) -> None:
        self.label, self.folder, self.said, self.share, self.fault = label, folder, list[str](), 0.0, ""
        self.is_over = self.is_stopped = self.is_told = False
        self.begun_s = time.monotonic()
        self._process = subprocess.Popen(
            [sys.executable, "-c", RGBN, *words], cwd=ROOT, text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )  # fmt: skip
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def stop(self) -> None:
        """End it; what it has done is kept, and the same work goes on from there."""
        self.is_stopped = True
        self._process.terminate()
        self.wait()

    def wait(self) -> None:
        """Return when it has ended."""
        self._reader.join()

    def _read(self) -> None:
        lines = []
        with self._process:
            for line in self._process.stderr or ():
                lines.append(line.rstrip())
                self._hear(line.strip())
        if not self.is_stopped and (code := self._process.returncode):
            # From the line that the command line begins with its name.
            start = max((number for number, line in enumerate(lines) if line.startswith("rgbn: ")), default=-12)
            self.fault = "\n".join(lines[start:]).removeprefix("rgbn: ") or f"the process ended with code {code}."
        self.is_over = True

    def _hear(self, line: str) -> None:
        label, _, rest = line.partition(":")
        if count := re.match(r" (\d+) of (\d+)", rest):
            self.share = int(count[1]) / max(int(count[2]), 1)
        # How far something is takes the place of how far it was.
        is_state = count or " s so far" in rest
        known = [text for text in self.said if not (is_state and text.startswith(f"{label}:"))]
        self.said = [*known, line][-LINES:]

    @property
    def state(self) -> str:
        """How far it is, as Markdown."""
        if not self.is_over:
            said = "\n".join(f"- {plain(text)}" for text in self.said)
            return f"**{plain(self.label)}**, {time.monotonic() - self.begun_s:.0f} s so far\n\n{said}"
        if self.is_stopped:
            return f"Stopped. What is done is kept; **{plain(self.label)}** goes on from there."
        return f"**Stopped by a fault.** {plain(self.fault)}" if self.fault else ""


def _start(window: Any) -> dict[str, Any]:
    job = window.job()
    is_free = job.is_possible and not window.is_busy
    return {"label": job.label, "kind": "main" if job.is_main else "other", "disabled": not is_free}


def _bar(window: Any) -> dict[str, Any]:
    return {"visible": window.is_busy, "value": 100 * window.work.share if window.is_busy else 0.0}


WORK_ROWS = (
    button("Run", lambda window: window.begin_work(), _start, kind="main"),
    button("Stop", lambda window: window.work.stop(), lambda window: {"visible": window.is_busy},
           kind="danger", visible=False),
    Row("progress_bar", show=_bar, start={"value": 0, "visible": False, "animated": True}),
    text(lambda window: window.work.state if window.work else window.work_told),
)  # fmt: skip
"""The button that begins the window's work on a folder, the one that stops it, and how far it is."""

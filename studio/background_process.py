"""Work of the command line in a process of its own: it can be stopped, and what breaks it spares the studio."""

import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from scene.rooms import ROOT

LINES = 8
"""The last ones that are shown."""


class Work:
    """Python at work with these arguments on a folder, as it stands.

    said: What it said last. share: How much of what it is at is done, 0 to 1. fault: Why it ended badly.
    told: Called from a thread of its own with each line, and with an empty one when it has ended.
    """

    def __init__(self, label: str, folder: Path, arguments: Sequence[str], told: Callable[[str], Any]) -> None:
        self.label, self.folder, self.told, self.said, self.share = label, folder, told, list[str](), 0.0
        self.fault, self.is_over, self.is_stopped = "", False, False
        self.begun_s = time.monotonic()
        self._process = subprocess.Popen(
            [sys.executable, *arguments],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def stop(self) -> None:
        """End it; what it has done is kept, and the same work goes on from there."""
        self.is_stopped = True
        self._process.terminate()
        self.wait()

    def wait(self) -> None:
        """Return when it has ended and everything was told."""
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
        self.told("")

    def _hear(self, line: str) -> None:
        label, _, rest = line.partition(":")
        if count := re.match(r" (\d+) of (\d+)", rest):
            self.share = int(count[1]) / max(int(count[2]), 1)
        # How far something is takes the place of how far it was.
        is_state = count or " s so far" in rest
        known = [text for text in self.said if not (is_state and text.startswith(f"{label}:"))]
        self.said = [*known, line][-LINES:]
        self.told(line)

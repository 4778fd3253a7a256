"""What is worked on in a studio, over all areas, with its past: it outlives a reload and a change of the area."""

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, TypeVar, get_args

from scene.current import ROOT

LINES = 8
"""The last ones that are shown."""
RGBN = "from lab import progress; progress.EVERY_S = 1.0; from rgbn.cli import main; main()"
"""The command line, which tells a page of work under way more often than a log."""


@dataclass(frozen=True)
class RunningJob:
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

    place: Where it is at work: results of `rgbn init` go to `out` there.
    said: What it said last. share: How much of what it is at is done, 0 to 1. fault: Why it ended badly.
    is_told: A window has shown how it ended.
    """

    def __init__(self, label: str, folder: Path, words: Sequence[str], place: Path = ROOT) -> None:
        self.label, self.folder, self.said, self.share, self.fault = label, folder, list[str](), 0.0, ""
        self.is_over = self.is_stopped = self.is_told = False
        self.begun_s = time.monotonic()
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", RGBN, *words], cwd=place, env=os.environ | {"PYTHONPATH": str(ROOT)},
            text=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
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
        elif not self.is_stopped:
            # What ends sooner than it speaks has not said that all is done.
            self.share = 1.0
        self.is_over = True

    def _hear(self, line: str) -> None:
        label, _, rest = line.partition(":")
        if count := re.match(r" (\d+) of (\d+)", rest):
            self.share = int(count[1]) / max(int(count[2]), 1)
        # How far something is takes the place of how far it was.
        is_state = count or " s so far" in rest
        known = [text for text in self.said if not (is_state and text.startswith(f"{label}:"))]
        self.said = [*known, line][-LINES:]


State = TypeVar("State")
LONGEST = 200
"""Changes that can be taken back."""
TOGETHER_S = 1.0
"""Changes by one input that follow each other faster are undone together: digits typed, a slider drawn."""


@dataclass(frozen=True)
class History(Generic[State]):
    """A state with its past.

    past, future: The label is of the change that led away from the state (past), or to it (future).
    last: Of the last change, where an input made it.
    """

    state: State
    past: tuple[tuple[str, State], ...] = ()
    future: tuple[tuple[str, State], ...] = ()
    last: tuple[str, Any, float] | None = None

    def did(self, label: str, state: State, now_s: float, control: Any = None) -> "History[State]":
        """Return the history after a change.

        now_s: When it was made; of a drag, when that began.
        control: The input or the drag that made it; None: none did, and it is undone alone.
        """
        was = self.last if control is not None else None
        goes_on = was is not None and was[:2] == (label, control) and now_s - was[2] < TOGETHER_S and self.past
        past = self.past if goes_on else (*self.past, (label, self.state))[-LONGEST:]
        return History(state, past, (), None if control is None else (label, control, now_s))

    def undone(self) -> "History[State]":
        """Return the history before the last change; itself where there is none."""
        if not self.past:
            return self
        *past, (label, state) = self.past
        return History(state, tuple(past), ((label, self.state), *self.future))

    def redone(self) -> "History[State]":
        """Return the history with the change that was undone last; itself where there is none."""
        if not self.future:
            return self
        (label, state), *future = self.future
        return History(state, (*self.past, (label, self.state)), tuple(future))


Area = Literal["Open", "Session", "Scene"]
AREAS: tuple[Area, ...] = get_args(Area)


SCENE = "Scene"
"""Names the scene among the edits."""


@dataclass(eq=False)
class Edits:
    """What is put right in a session, or made as a scene; kept: What of it is in a session's files."""

    history: History[Any]
    kept: Any = None


@dataclass(eq=False)
class StudioState:
    """What is worked on; there is one for a studio.

    area: The one that is shown.
    tabs: The open tab of each page.
    folder: That is looked into to open something; None: the workspace.
    session: Output folder and session that is looked at, or the folder in which one is begun; None for the second: the
        one that the output folder names.
    edits: By output folder, or the folder in which a session is begun, what was put right there; and the `SCENE`.
    work: What is at work in the background, or was last.
    """

    area: Area = "Open"
    tabs: dict[str, str] = field(default_factory=dict)
    folder: Path | None = None
    session: tuple[Path, Path | None] | None = None
    edits: dict[Path | str, Edits] = field(default_factory=dict)
    work: Work | None = None

    def show_session(self, out: Path, session: Path | None, *, tab: str = "Capture") -> None:
        """Go to a session."""
        self.area, self.session = "Session", (out, session)
        self.tabs["Session"] = tab

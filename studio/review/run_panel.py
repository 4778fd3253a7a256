"""The button that runs the session's steps up to the open tab, what comes of it, and what the steps warned of."""

import re
import time
from functools import partial
from pathlib import Path
from typing import Any

from lab.options import Settings
from scene.output_folder import read_record
from studio.review.folder import Review, is_kept
from studio.review.review_window import ReviewWindow
from studio.review.warned import STEPS, Warned
from studio.widgets import Layers, code, plain
from studio.work_buttons import WorkButtons

SHARES = {"check": 2, "calibrate": 8, "align": 55, "solve": 3, "twin": 30, "compare": 2}
"""Of a whole run's time, %, on the demo's session; of another one roughly."""
FEWEST_PERCENT = 10
"""Of which the rest is told."""
MOST = 60
"""Warnings that are listed; more would only be scrolled through."""


class RunPanel:
    """Run up to the step of the tab; under Verdict all of them. What a step has made is shown when it has ended."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window = window
        self._what = window.client.gui.add_markdown("")
        self._keep = window.button("Keep", window.write_kept, visible=False, hint="For a later run")
        self._spent_s: dict[str, float] = {}
        """By the steps that ended in this run."""
        self._last_s, self._waits = 0.0, list[str]()
        self._work = WorkButtons(
            window, "Run", lambda: window.folder, self._arguments, window.read_again, self._hear, self._left_s
        )
        if window.desk.to_run:
            window.desk.to_run = ""
            window.post(lambda: None if self._work.is_busy else self._work.start())

    def refresh(self) -> None:
        """Say what would be run."""
        window, review = self._window, self._window.review
        label = "Run everything" if window.tab == "Verdict" else f"Run up to {window.tab}"
        self._work.refresh(label, disabled=review.session is None)
        self._keep.visible = not window.is_kept_so
        self._what.content = plain(review.why_no_session) if review.session is None else self._text()

    def _text(self) -> str:
        window, session = self._window, self._window.review.session
        assert session is not None
        note = "as its session.toml says"
        if not window.is_kept_so:
            note = "with what you corrected, which is kept first"
        elif is_kept(window.review.store):
            note = "with the balls and picks that were kept"
        told = f"**{plain(session.name)}**, {note}. What is done and current is not done again."
        programs = _programs(window.folder)
        return told + (f" Other programs, as before: {', '.join(map(code, programs))}." if programs else "")

    def _arguments(self) -> list[str]:
        window = self._window
        session = window.session_to_run()
        self._spent_s, self._waits = {}, list(SHARES)[: list(SHARES).index(STEPS[window.tab]) + 1]
        return ["-m", "studio.studio_run", STEPS[window.tab], str(session.resolve()), str(window.folder)]

    def _hear(self, line: str) -> None:
        ended = re.match(r"(\w+): (\d+\.\d) s", line)
        if ended and ended[1] in SHARES:
            self._spent_s[ended[1]], self._last_s = float(ended[2]), time.monotonic()
            self._window.read_again()

    def _left_s(self) -> float | None:
        """Return how long the steps that are to come take, if they take as large a share as usual."""
        ended = sum(SHARES[step] for step in self._spent_s)
        if ended < FEWEST_PERCENT:
            return None
        waits = sum(SHARES[step] for step in self._waits if step not in {*self._spent_s, *self._window.review.done})
        return sum(self._spent_s.values()) * waits / ended - (time.monotonic() - self._last_s)


def _programs(folder: Path) -> tuple[str, ...]:
    """Return the command lines of other programs that a run would start: a folder from elsewhere may name any."""
    record = read_record(folder)
    return () if record is None else Settings.of(record).external or ()


class WarningsPanel:
    """What the steps of the open tab warned of, under Verdict all; a press goes to the frame or the ball."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._layers = window, Layers()
        self._folder = window.client.gui.add_folder("Warnings", visible=False)

    def refresh(self) -> None:
        """List the warnings of the folder as it was read."""
        self._layers.draw("warnings", (self._window.reading, self._window.tab), self._list)

    def _list(self) -> list[Any]:
        window, handles = self._window, []
        found = warnings_of(window.review, window.tab)
        self._folder.label, self._folder.visible = f"Warnings ({len(found)})", bool(found)
        with self._folder:
            for one in found[:MOST]:
                handles += self._add(one)
            if len(found) > MOST:
                handles.append(window.client.gui.add_markdown(f"{len(found) - MOST} more are in report.html."))
        return handles

    def _add(self, one: Warned) -> list[Any]:
        window, frames = self._window, self._window.review.material.frames
        handles = [window.client.gui.add_markdown(f"**{plain(one.step)}**: {plain(one.text)}")]
        for frame in one.frames[:4]:
            assert frames is not None
            handles.append(window.button(f"Show {frames.names[frame]}", partial(self._show_frame, frame)))
        if one.ball is not None:
            handles.append(window.button(f"Show ball {one.ball + 1}", partial(window.choose_ball, one.ball)))
        return handles

    def _show_frame(self, frame: int) -> None:
        self._window.frame = frame
        self._window.open_tab("Capture")


def warnings_of(review: Review, tab: str) -> list[Warned]:
    """Return the warnings that stand on a tab: each on the first one of its step; all of them under Verdict."""
    first = {step: name for name, step in reversed(STEPS.items())}
    return [one for one in review.warnings if tab in ("Verdict", first.get(one.step))]


def marks_of(review: Review) -> dict[str, str]:
    """Return what stands behind the names of the tabs: a tick where the step is done, and how many warnings it has."""
    counts = {tab: 0 if tab == "Verdict" else len(warnings_of(review, tab)) for tab in STEPS}
    return {
        tab: f"⚠{counts[tab]}" if counts[tab] else "✓" if step in review.done else "" for tab, step in STEPS.items()
    }

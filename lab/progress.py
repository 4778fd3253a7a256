"""Progress of long work: a bar on a terminal, plain lines elsewhere."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lab.streams import is_quiet, say

__all__ = ["alive", "progress_bar", "say"]

EVERY_S = 10.0
"""A log gets a line of work under way so often at most, and twice as seldom at least."""


class _Log:
    """Lines for a log: of units done, and, while a long one goes on, that it does."""

    def __init__(self) -> None:
        self.last = time.monotonic()

    def line(self, text: str, *, after_s: float) -> None:
        """Print a line if nothing was said for so long."""
        now = time.monotonic()
        if now - self.last > after_s:
            self.last = now
            say(f"  {text}")


_LOG = _Log()


@contextmanager
def alive(label: str, state: Callable[[], str] = lambda: "at work") -> Iterator[None]:
    """Say at least every 20 seconds, off a terminal, that the work of a block goes on."""
    if sys.stderr.isatty() or is_quiet():
        yield
        return
    start, done = time.monotonic(), threading.Event()
    _LOG.last = start

    def tell() -> None:
        while not done.wait(EVERY_S / 10):
            seconds = time.monotonic() - start
            _LOG.line(f"{label}: {state()}, {seconds:.0f} s so far", after_s=1.5 * EVERY_S)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a callback (done, total) for one piece of work; shown on standard error."""
    if is_quiet():
        yield lambda done, total: None
    elif sys.stderr.isatty():
        yield from _bar(label)
    else:
        yield from _lines(label)


def _bar(label: str) -> Iterator[Callable[[int, int], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:24}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _lines(label: str) -> Iterator[Callable[[int, int], None]]:
    first: tuple[float, int] | None = None
    state = "at work"

    def report(done: int, total: int) -> None:
        nonlocal first, state
        now = time.monotonic()
        # What was done before, by a run that was stopped, tells nothing of the speed.
        first = first or (now, done)
        state = f"{done} of {total}"
        if done < total:
            left = (now - first[0]) / (done - first[1]) * (total - done) if done > first[1] else None
            _LOG.line(f"{label}: {state}{_in_words(left)}", after_s=EVERY_S)

    with alive(label, lambda: state):
        yield report


def _in_words(seconds: float | None) -> str:
    if seconds is None:
        return ""
    return f", about {seconds:.0f} s left" if seconds < 100 else f", about {seconds / 60:.0f} min left"

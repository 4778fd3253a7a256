"""Progress of long work: a bar on a terminal, plain lines elsewhere."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a callback (done, total) for one piece of work; shown on standard error."""
    if sys.stderr.isatty():
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
    # A log wants to know that work goes on, not each of a thousand units: a line every ten seconds at most.
    last = time.monotonic()
    first: tuple[float, int] | None = None

    def report(done: int, total: int) -> None:
        nonlocal last, first
        now = time.monotonic()
        # What was done before, by a run that was stopped, tells nothing of the speed.
        first = first or (now, done)
        if now - last > 10 and done < total:
            last = now
            left = (now - first[0]) / (done - first[1]) * (total - done) if done > first[1] else None
            print(f"  {label}: {done} of {total}{_in_words(left)}", file=sys.stderr, flush=True)

    yield report


def _in_words(seconds: float | None) -> str:
    if seconds is None:
        return ""
    return f", about {seconds:.0f} s left" if seconds < 100 else f", about {seconds / 60:.0f} min left"


def say(text: str) -> None:
    """Print one line for people; standard output stays free for --json."""
    print(text, file=sys.stderr, flush=True)

"""How far a sweep is: cells done, cells failed, time left."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lab.progress import say

EVERY_S = 10.0


@contextmanager
def cell_progress(total: int) -> Iterator[Callable[[int, int], None]]:
    """Yield a callback (cells done, of them failed): a bar on a terminal, a line now and then elsewhere."""
    if sys.stderr.isatty():
        yield from _bar(total)
    else:
        yield from _lines(total)


def _bar(total: int) -> Iterator[Callable[[int, int], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:24}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("cells", total=total)
        yield lambda done, failed: bar.update(task, completed=done, description=_words(failed))


def _lines(total: int) -> Iterator[Callable[[int, int], None]]:
    start = last = time.monotonic()

    def report(done: int, failed: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last > EVERY_S and done < total:
            last = now
            left = (now - start) / done * (total - done)
            say(f"  {_words(failed)}: {done} of {total}, {_duration(left)} left")

    yield report


def _words(failed: int) -> str:
    return f"cells, {failed} failed" if failed else "cells"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"

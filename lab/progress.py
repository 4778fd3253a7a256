"""What is said while at work: progress of long work, lines for people; streams that are closed, full or ASCII.

Neither breaks a run nor loses its exit code. A bar on a terminal, plain lines elsewhere.
"""

import contextlib
import io
import logging
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lab.run_log import log
from scene.errors import SceneError

EVERY_S = 10.0
"""A log gets a line of work under way so often at most, and twice as seldom at least."""


def open_streams() -> None:
    """Put the null device in the place of closed streams: the next file opened would take their number and words."""
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        if getattr(sys, name) is None:
            null = open(os.devnull, mode)  # noqa: SIM115 (for as long as the process lives)
            try:
                os.fstat(number)
            except OSError:
                os.dup2(null.fileno(), number)
            setattr(sys, name, null)
    if sys.stdout is sys.__stdout__ and isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal without umlauts or box lines gets their codes.
        sys.stdout = _Output(
            sys.stdout.buffer, sys.stdout.encoding, "backslashreplace", line_buffering=sys.stdout.line_buffering
        )


class _Output(io.TextIOWrapper):
    """Standard output that tells a full disk in one message."""

    def write(self, text: str, /) -> int:
        with _telling():
            return super().write(text)

    def flush(self) -> None:
        with _telling():
            super().flush()


@contextmanager
def _telling() -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        raise SceneError(f"standard output cannot be written ({error.strerror}). Give it another place.") from error


def check_words(words: list[str]) -> None:
    """Raise SceneError for a word that cannot be meant.

    One that is not UTF-8: no file that rgbn writes could repeat it. An empty one: as a path it is the current folder.
    """
    for number, word in enumerate(words):
        if not word or (word.startswith("--") and word.endswith("=")):
            before = word.rstrip("=") or (words[number - 1] if number else "rgbn")
            raise SceneError(
                f"{before}: nothing is given after it. Was a variable of the shell not set? For the current folder "
                "write a dot."
            )
        try:
            word.encode()
        except UnicodeEncodeError:
            raise SceneError(f"{word!r}: is a name that is not UTF-8. Rename the file or folder.") from None


_quiet = threading.Event()


def keep_quiet(quiet: bool) -> None:
    """From now on say only warnings and errors, or again all."""
    _quiet.set() if quiet else _quiet.clear()


def is_quiet() -> bool:
    """Whether only warnings and errors are said."""
    return _quiet.is_set()


class _Teller(logging.Handler):
    """What is logged: all goes into the run's log; what is ours, Python's warnings, or wanted, is said too."""

    wanted, of = False, ""

    def emit(self, record: logging.LogRecord) -> None:
        ours, warned = record.name.partition(".")[0] == "rgbn", record.levelno >= logging.WARNING
        level = f"{record.levelname.lower()}: " if warned else ""
        text = f"{self.of if warned else ''}{level}{'' if ours else f'{record.name}: '}{record.getMessage().rstrip()}"
        if self.wanted or (warned and (ours or record.name == "py.warnings")):
            say(text, always=warned)
        else:
            log(text)


_TELLER = _Teller()


def log_to(*, verbose: bool, of: str = "") -> None:
    """Take what is logged into the run's log; with `verbose`, say it too, and what is of interest beside warnings.

    of: What stands before a warning, where several sessions are at work.
    """
    root = logging.getLogger()
    if _TELLER not in root.handlers:
        root.addHandler(_TELLER)
    root.setLevel(logging.INFO if verbose else logging.WARNING)
    _TELLER.wanted, _TELLER.of = verbose, of
    logging.captureWarnings(True)


def say(text: str, *, always: bool = False) -> None:
    """Print a line for people on standard error, if that can be written, and into the run's log.

    always: A warning or an error, which is said to those too who want it quiet.
    """
    log(text)
    if always or not is_quiet():
        with contextlib.suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


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

"""What is said while at work: progress of long work, lines for people; streams that are closed, full or ASCII.

Neither breaks a run nor loses its exit code. A bar on a terminal, plain lines elsewhere. rgbn.log keeps what every run
on an output folder said, its warnings, its tables and how it ended.
"""

import io
import logging
import os
import shlex
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from multiprocessing import parent_process
from pathlib import Path
from typing import TYPE_CHECKING

from scene.errors import SceneError

if TYPE_CHECKING:
    from scene.record import Record

EVERY_S = 15.0
"""Seconds from one line of work under way to the next, off a terminal."""

_open: list[Path] = []


def open_streams() -> None:
    """Put the null device in the place of closed streams: the next file opened would take their number and words."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # The lowest number that is free is the closed stream's.
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115 (for as long as the process lives)
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal without umlauts or box lines gets their codes.
        sys.stdout.reconfigure(errors="backslashreplace")


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


class _Kept(logging.Handler):
    """What libraries log, and Python's warnings: it goes into the run's log."""

    def emit(self, record: logging.LogRecord) -> None:
        log(f"{record.levelname.lower()}: {record.name}: {record.getMessage().rstrip()}")


_KEPT = _Kept(logging.WARNING)


def keep_logs() -> None:
    """Take what is logged, and Python's warnings, into the run's log alone."""
    logging.getLogger().addHandler(_KEPT)
    logging.captureWarnings(True)


def log(text: str) -> None:
    """Write a text into the log of the run that is at work; nothing where there is none."""
    if _open:
        first, *others = text.rstrip().splitlines() or [""]
        lines = [f"{datetime.now():%H:%M:%S} {first}", *(f"         {line}".rstrip() for line in others)]
        with suppress(OSError, ValueError), open(_open[-1], "a", encoding="utf-8", errors="backslashreplace") as file:
            file.write("\n".join(lines) + "\n")


@contextmanager
def logged(record: "Record") -> Iterator[None]:
    """Log what is said in the block into the rgbn.log of an output folder that is held.

    It goes line by line into the folder's `.rgbn`, where a killed run leaves what it had said; when the run ends, or
    else the next one, that is put behind the log, which is a file as all others that rgbn has written.
    """
    from scene.current import libraries

    now, command = record.scratch("running.log"), shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    versions = ", ".join(f"{name} {version}" for name, version in libraries().items())
    header = f"=== {datetime.now().astimezone().isoformat(timespec='seconds')}  {command}\n{versions}\n"
    with suppress(OSError, ValueError), open(now, "a", encoding="utf-8", errors="backslashreplace") as file:
        file.write(header)
    _open.append(now)
    try:
        yield
        log("done")
    except BaseException as error:
        told = f"rgbn: {error}" if isinstance(error, SceneError) else "".join(traceback.format_exception(error))
        log("stopped" if isinstance(error, KeyboardInterrupt) else told)
        raise
    finally:
        _open.remove(now)
        # A log that cannot be written, or that the user has changed, is no reason for a run to fail.
        with suppress(OSError, SceneError):
            _put_behind(record, now)


def _put_behind(record: "Record", now: Path) -> None:
    from scene.files import write_text

    path = record.folder / "rgbn.log"
    before = path.read_text("utf-8", "replace") if record.is_intact(path) else ""
    write_text(path, before + now.read_text("utf-8", "replace"))
    now.unlink()


def say(text: str, *, always: bool = False) -> None:
    """Print a line for people on standard error, if that can be written, and into the run's log.

    always: A warning or an error, which is said to those too who want it quiet.
    """
    log(text)
    if always or not is_quiet():
        with suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)


def end_with_parent() -> None:
    """End this process when the one that started it is gone, killed perhaps: nobody else would tell it."""
    # Ctrl-C reaches the whole group; the parent sees to it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None
    threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


_at_work: list[list[str]] = []
"""How far each block is, the innermost last."""


@contextmanager
def alive(label: str) -> Iterator[Callable[[int, int], None]]:
    """Say every `EVERY_S`, off a terminal, that the work of a block goes on; of blocks in each other the innermost.

    Yields a callback (done, total).
    """
    if sys.stderr.isatty() or is_quiet():
        yield lambda done, total: None
        return
    start, over, state = time.monotonic(), threading.Event(), ["at work"]

    def tell() -> None:
        while not over.wait(EVERY_S):
            if _at_work[-1] is state:
                say(f"  {label}: {state[0]}, {time.monotonic() - start:.0f} s so far")

    def report(done: int, total: int) -> None:
        state[0] = f"{done} of {total}"

    teller = threading.Thread(target=tell, daemon=True)
    _at_work.append(state)
    teller.start()
    try:
        yield report
    finally:
        over.set()
        teller.join()
        _at_work.pop()


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a callback (done, total) for one piece of work; shown on standard error."""
    if is_quiet() or not sys.stderr.isatty():
        with alive(label) as report:
            yield report
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description:24}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)

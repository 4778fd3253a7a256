"""The standard streams: closed, full or of another alphabet, they neither break a run nor lose its exit code."""

import contextlib
import io
import logging
import os
import sys
import threading
from collections.abc import Iterator

from lab.run_log import log
from scene.errors import SceneError


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


@contextlib.contextmanager
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

    wanted = False

    def emit(self, record: logging.LogRecord) -> None:
        ours, warned = record.name.partition(".")[0] == "rgbn", record.levelno >= logging.WARNING
        level = f"{record.levelname.lower()}: " if warned else ""
        text = f"{level}{'' if ours else f'{record.name}: '}{record.getMessage().rstrip()}"
        if self.wanted or (warned and (ours or record.name == "py.warnings")):
            say(text, always=warned)
        else:
            log(text)


_TELLER = _Teller()


def log_to(*, verbose: bool) -> None:
    """Take what is logged into the run's log; with `verbose`, say it too, and what is of interest beside warnings."""
    root = logging.getLogger()
    if _TELLER not in root.handlers:
        root.addHandler(_TELLER)
    root.setLevel(logging.INFO if verbose else logging.WARNING)
    _TELLER.wanted = verbose
    logging.captureWarnings(True)


def say(text: str, *, always: bool = False) -> None:
    """Print a line for people on standard error, if that can be written, and into the run's log.

    always: A warning or an error, which is said to those too who want it quiet.
    """
    log(text)
    if always or not is_quiet():
        with contextlib.suppress(OSError, ValueError):
            print(text, file=sys.stderr, flush=True)

"""The standard streams: closed, full or of another alphabet, they neither break a run nor lose its exit code."""

import contextlib
import io
import os
import sys
from collections.abc import Iterator

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


def say(text: str) -> None:
    """Print a line for people on standard error, if that can be written."""
    with contextlib.suppress(OSError, ValueError):
        print(text, file=sys.stderr, flush=True)

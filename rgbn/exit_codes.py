"""How the command line ends: 0 done, 2 the input is at fault, 130 stopped by Ctrl-C, 1 our fault."""

import contextlib
import errno
import os
import sys
import traceback
from typing import NoReturn

from cyclopts import CycloptsError

from lab.progress import say
from scene.errors import SceneError


def end_by(error: BaseException) -> NoReturn:
    """Say what stopped the command line, and leave with the exit code of that.

    Raises SystemExit: with 2 or 1; Ctrl-C, a closed pipe and a full disk behind a stream leave at once instead.
    """
    if _by_ctrl_c(error):
        say("\nrgbn: stopped. What is done is kept; the same command goes on from there.", always=True)
        _leave(130)
    if isinstance(error, SceneError):
        say(f"rgbn: {error}", always=True)
        _end(2)
    if isinstance(error, CycloptsError):
        told = " ".join(str(error).split())
        verb = " ".join(["rgbn", *(word for word in error.command_chain or () if not word.startswith("-"))])
        dot = "" if told.endswith((".", "?")) else "."
        say(f"rgbn: {told}{dot} `{verb} --help` says what there is.", always=True)
        _end(2)
    if isinstance(error, BrokenPipeError):
        # The reader of a pipe went away (`rgbn ... | head`): not our fault, and nothing to say.
        _leave(0)
    if isinstance(error, OSError) and error.errno == errno.ENOSPC and error.filename is None:
        say(f"rgbn: standard output cannot be written ({error.strerror}). Give it another place.", always=True)
        _end(2)
    say("".join(traceback.format_exception(error)), always=True)
    say("rgbn: this is a fault of rgbn, not of your input. Please report it with the lines above.", always=True)
    _end(1)


def _by_ctrl_c(error: BaseException | None) -> bool:
    """Whether a Ctrl-C is at the root: a compiled module hit while it loads makes an ImportError of it."""
    for _ in range(100):  # causes may go round in a circle
        if error is None or isinstance(error, KeyboardInterrupt):
            return error is not None
        error = error.__cause__ or error.__context__
    return False


def _end(code: int) -> NoReturn:
    """End in order; where a stream cannot be written, Python would make another exit code of it."""
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except OSError:
        _leave(code)
    raise SystemExit(code) from None


def _leave(code: int) -> NoReturn:
    """End at once: worker threads may be inside a library call that would hold up an orderly exit."""
    with contextlib.suppress(OSError, ValueError):
        sys.stderr.flush()
    os._exit(code)

"""How the command line ends: 0 done, 2 the input is at fault, 130 stopped by Ctrl-C, 1 our fault."""

import os
import sys
import traceback
from typing import NoReturn

from scene.errors import SceneError


def end_by(error: BaseException) -> NoReturn:
    """Say what stopped the command line, and leave with the exit code of that.

    Raises
    ------
    SystemExit
        With 2 or 1; Ctrl-C and a closed pipe leave at once instead.
    """
    if isinstance(error, SceneError):
        print(f"rgbn: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    if isinstance(error, BrokenPipeError):
        # The reader of a pipe went away (`rgbn ... | head`): not our fault, and nothing to say.
        _leave(0)
    if _by_ctrl_c(error):
        print("\nrgbn: stopped. What is done is kept; the same command goes on from there.", file=sys.stderr)
        _leave(130)
    traceback.print_exception(error)
    print("rgbn: this is a fault of rgbn, not of your input. Please report it with the lines above.", file=sys.stderr)
    raise SystemExit(1) from None


def _by_ctrl_c(error: BaseException | None) -> bool:
    """Whether a Ctrl-C is at the root: a compiled module hit while it loads makes an ImportError of it."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__ or error.__context__
    return False


def _leave(code: int) -> NoReturn:
    """End at once: worker threads may be inside a library call that would hold up an orderly exit."""
    sys.stderr.flush()
    os._exit(code)

"""rgbn.log: what every run on an output folder said, its warnings, its tables and how it ended.

A run writes line by line into the folder's `.rgbn`, where a killed run leaves what it had said; when it ends, or else
the next one, that is put behind the log, which is a file as all others that rgbn has written.
"""

import shlex
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from scene.errors import SceneError

if TYPE_CHECKING:
    from scene.record import Record

LOG = "rgbn.log"
LONGEST = 1_000_000
"""Characters of the log; the oldest runs are left out."""
HEAD = "=== "
"""Begins the line that begins a run."""

_open: list[Path] = []


def log(text: str) -> None:
    """Write a text into the log of the run that is at work; nothing where there is none."""
    if _open:
        first, *others = text.rstrip().splitlines() or [""]
        lines = [f"{datetime.now():%H:%M:%S} {first}", *(f"         {line}".rstrip() for line in others)]
        with suppress(OSError, ValueError), open(_open[-1], "a", encoding="utf-8", errors="backslashreplace") as file:
            file.write("\n".join(lines) + "\n")


@contextmanager
def logged(record: "Record") -> Iterator[None]:
    """Log what is said in the block into the rgbn.log of an output folder that is held."""
    from scene.current import libraries

    now, command = record.scratch("running.log"), shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    versions = ", ".join(f"{name} {version}" for name, version in libraries().items())
    header = f"{HEAD}{datetime.now().astimezone().isoformat(timespec='seconds')}  {command}\n{versions}\n"
    with suppress(OSError, ValueError), open(now, "a", encoding="utf-8", errors="backslashreplace") as file:
        file.write(header)
    _open.append(now)
    try:
        yield
        log("done")
    except BaseException as error:
        log(_ending(error))
        raise
    finally:
        _open.remove(now)
        # A log that cannot be written, or that the user has changed, is no reason for a run to fail.
        with suppress(OSError, SceneError):
            _put_behind(record, now)


def _ending(error: BaseException) -> str:
    if isinstance(error, SceneError):
        return f"rgbn: {error}"
    if isinstance(error, KeyboardInterrupt):
        return "stopped"
    return "".join(traceback.format_exception(error))


def _put_behind(record: "Record", now: Path) -> None:
    from scene.files import write_text

    path = record.folder / LOG
    before = path.read_text("utf-8", "replace") if record.is_intact(path) else ""
    text = before + now.read_text("utf-8", "replace")
    if len(text) > LONGEST:
        start = text.find(f"\n{HEAD}", len(text) - LONGEST)
        text = text[start + 1 :] if start >= 0 else text[-LONGEST:]
    write_text(path, text)
    now.unlink()

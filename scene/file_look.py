"""How a file looks from outside: what tells, without reading it, that it has not changed."""

import time
from pathlib import Path

TICK_NS, COARSE_NS = 10_000_000, 2_000_000_000
"""A file that was changed so shortly before it was looked at may have been changed again within one tick of its clock;
the second is for file systems that keep whole seconds."""


def look_of(path: Path) -> list[int]:
    """Return a file's size, times of change and number."""
    status = path.stat()
    return [status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino]


def is_settled(look: list[int] | None) -> bool:
    """Whether a later change of a file would show in its times."""
    if look is None:
        return False
    _, modified, changed, _ = look
    tick = TICK_NS if modified % 1_000_000_000 or changed % 1_000_000_000 else COARSE_NS
    return max(modified, changed) + tick < time.time_ns()

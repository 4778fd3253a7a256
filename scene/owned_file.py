"""A file that rgbn wrote: written over and removed only while it has a content that rgbn gave it."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from scene.current import file_digest
from scene.errors import SceneError

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


@dataclass
class OwnedFile:
    """What is known of such a file.

    Parameters
    ----------
    of : str
        The work that made it; empty: none that is ever forgotten.
    digests : tuple of str
        The contents that it may have: two, while nobody knows whether a killed run had put the second in place.
    look : list of int or None
        How it looked with the last of these contents.
    """

    of: str
    digests: tuple[str, ...]
    look: list[int] | None = None

    def content(self, path: Path) -> str | None:
        """Return the digest of the file, if rgbn gave it that content; None of another, and where there is no file."""
        if path.is_symlink() or not path.is_file():
            return None
        if self.look is not None and self.look == look_of(path):
            return self.digests[-1]
        digest = file_digest(path)
        return digest if digest in self.digests else None


def own_digest(path: Path, known: OwnedFile | None) -> str:
    """Return the digest of a file that rgbn wrote; empty where there is none.

    Raises
    ------
    SceneError
        Something is there that rgbn did not write, or that was changed since.
    """
    if not os.path.lexists(path):
        return ""
    if known is None:
        raise SceneError(
            f"{path}: is there already, and rgbn did not write it; it is not written over. Move it away, or choose "
            "another name or folder (--out)."
        )
    digest = known.content(path)
    if digest is None:
        raise SceneError(
            f"{path}: was changed after rgbn wrote it; it is not written over or removed. Move it away and run again, "
            "or choose another folder with --out."
        )
    return digest

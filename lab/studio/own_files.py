"""Files that the studio writes where other files lie: it writes over, and removes, only what it wrote itself.

A folder's record names each file that the studio wrote there with its SHA-256. A file that is not in it, or that has
changed since, is somebody else's.
"""

import contextlib
import hashlib
import json
import os
import shutil
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from scene.errors import SceneError
from scene.files import write_json

RECORD = ".rgbn-studio.json"
STAGING = ".rgbn-studio.tmp"
"""Folder that new files are written to first; one that a killed studio left is removed."""
Made = TypeVar("Made")
_ONE_AT_A_TIME = threading.Lock()


def put_own(folder: Path, write: Callable[[Path], Made]) -> Made:
    """Have files written into a folder: all of them or none, and none over a file that is not the studio's own.

    Parameters
    ----------
    folder : Path
        Made where it is not there.
    write : callable
        Writes the files, given the folder to write them to, which is another one.

    Returns
    -------
    made : what `write` returns

    Raises
    ------
    SceneError
        A file that is not the studio's own stands in the way, or the folder cannot be written.

    Notes
    -----
    A studio that is killed meanwhile leaves each file whole, the old or the new one; the record knows both.
    """
    staging = folder / STAGING
    with _ONE_AT_A_TIME, _told(folder):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            shutil.rmtree(staging, ignore_errors=True)
            staging.mkdir()
            made = write(staging)
            new = {
                path.relative_to(staging).as_posix(): _checksum(path) for path in staging.rglob("*") if path.is_file()
            }
            new = {name: checksum for name, checksum in new.items() if _checksum(folder / name) != checksum}
            refuse_foreign(folder, new)
            known = _record(folder)
            _write_record(folder, known | {name: [*known.get(name, []), checksum] for name, checksum in new.items()})
            # What names the others comes last: it sorts behind the folders.
            for name in sorted(new, key=lambda name: (name.count("/") == 0, name)):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                os.replace(staging / name, folder / name)
            _write_record(folder, known | {name: [checksum] for name, checksum in new.items()})
        finally:
            shutil.rmtree(staging, ignore_errors=True)
            with contextlib.suppress(OSError):
                folder.rmdir()  # Nothing came into it.
    return made


def remove_own(folder: Path, names: Iterable[str]) -> None:
    """Remove files that the studio wrote into a folder; those that are not there are passed over.

    Raises
    ------
    SceneError
        One is not the studio's own; then none is removed.
    """
    names = tuple(names)
    with _ONE_AT_A_TIME, _told(folder):
        refuse_foreign(folder, names)
        for name in names:
            (folder / name).unlink(missing_ok=True)
        left = {name: checksums for name, checksums in _record(folder).items() if name not in names}
        if left:
            _write_record(folder, left)
        else:
            (folder / RECORD).unlink(missing_ok=True)


def refuse_foreign(folder: Path, names: Iterable[str]) -> None:
    """Raise where a file of these names is there and is not as the studio wrote it.

    Raises
    ------
    SceneError
        With its path.
    """
    known = _record(folder)
    for name in names:
        path = folder / name
        if os.path.lexists(path) and _checksum(path) not in known.get(name, []):
            raise SceneError(
                f"{path}: was not written by the studio, or was changed since. Nothing was written over or removed. "
                "Choose another name, or move that file away."
            )


def _record(folder: Path) -> dict[str, list[str]]:
    try:
        found = json.loads((folder / RECORD).read_text())["files"]
        return {str(name): [str(one) for one in checksums] for name, checksums in found.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}  # Then nothing there is the studio's own.


def _write_record(folder: Path, files: dict[str, list[str]]) -> None:
    write_json(folder / RECORD, {"files": files})


def _checksum(path: Path) -> str:
    """Return a file's SHA-256; empty where there is none to be read."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


@contextlib.contextmanager
def _told(folder: Path):
    try:
        yield
    except OSError as error:
        where = error.filename or folder
        raise SceneError(f"{where}: cannot be written ({error.strerror}). Choose another name.") from error

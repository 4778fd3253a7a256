"""What tells whether a result is current: one fingerprint of the inputs, of the code and of the libraries."""

import hashlib
import importlib.util
import time
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from platform import python_version
from typing import Any, NamedTuple

import numpy as np

from scene.errors import SceneError

ROOMS = (
    "draw", "scene", "formats", "capture", "calibrate", "align", "solve", "twin", "compare", "lab", "shoot",
    "experiments", "studio", "rgbn",
)  # fmt: skip
"""The root folders that are import packages, from the ground floor up."""
ROOT = Path(__file__).resolve().parents[1]
LIBRARIES = (
    "numpy", "scipy", "opencv-contrib-python-headless", "rawpy", "scikit-image", "trimesh", "open3d", "mitsuba",
    "drjit", "numba", "llvmlite", "pillow", "tifffile", "h5py", "pyarrow",
)  # fmt: skip
"""Packages that a result may depend on."""
TICK_NS, COARSE_NS = 10_000_000, 2_000_000_000
"""A file that was changed so shortly before it was looked at may have been changed again within one tick of its clock;
the second is for file systems that keep whole seconds."""


def fingerprint(*values: Any, code: str = "", digest: Callable[[Path], str | None] | None = None) -> str:
    """Return one hash of all that a result is made from.

    Parameters
    ----------
    *values
        Plain values, arrays, dataclasses, mappings and sequences of these; a path stands for its file's name and
        content.
    code : str
        A `code_fingerprint`. Empty: the values alone.
    digest : callable or None
        Gives a file's `file_digest`, perhaps from memory.
    """
    whole = hashlib.sha256()
    if code:
        _feed((code, libraries()), whole.update, file_digest)
    _feed(values, whole.update, digest or file_digest)
    return whole.hexdigest()


def _feed(value: Any, update: Callable[[Any], Any], digest: Callable[[Path], str | None]) -> None:
    if is_dataclass(value) and not isinstance(value, type):
        update(f"{type(value).__name__} ".encode())
        for field in fields(value):
            _feed(getattr(value, field.name), update, digest)
    elif isinstance(value, np.ndarray):
        update(f"{value.dtype} {value.shape} ".encode())
        update(np.ascontiguousarray(value).reshape(-1).view(np.uint8).data)
    elif isinstance(value, Mapping):
        _feed(tuple(value.items()), update, digest)
    elif isinstance(value, tuple | list):
        update(f"{len(value)} ".encode())
        for part in value:
            _feed(part, update, digest)
    elif isinstance(value, Path):
        update(f"{value.name!r} {digest(value)} ".encode())
    else:
        update(f"{value!r} ".encode())


def file_digest(path: Path) -> str | None:
    """Return the SHA-256 of a file's content; None where there is no file."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return None


class FileLook(NamedTuple):
    """What a listing says of a file; two looks that differ are two contents."""

    size: int
    mtime_ns: int
    ctime_ns: int
    inode: int

    @property
    def is_settled(self) -> bool:
        """Whether a later change of the file would show in its times."""
        tick = TICK_NS if self.mtime_ns % 1_000_000_000 or self.ctime_ns % 1_000_000_000 else COARSE_NS
        return max(self.mtime_ns, self.ctime_ns) + tick < time.time_ns()


def look_of(path: Path) -> FileLook | None:
    """Return how a file looks now; None where there is none."""
    try:
        status = path.stat()
    except (OSError, ValueError):  # ValueError: a null character in the path
        return None
    return FileLook(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)


@cache
def libraries() -> dict[str, str]:
    """Return the versions of Python, of rgbn, and of the packages that results depend on."""
    found = {"python": python_version()}
    for name in ("rgbn", *LIBRARIES):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "absent"
    return found


@cache
def code_fingerprint(room: str = ROOMS[-1]) -> str:
    """Return a hash of the sources of a room and of those below it, as they were when it was first asked for."""
    return fingerprint([(path.relative_to(ROOT).as_posix(), path) for path in sources(room)])


def sources(room: str = ROOMS[-1]) -> tuple[Path, ...]:
    """Return all files of a room and of those below it, sorted."""
    every = (path for one in ROOMS[: ROOMS.index(room) + 1] for path in (ROOT / one).rglob("*"))
    return tuple(sorted(path for path in every if "__pycache__" not in path.parts and path.is_file()))


def check_rooms() -> None:
    """Raise when another distribution owns one of the folders' import names.

    Raises
    ------
    SceneError
        Names the folder, where it was found and whose it is.
    """
    for room in ROOMS:
        found = importlib.util.find_spec(room)
        place = Path(found.origin).resolve().parent if found and found.origin else None
        if place == ROOT / room:
            continue
        owners = sorted({*metadata.packages_distributions().get(room, ())} - {"rgbn"})
        raise SceneError(
            f"The import name {room!r} belongs to {', '.join(owners) or 'an unknown package'} here ({place}), not to "
            f"rgbn ({ROOT / room}). rgbn is an application and wants an environment of its own: run `make setup` in "
            "its folder."
        )

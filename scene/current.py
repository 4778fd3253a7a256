"""What tells whether a result is current: one fingerprint of the inputs, of the code and of the libraries."""

import hashlib
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import metadata
from pathlib import Path
from platform import python_version
from typing import Any

import numpy as np

ROOMS = (
    "scene", "formats", "capture", "calibrate", "align", "solve", "twin", "compare", "lab", "experiments", "studio",
    "rgbn",
)  # fmt: skip
"""The root folders that are import packages."""
ROOT = Path(__file__).resolve().parents[1]
LIBRARIES = (
    "numpy", "scipy", "opencv-contrib-python-headless", "rawpy", "scikit-image", "trimesh", "open3d", "mitsuba",
    "drjit", "numba", "llvmlite", "pillow", "plotly", "tifffile", "h5py", "pyarrow",
)  # fmt: skip
"""Packages that a result may depend on."""
CHUNK = 1 << 26
"""Bytes; a longer file is hashed in chunks of this size, side by side."""

BLOCK, BLOCKS = 1 << 13, 32
"""Bytes and number of the blocks of `blocks_digest`; a file of 256 KiB or less is read whole."""

_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([\w.]+))", re.M)
_BY_NAME = re.compile(r"import_module\(f?[\"']([\w.]+?)\.?[{\"']")


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


def paths_in(value: Any) -> Iterator[Path]:
    """Yield the paths in a value, as `fingerprint` meets them."""
    if isinstance(value, Path):
        yield value
    elif is_dataclass(value) and not isinstance(value, type):
        yield from paths_in([getattr(value, field.name) for field in fields(value)])
    elif isinstance(value, tuple | list):
        for part in value:
            yield from paths_in(part)


def blocks_digest(path: Path) -> str | None:
    """Return a hash of a file's size and of blocks all over it, which tells photographs apart; None without a file."""
    try:
        with open(path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            found = hashlib.sha256(str(size).encode())
            for start in range(0, size, max(BLOCK, -(-size // BLOCKS))):
                file.seek(start)
                found.update(file.read(BLOCK))
            return found.hexdigest()
    except OSError:
        return None


def file_digest(path: Path) -> str | None:
    """Return a hash of a file's content; None where there is no file.

    Up to `CHUNK` bytes it is SHA-256; of a longer file, SHA-256 of the SHA-256 of its chunks.
    """
    try:
        size = path.stat().st_size
        if path.is_dir():
            return None
        with open(path, "rb") as file:
            if size <= CHUNK:
                return hashlib.file_digest(file, "sha256").hexdigest()
    except (FileNotFoundError, NotADirectoryError):
        return None
    from concurrent.futures import ThreadPoolExecutor

    def of_chunk(start: int) -> bytes:
        found = hashlib.sha256()
        with open(path, "rb") as file:
            file.seek(start)
            for offset in range(start, min(start + CHUNK, size), 1 << 20):
                found.update(file.read(min(1 << 20, start + CHUNK - offset)))
        return found.digest()

    with ThreadPoolExecutor() as pool:
        return hashlib.sha256(b"".join(pool.map(of_chunk, range(0, size, CHUNK)))).hexdigest()


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
def code_fingerprint(*modules: str) -> str:
    """Return a hash of the house's sources, as they were when it was first asked for.

    Parameters
    ----------
    *modules : str
        Only these, and the modules of the house that they import, directly or not. Default: all files of all rooms.
    """
    whole = hashlib.sha256()
    for path in sources(*modules):
        whole.update(f"{path.relative_to(ROOT).as_posix()} ".encode())
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


def sources(*modules: str) -> tuple[Path, ...]:
    """Return the files that `code_fingerprint` hashes, sorted."""
    if not modules:
        every = (path for room in ROOMS for path in (ROOT / room).rglob("*"))
        return tuple(sorted(path for path in every if "__pycache__" not in path.parts and path.is_file()))
    found: set[Path] = set()
    waiting = [path for name in modules for path in _files_of(name)]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += imported(path)
    return tuple(sorted(found))


@cache
def imported(path: Path) -> tuple[Path, ...]:
    """Return the files of the house that a module imports, at its top or inside of a function, or reads."""
    if path.suffix != ".py":
        return ()
    text, found = path.read_text(encoding="utf-8"), []
    for package, names, module in _IMPORT.findall(text):
        found += _files_of(package or module)
        for name in re.findall(r"\w+", re.sub(r" as \w+|#[^\n]*", "", names)):
            found += _files_of(f"{package}.{name}")
    # What it reads as data lies beside it.
    found += [file for file in path.parent.iterdir() if file.suffix in (".csv", ".css", ".html") and file.name in text]
    # Modules that are chosen by name at run time: all of that package.
    for package in _BY_NAME.findall(text):
        found += [file for file in ROOT.joinpath(*package.split(".")).rglob("*.py") if package.split(".")[0] in ROOMS]
    return tuple(found)


def _files_of(module: str) -> Iterator[Path]:
    """Yield a module's file, if it is one of the house's, and the `__init__.py` of the packages around it."""
    parts = module.split(".")
    if parts[0] not in ROOMS:
        return
    for end in range(1, len(parts) + 1):
        place = ROOT.joinpath(*parts[:end])
        yield from (path for path in (place / "__init__.py", place.with_suffix(".py")) if path.is_file())

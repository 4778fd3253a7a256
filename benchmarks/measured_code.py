"""The code that a table measures: modules of the house, and what they import, directly or not."""

import hashlib
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from scene.current import ROOMS, ROOT

_IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([\w.]+))", re.M)
_BY_NAME = re.compile(r"import_module\(f?[\"']([\w.]+?)\.?[{\"']")


@cache
def code_of(*modules: str) -> str:
    """Return a hash of the files of `files_of`, as they were when it was first asked for."""
    whole = hashlib.sha256()
    for path in files_of(*modules):
        whole.update(f"{path.relative_to(ROOT).as_posix()} ".encode())
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


def files_of(*modules: str) -> tuple[Path, ...]:
    """Return the files of modules and of the modules of the house that they import, directly or not, sorted."""
    found: set[Path] = set()
    waiting = [path for name in modules for path in _files_of(name)]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _imported(path)
    return tuple(sorted(found))


@cache
def _imported(path: Path) -> tuple[Path, ...]:
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

"""File names: natural order, globs that resolve against the session's folder, and what kind of file each is."""

import difflib
import glob
import os
import re
from collections import Counter
from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from pathlib import Path, PurePath

RAW_SUFFIXES = (
    *(".dng", ".cr2", ".cr3", ".crw", ".nef", ".nrw", ".arw", ".srf", ".sr2", ".raf", ".orf", ".rw2", ".rwl"),
    *(".pef", ".srw", ".3fr", ".fff", ".iiq", ".mos", ".mef", ".mrw", ".x3f", ".erf", ".kdc", ".dcr", ".raw"),
)
IMAGE_SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".tga", ".pgm", ".ppm", ".pnm", ".bmp")

ESCAPED = {"\b": "/b", "\t": "/t", "\n": "/n", "\f": "/f", "\r": "/r"}
"""What TOML makes of a backslash and a letter between quotation marks, with what was meant."""
MOST_FOLDERS = 10_000
"""That `**` may lead through."""


def kind_of(path: PurePath) -> str | None:
    """Return "raw", "image" or "exr" by the file's suffix; None if no reader knows it."""
    kinds = {"raw": RAW_SUFFIXES, "image": IMAGE_SUFFIXES, "exr": (".exr",)}
    return next((kind for kind, suffixes in kinds.items() if path.suffix.lower() in suffixes), None)


def natural_key(path: PurePath) -> tuple:
    """Return the sort key that puts flash_9 before flash_10."""
    parts = re.split(r"(\d+)", str(path))
    return tuple((int(part), "") if i % 2 else (-1, part.lower()) for i, part in enumerate(parts)), str(path)


def expand(patterns: list[str], folder: Path) -> tuple[list[Path], list[str]]:
    """Return the files, absolute, that globs match, and what is wrong with the globs.

    Each glob's files come in natural order, the globs in the order given. A fault is a glob that matches nothing, or a
    file that is matched twice.
    """
    files: dict[Path, None] = {}
    faults: list[str] = []
    for pattern in patterns:
        try:
            found = sorted((path for path in matches(pattern, folder) if path.is_file()), key=natural_key)
        except ValueError as error:
            faults.append(f'"{pattern}": {error}')
            continue
        if not found:
            faults.append(f'"{pattern}" matches no file in {folder}. {meant(pattern, folder)}')
        for path in found:
            if re.search("[\ud800-\udfff]", str(path)):
                faults.append(f"{str(path)!r} is a name that is not UTF-8. Rename the file.")
            elif path in files:
                faults.append(f'"{pattern}" matches {path.name} a second time. Name every file once.')
            else:
                files[path] = None
    return list(files), faults


def matches(pattern: str, folder: Path) -> list[Path]:
    """Return what a glob matches; each real folder once, whatever links lead to it.

    ValueError where `**` leads through more folders than a session has.
    """
    parts = pattern.split("/")
    if "**" not in parts:
        found = [folder / name for name in glob.glob(pattern, root_dir=folder)]
    else:
        here = parts.index("**")
        before, after = "/".join(parts[:here]) + "/" * (here > 0), "/".join(parts[here + 1 :]) or "*"
        starts = [folder / name for name in glob.glob(before, root_dir=folder)] if before else [folder]
        found = [path for start in starts for place in _below(start) for path in matches(after, place)]
    # A link to a folder above shows its files again.
    real = {path.parent: path.parent.resolve() for path in found}
    return list({real[path.parent] / path.name: path for path in reversed(found)}.values())


def _below(start: Path) -> list[Path]:
    """Return a folder and all below it, links followed, none twice; hidden ones are left out."""
    found: dict[Path, Path] = {}
    for place, names, _ in os.walk(start, followlinks=True):
        real = Path(place).resolve()
        names[:] = sorted(name for name in names if not name.startswith(".")) if real not in found else []
        found.setdefault(real, Path(place))
        if len(found) > MOST_FOLDERS:
            raise ValueError(f"** leads through more than {MOST_FOLDERS} folders. Name the photographs' own folder.")
    return list(found.values())


def meant(name: str, folder: Path, fits: Callable[[Path], object] = kind_of) -> str:
    """Say what a name or a glob that leads to no file may be meant for: another case, another folder, a like name.

    `fits` : whether a file is of the kind that is asked for.
    """
    if slashed(name) != name:
        return f'Write / between folders, also on Windows: "{slashed(name)}".'
    path, is_glob = folder / name, bool(set("*?[") & set(name))
    around = {one for place in (folder, path.parent, path) for one in (*matches("*", place), *matches("*/*", place))}
    there = sorted((one for one in around if one.is_file()), key=natural_key)
    names = {Path(os.path.relpath(one, folder)).as_posix(): one for one in there}
    if path.is_dir():
        inside = [one for one, file in names.items() if file.parent == path and fits(file)]
        return f"It is a folder. Give a file{f', as {inside[0]}' if inside else ''}."
    alike = [one for one in names if one.count("/") == name.count("/") and fnmatchcase(one.lower(), name.lower())]
    if alike:
        return f"Upper and lower case count: {alike[0]} is there."
    # A name that says something, such as flash_*, tells where its files are.
    says = re.search(r"[^*?.]", path.stem)
    others = [one for one, file in names.items() if says and fits(file) and fnmatchcase(file.name, path.name)]
    if others and is_glob:
        return f'{others[0]} is there: write "{PurePath(others[0]).with_name(path.name).as_posix()}".'
    if others:
        return f"Did you mean {others[0]}?"
    if near := near_name(name, names):
        return near
    beside = [one.name for one in there if one.parent == path.parent and (is_glob or fits(one))]
    found = f": {path.parent} holds {len(beside)} files, {beside[0]} first" if beside else ""
    return f"Correct the {'glob' if is_glob else 'name'}{found}."


def near_name(name: str, names: Iterable[str]) -> str:
    """Return "Did you mean ...?" for the name that is most like one; empty where none is."""
    near = [] if set("*?[") & set(name) else difflib.get_close_matches(name, list(names), n=1)
    return f"Did you mean {near[0]}?" if near else ""


def slashed(name: str) -> str:
    """Return a path with / for the backslashes of Windows, also for those that TOML read as a tab and the like."""
    return re.sub(r"[\x08\t\n\f\r\\]", lambda found: ESCAPED.get(found[0], "/"), name)


def frame_names(files: list[Path]) -> list[str]:
    """Return the stems, with the folder's name in front where two stems are the same."""
    stems = Counter(path.stem for path in files)
    return [path.stem if stems[path.stem] == 1 else f"{path.parent.name}_{path.stem}" for path in files]

"""What the files of a folder are by their names and endings; nothing is decoded."""

import itertools
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePath

from capture.session.globs import expand, kind_of, natural_key
from formats.light_files.light_formats import SUFFIXES as LIGHTS_SUFFIXES
from formats.meshes.scan_files import SUFFIXES as SCAN_SUFFIXES
from formats.normal_maps import SUFFIXES as NORMALS_SUFFIXES
from scene.errors import SessionError
from scene.spheres import KINDS

WORDS = {
    "ambient": ("ambient", "amb", "noflash", "flashoff", "off"),
    "dark": ("dark", "bias", "lenscap"),
    "flat": ("flat", "flatfield", "vignetting"),
    "board": ("charuco", "aruco", "board", "chessboard", "checkerboard", "chess", "calib", "calibration"),
    "chart": ("chart", "colorchart", "colourchart", "colorchecker", "colourchecker"),
    "mask": ("mask", "silhouette"),
    "normals": ("normal", "normals"),
    "truth": ("gt", "truth", "true", "groundtruth", "reference"),
    "lights": ("light", "lights"),
    "chrome": ("chrome", "mirror", "mirrorball"),
    "white": ("white", "gray", "grey", "matte", "diffuse"),
}
"""Words in a file's name or folder, and what they say of it."""
BETTER = ("raw", "exr", ".tif", ".tiff", ".png")
"""Of two photographs of one name, the kind or ending that is kept; others come after these."""
FEWEST = 3
"""Photographs that make a session."""
MOST = 20_000
"""Files that a folder may hold to be looked at."""


@dataclass(frozen=True)
class FolderFiles:
    """The files of one session's folder.

    Parameters
    ----------
    folder : Path
        Where session.toml is to lie; every path below is absolute.
    by_role : dict of lists of Path
        Photographs by the role that their names tell: flash, ambient, dark, flat, board, chart, chrome, white; others
        by what they are: mask, scan, lights, normals.
    left_out : list of str
        What is not used, and why: a sentence each.
    """

    folder: Path
    by_role: dict[str, list[Path]] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def survey(folder: Path) -> list[FolderFiles]:
    """Return what a folder holds: one session, or one for each subfolder where each is an object's.

    Raises
    ------
    SessionError
        There is no such folder, or it holds no photographs.
    """
    folder = folder.resolve()
    if not folder.is_dir():
        lacks = "is no folder" if folder.exists() else "there is no such folder"
        raise SessionError(f"{folder}: {lacks}. Give the folder that holds the photographs.")
    files = list(files_below(folder))
    whole = sorted_files(files, folder)
    flash = whole.by_role.get("flash", [])
    if len(flash) < FEWEST:
        raise SessionError(
            f"{folder}: holds {len(flash)} photographs that may be flash frames ({len(files)} files in all); "
            f"photometric stereo needs {FEWEST} or more, RAW or 16-bit. Give the folder that holds them, or one above."
        )
    return _by_object(whole, flash)


def sorted_files(files: Iterable[Path], folder: Path) -> FolderFiles:
    """Return files of one folder by what their names say of them, of each photograph the file that holds most."""
    kept, left_out = _without_doubles(sorted(files, key=natural_key), folder)
    whole = FolderFiles(folder, left_out=left_out)
    _sort(kept, whole)
    return whole


def files_below(folder: Path) -> Iterator[Path]:
    """Yield the files of a folder and of all below it; hidden ones are left out.

    Raises
    ------
    SessionError
        There are more than a capture has.
    """
    count = 0
    for place, names, files in os.walk(folder):
        names[:] = sorted(name for name in names if not name.startswith((".", "__")))
        for name in files:
            count += 1
            if count > MOST:
                raise SessionError(f"{folder}: holds more than {MOST} files. Give the folder of one capture.")
            if not name.startswith("."):
                yield Path(place, name)


def name_of(path: Path, folder: Path) -> str:
    """Return what a file is called in a session.toml that lies in the folder."""
    return os.path.relpath(path, folder).replace(os.sep, "/")


def pattern_of(files: list[Path], folder: Path) -> str | list[str]:
    """Return the glob, as seen from the folder, that matches just these files; a list of names where none does."""
    names = [name_of(path, folder) for path in files]
    if len(names) == 1:
        return _escaped(names[0])
    columns = zip(*names, strict=False)
    before = "".join(column[0] for column in itertools.takewhile(lambda column: len(set(column)) == 1, columns))
    suffix = Path(names[0]).suffix
    # Digits that all names share are a number's beginning.
    start = _escaped(re.sub(r"\d+$", "", before))
    for pattern in (f"{start}*{suffix}", f"{start}[0-9]*{suffix}", f"{_escaped(before)}*{suffix}"):
        if {Path(os.path.normpath(path)) for path in expand([pattern], folder)[0]} == set(files):
            return pattern
    return [_escaped(name) for name in names]


def words_of(path: Path, folder: Path) -> set[str]:
    """Return the words of a file's name and of the folders below `folder`, two that follow each other also as one."""
    text = os.path.splitext(path.relative_to(folder))[0]
    found = re.findall(r"[a-z]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).lower())
    return {*found, *(first + second for first, second in itertools.pairwise(found))}


def _escaped(name: str) -> str:
    return re.sub(r"([*?\[])", r"[\1]", name)


def _without_doubles(files: list[Path], folder: Path) -> tuple[list[Path], list[str]]:
    """Leave out a photograph that another of the same name shows better: a JPEG beside its RAW file."""
    kept: dict[Path, Path] = {}
    ranked = sorted(filter(kind_of, files), key=rank_of)
    doubles = [path for path in ranked if kept.setdefault(path.with_suffix(""), path) != path]
    others = [path for path in files if kind_of(path) is None]
    raw = [path for path in kept.values() if kind_of(path) == "raw"]
    told = []
    if doubles:
        told.append(f"{_counted(doubles, folder)}: beside a file of the same name that holds more.")
    if len(raw) >= FEWEST:
        # Previews and snapshots: their values cannot be compared with the sensor's. Masks stay.
        shots = [
            path for path in kept.values() if kind_of(path) == "image" and not _told(path, folder, "mask", "normals")
        ]
        if shots:
            told.append(f"{_counted(shots, folder)}: no RAW files, as the others are.")
            kept = {key: path for key, path in kept.items() if path not in shots}
    return sorted([*kept.values(), *others], key=natural_key), told


def rank_of(path: PurePath) -> int:
    """Return which of two photographs of one name is kept: that of the lower rank."""
    kinds = (kind_of(path), path.suffix.lower())
    return min((BETTER.index(kind) for kind in kinds if kind in BETTER), default=len(BETTER))


def _counted(files: list[Path], folder: Path) -> str:
    suffixes = " and ".join(f"{count} {suffix}" for suffix, count in Counter(p.suffix.lower() for p in files).items())
    return f"{suffixes} ({files[0].relative_to(folder)}{', ...' if len(files) > 1 else ''})"


def _told(path: Path, folder: Path, *roles: str) -> bool:
    return any(words_of(path, folder) & set(WORDS[role]) for role in roles)


def _sort(files: Iterable[Path], found: FolderFiles) -> None:
    """Give each file its role by its ending and its words."""
    folder = found.folder

    def add(role: str) -> None:
        found.by_role.setdefault(role, []).append(path)

    for path in files:
        suffix = path.suffix.lower()
        if suffix in SCAN_SUFFIXES:
            add("scan")
        elif suffix in (".lp", ".dome") or (suffix in LIGHTS_SUFFIXES and _told(path, folder, "lights")):
            if "intensities" not in words_of(path, folder):
                add("lights")
        elif suffix in NORMALS_SUFFIXES and _told(path, folder, "normals"):
            # Normals that a program solved have the same names, but for the word.
            if _told(path, folder, "truth"):
                add("normals")
            else:
                name = path.relative_to(folder)
                found.left_out.append(
                    f"{name}: its name does not say whether these normals are the truth (gt, truth) or a program's "
                    f'result; they are not used. If they are the truth, add normals = "{name}" under [object].'
                )
        elif kind_of(path) and _told(path, folder, "mask"):
            add("mask")
        elif kind_of(path):
            roles = [role for role in ("board", "chart", "dark", "flat", "ambient") if _told(path, folder, role)]
            # A ball that was shot apart has a folder of its own; "white_vase_001" is no ball.
            roles += [role for role in KINDS if set(words_of(path.parent, folder)) & set(WORDS[role])]
            add(roles[0] if roles else "flash")


def _by_object(whole: FolderFiles, flash: list[Path]) -> list[FolderFiles]:
    """Return one session for each subfolder that holds an object's photographs; what lies above belongs to all."""
    groups: dict[Path, list[Path]] = {}
    for path in flash:
        groups.setdefault(path.parent, []).append(path)
    enough = {place: files for place, files in groups.items() if len(files) >= FEWEST}
    few = [path for place, files in groups.items() if place not in enough for path in files]
    if few and enough:
        whole.left_out.append(f"{_counted(few, whole.folder)}: alone in a folder, not among the flash frames.")
    if len(enough) < 2:
        return [replace(whole, by_role=whole.by_role | {"flash": next(iter(enough.values()), flash)})]
    bases = {place: _session_folder(place, [p for p in enough if p != place], whole.folder) for place in enough}
    found = []
    for place in sorted(enough, key=natural_key):
        # What lies above all objects is shared; what lies in another object's folder is that one's.
        theirs = [base for base in bases.values() if base != bases[place]]
        own = {
            role: [path for path in paths if not any(path.is_relative_to(other) for other in theirs)]
            for role, paths in whole.by_role.items()
        }
        own = {role: paths for role, paths in own.items() if paths} | {"flash": enough[place]}
        found.append(FolderFiles(bases[place], own, left_out=list(whole.left_out)))
    return found


def _session_folder(place: Path, others: list[Path], top: Path) -> Path:
    """Return the highest folder above an object's photographs that holds no other object's."""
    while place.parent != top and not any(other.is_relative_to(place.parent) for other in others):
        place = place.parent
    return place

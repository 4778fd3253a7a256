"""The folder that the studio works in: nothing outside of it is read or written by what the browser asks for."""

import itertools
import os
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scene.errors import SceneError
from scene.files import write_whole
from scene.output_folder import read_record
from scene.reading import reading, text_of

MESHES = (".ply", ".obj", ".stl", ".off", ".glb")
PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".hdr", ".npy")
LIGHTS = "lights.json"
MOST_FILES = 300
"""That a list shows; more would only be scrolled through."""
MOST_WALKED = 20_000
"""Files that are looked at for the lists."""
UPLOADS = "uploads"
MOST_UPLOAD = 200_000_000
"""Bytes of the files that are on their way from all windows together."""
_FILE_KEYS = {"mesh", "pose", "file", "map"}
"""Keys of a scene description that name files."""


@dataclass(frozen=True)
class Listing:
    """What a workspace holds, by the names that the browser calls it by, each sorted; `sessions` are folders."""

    models: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    sessions: tuple[str, ...] = ()
    is_cut: bool = False
    """There is more than is listed."""


@dataclass(frozen=True)
class Workspace:
    """A folder, resolved, and paths in it as the browser says them: relative, with slashes."""

    root: Path

    @classmethod
    def at(cls, folder: Path) -> "Workspace":
        """Return the workspace of a folder that is there."""
        if not folder.is_dir():
            raise SceneError(f"--workspace {folder}: not a folder. Make it first, or name another.")
        return cls(folder.resolve())

    def path(self, name: str | Path) -> Path:
        """Return the path of a name, links followed. Raises SceneError: it is empty, or leads out of the workspace."""
        is_name = bool(str(name).strip()) and "\0" not in str(name)
        found = (self.root / name).resolve() if is_name else self.root
        if not is_name or not found.is_relative_to(self.root):
            raise SceneError(
                f"{str(name)!r}: lies outside of the workspace {self.root}. Move it there, or start the studio with "
                "--workspace FOLDER."
            )
        try:
            found.exists()
        except OSError as error:
            raise SceneError(f"{str(name)[:80]!r}: names no file ({error.strerror}). Choose a shorter name.") from error
        return found

    def folder_for(self, name: str) -> Path:
        """Return the folder, new or old, that a name given in the browser means; not the workspace itself."""
        found = self.path(name)
        if found == self.root:
            raise SceneError(f"{name!r}: is the workspace itself. Name a folder in it.")
        if found.exists() and not found.is_dir():
            raise SceneError(f"{name!r}: is a file. Name another folder.")
        return self.closed(found)

    def closed(self, folder: Path) -> Path:
        """Return a folder, in which no link may lead out of the workspace: what is written below it stays there."""
        for place, folders, files in os.walk(folder):
            for path in (Path(place, name) for name in (*folders, *files)):
                if path.is_symlink():
                    self.path(path)
        return folder

    def name(self, path: Path) -> str:
        """Return what the browser calls a path."""
        return path.resolve().relative_to(self.root).as_posix()

    def listing(self) -> "Listing":
        """Return what there is to choose from; hidden folders, links and what rgbn made itself are left out."""
        kinds = {"models": MESHES, "pictures": PICTURES}
        found: dict[str, list[str]] = {kind: [] for kind in (*kinds, "sessions")}
        is_cut = False
        for number, path in enumerate(self._walk(self.root, depth=4)):
            if number == MOST_WALKED:
                is_cut = True
                break
            kind = next((kind for kind, ends in kinds.items() if path.suffix.lower() in ends), None)
            if path.name == LIGHTS:
                kind, path = "sessions", path.parent
            if kind is None:
                continue
            is_cut |= len(found[kind]) == MOST_FILES
            found[kind] = [*found[kind], self.name(path)][:MOST_FILES]
        return Listing(**{kind: tuple(sorted(names)) for kind, names in found.items()}, is_cut=is_cut)

    def keep_upload(self, name: str, content: bytes) -> str:
        """Write what the browser sent into `uploads/`, and return its name in the workspace.

        Another file of that name stays: this one gets a number. Those that are too large come without content.
        """
        stem, suffix = re.sub(r"[^\w.-]+", "_", Path(name).stem).strip("."), Path(name).suffix.lower()
        if suffix not in (*MESHES, *PICTURES) or not stem:
            kinds = ", ".join(dict.fromkeys((*MESHES, *PICTURES)))
            raise SceneError(f"{name}: cannot be used here; expected one of {kinds}.")
        if not content:
            raise SceneError(
                f"{name}: is empty, or larger than what can be sent at a time from all windows together, "
                f"{MOST_UPLOAD // 10**6} MB. Copy it into {self.root}, and look for files again."
            )
        for number in itertools.count(1):
            path = self.path(f"{UPLOADS}/{stem}{f'_{number}' if number > 1 else ''}{suffix}")
            if not path.exists():
                with write_whole(path) as file:
                    file.write(content)
            elif path.read_bytes() != content:
                continue
            return self.name(path)
        raise AssertionError

    def description(self, name: str) -> Path:
        """Return the path of a scene description. Raises SceneError: it, or a file that it names, lies outside.

        Other faults are left to its reader.
        """
        path = self.path(name)
        try:
            with reading(path):
                data = tomllib.loads(text_of(path))
        except SceneError:
            return path
        for file in _files_of(data):
            try:
                self.path(path.parent / file)
            except SceneError as error:
                raise SceneError(f"{path}: names {error}") from None
        return path

    def _walk(self, folder: Path, depth: int, own: frozenset[Path] = frozenset()) -> Iterator[Path]:
        record = read_record(folder)
        if record is not None:
            own |= {path for work in ("", *record.done) for path in record.files_of(work)}
        try:
            inside = sorted(folder.iterdir())
        except OSError:
            return
        for path in inside:
            if path.name.startswith(".") or path.is_symlink():
                continue
            if path.is_file() and (path.name == LIGHTS or path not in own):
                yield path
            elif depth and path.is_dir() and path.name not in ("node_modules", "__pycache__"):
                yield from self._walk(path, depth - 1, own)


def _files_of(data: Any) -> Iterator[str]:
    """Yield every value of a key that names a file, wherever it stands."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        if key in _FILE_KEYS and isinstance(value, str):
            yield value
        else:
            yield from _files_of(value)

"""The folder that the studio works in: what is listed in the page lies there, and what is made in it goes there."""

import itertools
import os
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from formats.meshes.scan_files import SUFFIXES as MESHES
from scene.current import file_digest
from scene.errors import SceneError
from scene.files import move, write_whole
from scene.output_folder import open_record
from scene.record import PLACE

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".hdr", ".npy")
UPLOADS = "uploads"


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
        try:
            found = (self.root / name).resolve()
            found.exists()
        except (OSError, ValueError) as error:
            raise SceneError(f"{str(name)[:80]!r}: names no file ({error}). Choose another name.") from error
        if not str(name).strip() or not found.is_relative_to(self.root):
            raise SceneError(
                f"{str(name)!r}: lies outside of the workspace {self.root}. Move it there, or start the studio with "
                "--workspace FOLDER."
            )
        return found

    def folder_for(self, name: str) -> Path:
        """Return the folder, new or old, that a name typed in the page means; not the workspace itself."""
        found = self.path(name)
        if found == self.root or (found.exists() and not found.is_dir()):
            what = "the workspace itself" if found == self.root else "a file"
            raise SceneError(f"{name!r}: is {what}. Name another folder in the workspace.")
        return found

    def name(self, path: Path) -> str:
        """Return what the browser calls a path: by its place in the workspace, or its name alone."""
        path = path.resolve()
        return path.relative_to(self.root).as_posix() if path.is_relative_to(self.root) else path.name

    def keep_upload(self, name: str, content: bytes) -> str:
        """Write what the browser sent into `uploads/`, and return its name in the workspace.

        Another file of that name stays: this one gets a number.
        """
        stem, suffix = re.sub(r"[^\w.-]+", "_", Path(name).stem).strip("."), Path(name).suffix.lower()
        if suffix not in (*MESHES, *PICTURES) or not stem or not content:
            kinds = ", ".join((*MESHES, *PICTURES))
            raise SceneError(f"{name}: is empty, or cannot be used here; expected one of {kinds}.")
        for number in itertools.count(1):
            path = self.path(f"{UPLOADS}/{stem}{f'_{number}' if number > 1 else ''}{suffix}")
            if not path.exists():
                with write_whole(path) as file:
                    file.write(content)
            elif path.read_bytes() != content:
                continue
            return self.name(path)
        raise AssertionError


Made = TypeVar("Made")


def put_own(folder: Path, write: Callable[[Path], Made]) -> Made:
    """Have files written into a folder: none of them, if one would take the place of a file that is not rgbn's own.

    folder: Made where it is not there. write: Writes the files, given the folder to write them to, which is another
    one. Raises SceneError: a file that rgbn did not write stands in the way, or the folder cannot be written.
    A studio that is killed meanwhile leaves each file whole, the old or the new one; the record knows both.
    """
    is_new = not folder.exists()
    try:
        with open_record(folder, among_others=True) as record:
            staging = record.scratch("staging")
            shutil.rmtree(staging, ignore_errors=True)
            staging.mkdir()
            made = write(staging)
            names = [path.relative_to(staging) for path in staging.rglob("*") if path.is_file()]
            new = [name for name in names if file_digest(staging / name) != file_digest(record.folder / name)]
            for name in new:
                if not (record.folder / name).resolve().is_relative_to(record.folder):
                    raise SceneError(f"{folder / name}: a link leads out of {folder}. Remove it, or take another name.")
                record.check_free(record.folder / name)
            # What names the others comes last: it lies above them.
            for name in sorted(new, key=lambda name: (len(name.parts) == 1, name)):
                move(staging / name, record.folder / name)
            return made
    except BaseException:
        with suppress(OSError):
            if is_new and set(os.listdir(folder)) <= {PLACE}:
                shutil.rmtree(folder)
        raise

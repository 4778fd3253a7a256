"""Files that the studio writes where other files may lie: it writes over, and removes, only what rgbn wrote itself."""

import os
import shutil
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from scene.current import file_digest
from scene.errors import SceneError
from scene.files import move
from scene.output_folder import open_record
from scene.record import PLACE

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


def remove_own(folder: Path, names: Iterable[str]) -> None:
    """Remove files that rgbn wrote into a folder; those that are not there are passed over.

    Raises SceneError: one is not rgbn's own; then none is removed.
    """
    paths = [folder.resolve() / name for name in names]
    with open_record(folder, among_others=True) as record:
        for path in paths:
            record.check_free(path)
        for path in paths:
            record.remove(path)

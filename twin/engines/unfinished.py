"""A rendering that is not finished yet: its arrays on disk, and which pieces are in them.

A run that is killed leaves them; the same rendering, asked for again, goes on where it was.
"""

import contextlib
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.current import fingerprint
from scene.errors import SceneError
from scene.files import create_array, move, plain, write_json
from scene.reading import json_of, reading

NOTES = "rendering.json"


class Unfinished:
    """Arrays that are being filled piece by piece.

    folder: Where they lie meanwhile; emptied, unless it holds the same rendering. None: in memory, and lost with the
        run.
    mark: What tells this rendering from any other; a `scene.current.fingerprint`.
    notes: What `begin` was given; None: nothing was begun.
    done: Pieces that are in the arrays.
    """

    def __init__(self, folder: Path | None, mark: str = "") -> None:
        self.folder, self._mark = folder, mark
        self.notes: dict[str, Any] | None = None
        self.done: set[int] = set()
        self.arrays: dict[str, NDArray] = {}
        if folder is None or not folder.exists():
            return
        # What is damaged, or another rendering's, is begun anew.
        with contextlib.suppress(SceneError), reading(folder, "no rendering of ours"):
            found = json_of(folder / NOTES)
            if found["mark"] == mark and found.pop("digest") == fingerprint(found):
                self.arrays = {name: np.load(self._path(name), mmap_mode="r+") for name in found["arrays"]}
                self.notes, self.done = found["notes"], set(found["done"])
        if self.notes is None:
            shutil.rmtree(folder)

    def begin(self, notes: Mapping[str, Any], arrays: Mapping[str, tuple[tuple[int, ...], Any, Any]]) -> None:
        """Make the arrays, each of (shape, dtype, value); keep notes that the run which goes on will want."""
        self.notes = dict(notes)
        for name, (shape, dtype, value) in arrays.items():
            if self.folder is None:
                self.arrays[name] = np.full(shape, value, dtype)
                continue
            with create_array(self._path(name), shape, dtype) as array:
                if value:
                    for part in array:
                        part[...] = value
            self.arrays[name] = np.load(self._path(name), mmap_mode="r+")
        self._save()

    def finished(self, piece: int) -> None:
        """Note that a piece is in the arrays."""
        for array in self.arrays.values():
            if isinstance(array, np.memmap):
                array.flush()
        self.done.add(piece)
        self._save()

    def hand_over(self, places: Mapping[str, Path]) -> None:
        """Move the arrays of a folder to their places, and leave nothing behind."""
        assert self.folder is not None
        self.arrays.clear()
        for name, path in places.items():
            move(self._path(name), path)
        shutil.rmtree(self.folder)

    def _path(self, name: str) -> Path:
        assert self.folder is not None
        return self.folder / f"{name}.npy"

    def _save(self) -> None:
        if self.folder is not None:
            state = {"mark": self._mark, "arrays": list(self.arrays), "notes": self.notes, "done": sorted(self.done)}
            state = plain(state)
            write_json(self.folder / NOTES, {**state, "digest": fingerprint(state)})

"""A rendering that is not finished yet: its arrays on disk, and which pieces are in them.

A run that is killed leaves them; the same rendering, asked for again, goes on where it was.
"""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.files import create_array, move


class Unfinished:
    """Arrays that are being filled piece by piece.

    arrays: Shape, dtype and first value of each, by name.
    folder: Where they lie meanwhile; emptied, unless it holds the same rendering. None: in memory, and lost with the
        run.
    mark: What tells this rendering from any other; a `scene.current.fingerprint`. A folder of this name is made when
        the arrays are whole, and holds an empty file for each piece that is in them.
    done: Pieces that are in the arrays.
    """

    def __init__(
        self, arrays: Mapping[str, tuple[tuple[int, ...], Any, Any]], folder: Path | None, mark: str = ""
    ) -> None:
        self._folder, self._pieces = folder, folder and folder / mark
        self.arrays: dict[str, NDArray] = {}
        self.done: set[int] = set()
        if folder is None or self._pieces is None:
            self.arrays = {name: np.full(shape, value, dtype) for name, (shape, dtype, value) in arrays.items()}
            return
        if not self._pieces.is_dir():
            shutil.rmtree(folder, ignore_errors=True)
            for name, (shape, dtype, value) in arrays.items():
                with create_array(folder / f"{name}.npy", shape, dtype) as array:
                    for part in array if value else ():
                        part[...] = value
            self._pieces.mkdir()
        self.arrays = {name: np.load(folder / f"{name}.npy", mmap_mode="r+") for name in arrays}
        self.done = {int(piece.name) for piece in self._pieces.iterdir()}

    def finished(self, piece: int) -> None:
        """Note that a piece is in the arrays."""
        self.done.add(piece)
        if self._pieces is not None:
            for array in self.arrays.values():
                array.flush()  # type: ignore[attr-defined]
            (self._pieces / str(piece)).touch()

    def hand_over(self, places: Mapping[str, Path]) -> None:
        """Move the arrays of a folder to their places, and leave nothing behind."""
        assert self._folder is not None
        self.arrays.clear()
        for name, path in places.items():
            move(self._folder / f"{name}.npy", path)
        shutil.rmtree(self._folder)

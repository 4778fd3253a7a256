"""A folder in the layout of the DiLiGenT benchmark [Shi2019]: names, its tables with every fault, writing.

001.png ... (16 bits, linear), filenames.txt, light_directions.txt, light_intensities.txt (three numbers a line, one
line a photograph), mask.png, and the true normals. What every output folder has of it is in `scene.light_text`.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from formats.mat_files import bytes_of_mat
from scene.errors import SceneError
from scene.files import write_png, write_text, write_whole
from scene.frames import Frames
from scene.light_text import DIRECTIONS, FILENAMES, INTENSITIES, light_tables, names_in, table_in
from scene.lights import Lights
from scene.reading import listed

Array = NDArray[np.float64]
MASK = "mask.png"
NORMALS = ("Normal_gt.mat", "normal.txt", "Normal_gt.png")
"""The first of them that is there counts."""


class DiligentTables(NamedTuple):
    """What filenames.txt lists; the lights (N, 3) as they are written, None where missing or at fault; all faults."""

    files: list[str]
    directions: Array | None
    intensities: Array | None
    faults: list[str]


def read_tables(folder: Path) -> DiligentTables:
    """Read the list of the photographs, and their lights."""
    faults: list[str] = []
    count = len(list(folder.glob("[0-9]*.png"))) or "no"
    do = f"; the folder has {count} numbered PNGs. List the photographs there, one a line."
    files = _read(names_in, folder / FILENAMES, do, faults) or []
    if not files and not faults:
        faults.append(f"{FILENAMES}: names no file. List the photographs there, one a line.")
    # `Path.is_file` raises where a name is longer than the system allows.
    _tell(FILENAMES, [name for name in files if not os.path.isfile(folder / name)], "not in the folder. Add, or "
          "cross out.", faults)  # fmt: skip
    twice = sorted({name for name in files if files.count(name) > 1})
    _tell(FILENAMES, twice, "on the list more than once. One line a photograph.", faults)
    directions, note = _table(folder / DIRECTIONS, len(files), faults)
    intensities, _ = _table(folder / INTENSITIES, len(files), faults, note)
    return DiligentTables(files, directions, intensities, faults)


def _table(path: Path, count: int, faults: list[str], *beside: str) -> tuple[Array | None, str]:
    """Return a table, and what is to be said of how it was read; `count`: rows it should have, 0 unknown."""
    do = ". Write three numbers a line, one line a photograph."
    table, note = _read(table_in, path, do, faults, SceneError, *beside) or (None, "")
    if table is None:
        return None, ""
    if count and len(table) != count:
        faults.append(
            f"{path.name}: found {len(table)} rows, expected {count}, one for each line of {FILENAMES}. Add or remove "
            "rows; their order is that of the list."
        )
        return None, note
    wrong = np.flatnonzero(~np.isfinite(table).all(1)) + 1
    _tell(f"{path.name}, row", wrong, "not finite. Give every light its numbers.", faults)
    return None if len(wrong) else table, note


def _read(reader: Callable[..., Any], path: Path, do: str, faults: list[str], *more: Any) -> Any:
    """Return what a reader makes of a file; None, and one fault more, where it is missing or cannot be read."""
    if not path.is_file():
        faults.append(f"{path.name}: missing{do}")
        return None
    try:
        return reader(path, *more)
    except SceneError as error:
        faults.append(str(error).removeprefix(f"{path.parent}/"))
        return None


def _tell(name: str, which: Any, words: str, faults: list[str]) -> None:
    """Add a fault where something is wrong with these of a file's parts."""
    if len(which):
        faults.append(f"{name}: {listed(which)} {'is' if len(which) == 1 else 'are'} {words}")


def write_diligent(
    folder: Path, frames: Frames, lights: Lights, mask: NDArray[np.bool_], box: tuple[slice, slice] = np.s_[:, :],
    most: int | None = None,
) -> None:  # fmt: skip
    """Write a window of the frames, 16-bit linear RGB, ambient light subtracted, all by one factor.

    No truth, and no unknown lights. `most`: at most so many frames, evenly spread.
    """
    factor, count = 65535 / max(float(frames.gain.max()), 1e-12), len(frames)
    chosen = np.unique(np.linspace(0, count - 1, min(most or count, count)).round().astype(int))
    files = {f"{number:03d}.png": int(index) for number, index in enumerate(chosen, 1)}
    for file, index in files.items():
        image = np.round(frames.read(box[0], [index], columns=box[1])[0] * factor)
        write_png(folder / file, np.clip(image, 0, 65535).astype(np.uint16))
    write_png(folder / MASK, mask[box])
    for name, text in light_tables(list(files), lights.only(chosen)).items():
        if not lights.is_unknown or name == FILENAMES:
            write_text(folder / name, text)


def write_normal_mat(path: Path, normals: NDArray[np.float32]) -> None:
    """Write `Normal_gt` as DiLiGenT has it, float64, zero where there is no object; the same bytes every time."""
    with write_whole(path) as file:
        file.write(bytes_of_mat({"Normal_gt": np.nan_to_num(normals.astype(np.float64))}))

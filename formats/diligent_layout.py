"""A folder in the layout of the DiLiGenT benchmark [Shi2019]: names, its tables with every fault, writing.

001.png ... (16 bits, linear), filenames.txt, light_directions.txt, light_intensities.txt (three numbers a line, one
line a photograph), mask.png, and the true normals. What every output folder has of it is in `scene.light_text`.
"""

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.files import write_png, write_text, write_whole
from scene.frames import Frames
from scene.light_text import DIRECTIONS, FILENAMES, INTENSITIES, light_tables, names_in, table_in
from scene.lights import Lights
from scene.reading import listed

MASK = "mask.png"
NORMALS = ("Normal_gt.mat", "normal.txt", "Normal_gt.png")
"""The first of them that is there counts."""


def read_list(folder: Path) -> tuple[list[str], list[str]]:
    """Return the photographs that filenames.txt lists, and what must be mended in it and in the two tables."""
    faults: list[str] = []

    def read(name: str, do: str, reader: Callable[..., Any], *more: Any) -> Any:
        try:
            if os.path.isfile(folder / name):
                return reader(folder / name, *more)
            faults.append(f"{name}: missing{do}")
        except SceneError as error:
            faults.append(str(error).removeprefix(f"{folder}/"))

    numbered = len(list(folder.glob("[0-9]*.png"))) or "no"
    do = f"; the folder has {numbered} numbered PNGs. List the photographs there, one a line."
    files = read(FILENAMES, do, names_in) or []
    if not files and not faults:
        faults.append(f"{FILENAMES}: names no file. List the photographs there, one a line.")
    # `Path.is_file` raises where a name is longer than the system allows.
    absent = [name for name in files if not os.path.isfile(folder / name)]
    twice = sorted({name for name in files if files.count(name) > 1})
    for names, words in (
        (absent, "not in the folder. Add, or cross out."),
        (twice, "on the list more than once. One line a photograph."),
    ):
        if names:
            faults.append(f"{FILENAMES}: {listed(names)} {'is' if len(names) == 1 else 'are'} {words}")
    for name, beside in ((DIRECTIONS, None), (INTENSITIES, "")):
        found = read(name, ". Write three numbers a line, one line a photograph.", table_in, SceneError, beside)
        if found and files and len(found[0]) != len(files):
            faults.append(
                f"{name}: found {len(found[0])} rows, expected {len(files)}, one for each line of {FILENAMES}. Add or "
                "remove rows; their order is that of the list."
            )
    return files, faults


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
    import scipy.io

    stream = io.BytesIO()
    scipy.io.savemat(stream, {"Normal_gt": np.nan_to_num(normals.astype(np.float64))}, do_compression=True)
    with write_whole(path) as file:
        # Its first 116 bytes are text for people, with the hour in it.
        file.write(b"MATLAB 5.0 MAT-file, rgbn".ljust(116) + stream.getvalue()[116:])

"""A folder in the layout of the DiLiGenT benchmark [Shi2019]: names, reading with every fault, writing.

001.png ... (16 bits, linear), filenames.txt, light_directions.txt, light_intensities.txt (three numbers a line, one
line a photograph), mask.png, and the true normals. What every output folder has of it is in `scene.light_text`.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.mat_files import bytes_of_mat
from formats.normal_maps import read_normal_map
from scene.errors import SceneError
from scene.files import write_png, write_text, write_whole
from scene.frames import Frames
from scene.image_files import read_pixels
from scene.light_text import DIRECTIONS, FILENAMES, INTENSITIES, light_tables, names_in, table_in
from scene.lights import Lights
from scene.reading import listed

Array = NDArray[np.float64]
TABLES = (DIRECTIONS, INTENSITIES)
MASK = "mask.png"
NORMALS = ("Normal_gt.mat", "normal.txt", "Normal_gt.png")
"""The first of them that is there counts."""
_UNIT = 0.01
_WRONG_LENGTHS = 0.001


@dataclass
class DiligentFolder:
    """What was found; None where it is missing or at fault.

    Parameters
    ----------
    faults : list of str
        What must be mended.
    files : list of str
        What filenames.txt says.
    directions, intensities : (N, 3) float64 or None
    mask : (H, W) bool or None
    normals : (H, W, 3) float64 or None
        Unit, in the file's axes; NaN where there is none.
    """

    folder: Path
    faults: list[str] = field(default_factory=list)
    files: list[str] = field(default_factory=list)
    directions: Array | None = None
    intensities: Array | None = None
    mask: NDArray[np.bool_] | None = None
    normals: Array | None = None

    @property
    def normals_name(self) -> str:
        """Name of the file of the normals; empty where there is none."""
        return next((name for name in NORMALS if (self.folder / name).is_file()), "")

    def lacks(self, name: str, words: str) -> bool:
        """Whether a file is not there: one fault more, with what to do."""
        if (self.folder / name).is_file():
            return False
        self.faults.append(f"{name}: missing{words}")
        return True

    def tell(self, name: str, which: Any, words: str) -> bool:
        """Whether something is wrong with these of a file's parts: one fault more."""
        if len(which):
            self.faults.append(f"{name}: {listed(which)} {'is' if len(which) == 1 else 'are'} {words}")
        return len(which) > 0

    def read(self, reader: Callable[..., Any], name: str, *more: Any) -> Any:
        """Return what a reader makes of a file; None, and one fault more, where it cannot."""
        try:
            return reader(self.folder / name, *more)
        except SceneError as error:
            self.faults.append(str(error).removeprefix(f"{self.folder}/"))
            return None


def read_tables(folder: Path) -> DiligentFolder:
    """Read what a session needs: the list of the photographs, and their lights as they are written."""
    found = DiligentFolder(folder)
    _read_names(found)
    found.directions, note = _read_table(found, DIRECTIONS)
    found.intensities, _ = _read_table(found, INTENSITIES, note)
    return found


def read_layout(folder: Path) -> DiligentFolder:
    """Read all but the photographs' pixels.

    Raises
    ------
    SceneError
        There is no such folder.
    """
    if not folder.is_dir():
        raise SceneError(f"{folder}: no such folder. Give one in the DiLiGenT layout (docs/guide/synthetic.md).")
    found = read_tables(folder)
    _check_lights(found)
    _read_mask(found)
    _read_normals(found)
    return found


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


def _read_names(found: DiligentFolder) -> None:
    count = len(list(found.folder.glob("[0-9]*.png"))) or "no"
    if found.lacks(FILENAMES, f"; the folder has {count} numbered PNGs. List the photographs there, one a line."):
        return
    names = found.files = found.read(names_in, FILENAMES) or []
    if not names and not found.faults:
        found.faults.append(f"{FILENAMES}: names no file. List the photographs there, one a line.")
    # `Path.is_file` raises where a name is longer than the system allows.
    absent = [name for name in names if not os.path.isfile(found.folder / name)]
    found.tell(FILENAMES, absent, "not in the folder. Add, or cross out.")
    twice = sorted({name for name in names if names.count(name) > 1})
    found.tell(FILENAMES, twice, "on the list more than once. One line a photograph.")


def _read_table(found: DiligentFolder, name: str, *beside: str) -> tuple[Array | None, str]:
    """Return a table, and what is to be said of how it was read."""
    if found.lacks(name, ". Write three numbers a line, one line a photograph."):
        return None, ""
    table, note = found.read(table_in, name, SceneError, *beside) or (None, "")
    if table is None:
        return None, ""
    if found.files and len(table) != len(found.files):
        found.faults.append(
            f"{name}: found {len(table)} rows, expected {len(found.files)}, one for each line of {FILENAMES}. Add or "
            "remove rows; their order is that of the list."
        )
        return None, note
    wrong = np.flatnonzero(~np.isfinite(table).all(1)) + 1
    return None if found.tell(f"{name}, row", wrong, "not finite. Give every light its numbers.") else table, note


def _check_lights(found: DiligentFolder) -> None:
    if (table := found.intensities) is not None:
        low = np.flatnonzero((table <= 0).any(1)) + 1
        found.tell(f"{INTENSITIES}, row", low, "not above 0. Give R G B of each light.")
    if (table := found.directions) is None:
        return
    off = np.flatnonzero(np.abs(np.linalg.norm(table, axis=1) - 1) > _UNIT) + 1
    words = "not of length 1. Give unit vectors toward the lights, not positions; divide each row by its length."
    if found.tell(f"{DIRECTIONS}, row", off, words):
        return
    try:
        Lights(("",) * len(table), table, np.ones_like(table)).check()
    except SceneError as error:
        found.faults.append(f"{DIRECTIONS}: {error}")


def _read_mask(found: DiligentFolder) -> None:
    if found.lacks(MASK, ". White where the object is, black elsewhere, of the photographs' size."):
        return
    if (read := found.read(read_pixels, MASK)) is None:
        return
    values = read[0].reshape(*read[0].shape[:2], -1)[..., :3].max(-1)
    mask = found.mask = values > (int(values.min()) + int(values.max())) / 2
    if not mask.any():
        found.faults.append(f"{MASK}: of one value everywhere. Expected white where the object is, black elsewhere.")


def _read_normals(found: DiligentFolder) -> None:
    do = ", and so are normal.txt and Normal_gt.png. Without true normals nothing can be judged; give one of them."
    name = found.normals_name or NORMALS[0]
    if found.lacks(name, do) or found.mask is None:
        return
    if (values := found.read(read_normal_map, name, *found.mask.shape)) is None:
        return
    length: Array = np.asarray(np.linalg.norm(values.astype(np.float64), axis=-1, keepdims=True))
    known = np.isfinite(length) & (length > 0.1)
    if not known.any():
        found.faults.append(f"{name}: no pixel has a normal (all are zero or no numbers).")
        return
    off = np.abs(length[known] - 1) > (0.05 if name.endswith(".png") else _UNIT)
    if off.mean() > _WRONG_LENGTHS:
        found.faults.append(
            f"{name}: {off.mean():.1%} of the vectors are not of length 1 (median length "
            f"{np.median(length[known]):.4g}). Divide each by its length; where there is none, write 0 0 0."
        )
    found.normals = np.where(known, values / np.where(known, length, 1), np.nan)

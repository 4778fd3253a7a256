"""A folder in the layout of the DiLiGenT benchmark [Shi2019]: names, and writing.

001.png ... (16 bits, linear), filenames.txt, light_directions.txt, light_intensities.txt (three numbers a line, one
line a photograph), mask.png, and the true normals. What every output folder has of it is in `scene.light_text`.
"""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.files import write_png, write_text, write_whole
from scene.frames import Frames
from scene.light_text import FILENAMES, light_tables
from scene.lights import Lights

MASK = "mask.png"
NORMALS = ("Normal_gt.mat", "normal.txt", "Normal_gt.png")
"""The first of them that is there counts."""


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

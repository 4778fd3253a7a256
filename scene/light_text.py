"""Lights as lines of text: the two formats that everybody reads, DiLiGenT's tables and `.lp`, and their names."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scene.lights import Lights

FILENAMES, DIRECTIONS, INTENSITIES = "filenames.txt", "light_directions.txt", "light_intensities.txt"
LP = "lights.lp"


def number_rows(rows: NDArray[np.float64]) -> str:
    """Return DiLiGenT's text of (N, 3): a light's three numbers a line."""
    return "".join(" ".join(f"{value:.8f}" for value in row) + "\n" for row in rows)


def light_tables(files: Sequence[str], lights: Lights) -> dict[str, str]:
    """Return DiLiGenT's three files, {name: text}; `files` are those of the photographs."""
    return {
        DIRECTIONS: number_rows(lights.directions),
        INTENSITIES: number_rows(lights.intensities),
        FILENAMES: "".join(f"{file}\n" for file in files),
    }


def lp_file(files: Sequence[str], lights: Lights) -> dict[str, str]:
    """Return the `.lp` file, {name: text}: the count, then the photograph's file and the direction a line."""
    rows = zip(files, lights.directions, strict=True)
    lines = [f"{file} {x:.8f} {y:.8f} {z:.8f}\n" for file, (x, y, z) in rows]
    return {LP: f"{len(lines)}\n{''.join(lines)}"}

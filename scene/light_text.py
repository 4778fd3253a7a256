"""Lights as lines of text: the two formats that everybody reads."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray


def number_rows(rows: NDArray[np.float64]) -> str:
    """Return DiLiGenT's text of (N, 3): a light's three numbers a line."""
    return "".join(" ".join(f"{value:.8f}" for value in row) + "\n" for row in rows)


def lp_rows(files: Iterable[str], directions: NDArray[np.float64]) -> str:
    """Return the text of an `.lp` file: the count, then file name and direction (N, 3) a line."""
    lines = [f"{name} {x:.8f} {y:.8f} {z:.8f}\n" for name, (x, y, z) in zip(files, directions, strict=True)]
    return f"{len(lines)}\n{''.join(lines)}"

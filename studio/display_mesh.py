"""Meshes as they are shown in the 3-D view."""

import numpy as np
from numpy.typing import NDArray

MOST_FACES = 70_000
"""That are sent to a browser; a software renderer still turns them. The built-in shapes have fewer."""


def display_mesh(vertices: NDArray[np.float64], faces: NDArray) -> tuple[NDArray[np.float64], NDArray]:
    """Return vertices (V, 3) and faces (F, 3) of a mesh, or of one that looks like it from afar.

    Of one with more than `MOST_FACES` the vertices are gathered in the cells of a cubic grid [Rossignac1993], each at
    its cell's mean; faces with two corners in one cell go. The grid is made coarser until few enough are left. An
    outline moves by less than a cell.
    """
    low = vertices.min(0)
    extent = float((vertices.max(0) - low).max()) or 1.0
    # A surface of area a few extents squared has about this many cells.
    cells = int(np.sqrt(MOST_FACES / 2))
    places, merged = vertices, faces
    while len(merged) > MOST_FACES:
        grid = ((vertices - low) * (cells / extent)).astype(np.int64)
        keys = (grid[:, 0] * (cells + 1) + grid[:, 1]) * (cells + 1) + grid[:, 2]
        _, cell, count = np.unique(keys, return_inverse=True, return_counts=True)
        places = np.stack([np.bincount(cell, column) for column in vertices.T], 1) / count[:, None]
        a, b, c = cell[faces].T
        merged = cell[faces][(a != b) & (b != c) & (c != a)]
        cells = int(0.8 * cells)
    return places, merged

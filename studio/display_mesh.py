"""Meshes as the browser's 3-D view shows them: at most so many triangles. What is rendered is the whole mesh."""

import numpy as np
from numpy.typing import NDArray

from twin.description.object_mesh import ObjectMesh

MOST_FACES = 60_000
"""That are sent to a browser; a software renderer still turns them."""


def display_mesh(mesh: ObjectMesh, *, most_faces: int = MOST_FACES) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return vertices (V, 3) and faces (T, 3) that look like the mesh from afar.

    Vertices are gathered in the cells of a cubic grid and stand at their mean; faces with two corners in one cell go.
    The grid is made coarser until few enough are left. An outline moves by less than a cell.
    """
    vertices, faces = mesh.vertices, mesh.faces
    if len(faces) <= most_faces:
        return vertices.astype(np.float32), faces.astype(np.uint32)
    low = vertices.min(0)
    extent = float((vertices.max(0) - low).max()) or 1.0
    # A surface of area a few extents squared has about this many cells.
    cells = int(np.sqrt(most_faces / 2))
    while True:
        grid = np.minimum(((vertices - low) / extent * cells).astype(np.int64), cells)
        key = (grid[:, 0] * (cells + 1) + grid[:, 1]) * (cells + 1) + grid[:, 2]
        _, cell, count = np.unique(key, return_inverse=True, return_counts=True)
        merged = cell[faces]
        whole = (merged != np.roll(merged, 1, 1)).all(1)
        merged = merged[whole]
        # Of faces with the same corners one will do, turned as the first was.
        _, first = np.unique(np.sort(merged, 1), axis=0, return_index=True) if len(merged) else (None, np.zeros(0, int))
        if len(first) <= most_faces:
            break
        cells = int(cells * min(0.9, np.sqrt(most_faces / len(first))))
    means = np.stack([np.bincount(cell, vertices[:, axis]) for axis in range(3)], 1) / count[:, None]
    return means.astype(np.float32), merged[np.sort(first)].astype(np.uint32)

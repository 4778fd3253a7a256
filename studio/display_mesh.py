"""Meshes as they are shown while nobody looks closely: in the 3-D view, and in the first picture after a change."""

import threading
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from scene.same_rows import first_of_same
from twin.description.object_mesh import ObjectMesh, smooth

MOST_FACES = 70_000
"""That are sent to a browser; a software renderer still turns them. The built-in shapes have fewer."""
_COARSE: WeakKeyDictionary[ObjectMesh, ObjectMesh] = WeakKeyDictionary()
_LOCK = threading.Lock()


def display_mesh(mesh: ObjectMesh) -> ObjectMesh:
    """Return the mesh, or where it has more than `MOST_FACES`, one that looks like it from afar.

    It is made once for as long as the mesh is used: the view and the preview ask for the same.
    """
    if len(mesh.faces) <= MOST_FACES:
        return mesh
    with _LOCK:
        if mesh not in _COARSE:
            _COARSE[mesh] = clustered(mesh, MOST_FACES)
        return _COARSE[mesh]


def clustered(mesh: ObjectMesh, most_faces: int) -> ObjectMesh:
    """Return a mesh of at most so many faces, its vertices gathered in the cells of a cubic grid [Rossignac1993].

    They stand at their cell's mean, with the mean of their texture coordinates and colours; faces with two corners in
    one cell go. The grid is made coarser until few enough are left. An outline moves by less than a cell.
    """
    vertices, faces = mesh.vertices, mesh.faces
    low = vertices.min(0)
    extent = float((vertices.max(0) - low).max()) or 1.0
    # A surface of area a few extents squared has about this many cells.
    cells = int(np.sqrt(most_faces / 2))
    while True:
        grid = ((vertices - low) * (cells / extent)).astype(np.int32)
        keys = (grid[:, 0] * (cells + 1) + grid[:, 1]) * (cells + 1) + grid[:, 2]
        _, cell, count = np.unique(keys, return_inverse=True, return_counts=True)
        merged = cell[faces]
        a, b, c = merged.T
        merged = merged[(a != b) & (b != c) & (c != a)].astype(np.int64)
        # Of faces with the same corners one will do, turned as the first was.
        merged = merged[first_of_same(np.sort(merged, 1)) == np.arange(len(merged))]
        if len(merged) <= most_faces:
            break
        cells = int(cells * min(0.9, np.sqrt(most_faces / len(merged))))

    def means(values: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
        return (
            None if values is None else np.stack([np.bincount(cell, column) for column in values.T], 1) / count[:, None]
        )

    places = means(vertices)
    assert places is not None
    return smooth(places, merged, means(mesh.texcoords), means(mesh.colours))

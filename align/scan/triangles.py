"""Cross products and middles of a mesh's triangles, for meshes of millions."""

import numpy as np
from numpy.typing import NDArray


def crosses(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return (b - a) x (c - a) of faces (T, 3): along the normal (T, 3), twice the area long."""
    a = vertices[faces[:, 0]]
    return np.cross(vertices[faces[:, 1]] - a, vertices[faces[:, 2]] - a)


def lengths(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lengths (N,) of vectors (N, 3)."""
    return np.sqrt(np.einsum("nk,nk->n", vectors, vectors))


def middles(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the middle (T, 3) of each face (T, 3)."""
    total = vertices[faces[:, 0]]
    total += vertices[faces[:, 1]]
    total += vertices[faces[:, 2]]
    total /= 3
    return total

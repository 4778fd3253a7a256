"""How far a scan's noise turns its plain vertex normals, the area-weighted means of the faces around.

Large faces need no fit: noise hardly turns them. A decimated scan has large faces where it is flat, and there the plain
normals are better than any fit over the few, far neighbours.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from scene.mesh import Mesh

Array = NDArray[np.float64]


def plain_normal_gain(mesh: Mesh, indptr: NDArray, indices: NDArray) -> Array:
    """Return (V,) the rms turn, radians, of each vertex normal for noise of 1 mm along the vertices' normals.

    Parameters
    ----------
    mesh : Mesh
    indptr, indices : (V + 1,), (E,) int
        The vertices that share an edge with each, itself not among them (compressed rows).

    Notes
    -----
    The normal's direction is that of S = sum of the faces' cross products. A vertex k that moves by z along its normal
    n changes each of its faces' by z (e x n), with e the edge across from k; the squares of the sums over the faces
    that both vertices share, without their part along S, add up over k, divided by |S|^2.
    """
    total = np.zeros_like(mesh.vertices)
    own, shared = np.zeros_like(mesh.vertices), np.zeros((len(indices), 3))
    _sum_turns(mesh.faces, mesh.vertices, mesh.vertex_normals, indptr, indices, total, own, shared)
    length = np.linalg.norm(total, axis=1)
    axis = total / np.maximum(length, 1e-300)[:, None]
    row = np.repeat(np.arange(len(total)), np.diff(indptr))

    def across(turns: Array, direction: Array) -> Array:
        return (turns**2).sum(1) - np.einsum("ek,ek->e", turns, direction) ** 2

    square = across(own, axis) + np.bincount(row, across(shared, axis[row]), len(total))
    return np.sqrt(np.maximum(square, 0)) / np.maximum(length, 1e-300)


@numba.njit(cache=True)
def _sum_turns(faces, vertices, normals, indptr, indices, total, own, shared):  # pragma: no cover
    """Sum, for each vertex, its faces' cross products, and what each neighbour's shift changes them by."""
    edge, turn = np.zeros(3), np.zeros(3)
    for face in faces:
        for corner in range(3):
            k, after, before = face[corner], face[(corner + 1) % 3], face[(corner + 2) % 3]
            for axis in range(3):
                edge[axis] = vertices[before, axis] - vertices[after, axis]
            n = normals[k]
            turn[0] = edge[1] * n[2] - edge[2] * n[1]
            turn[1] = edge[2] * n[0] - edge[0] * n[2]
            turn[2] = edge[0] * n[1] - edge[1] * n[0]
            # The face's own cross product, from the two edges that leave corner k.
            a = vertices[after] - vertices[k]
            b = vertices[before] - vertices[k]
            total[k, 0] += a[1] * b[2] - a[2] * b[1]
            total[k, 1] += a[2] * b[0] - a[0] * b[2]
            total[k, 2] += a[0] * b[1] - a[1] * b[0]
            own[k] += turn
            for other in (after, before):
                for place in range(indptr[other], indptr[other + 1]):
                    if indices[place] == k:
                        shared[place] += turn
                        break

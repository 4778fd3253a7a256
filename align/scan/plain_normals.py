"""How far a scan's noise turns its plain vertex normals, the area-weighted means of the faces around.

Large faces need no fit: noise hardly turns them. A decimated scan has large faces where it is flat, and there the plain
normals are better than any fit over the few, far neighbours.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from scene.mesh import Mesh

Array = NDArray[np.float64]


def plain_normal_gain(mesh: Mesh) -> Array:
    """Return (V,) the rms turn, radians, of each vertex normal for noise of 1 mm along the vertices' normals.

    The normal's direction is that of S = sum of the faces' cross products. A vertex k that moves by z along its normal
    n changes each of its faces' by z (e x n), with e the edge across from k; the squares of the sums over the faces
    that both vertices share, without their part along S, add up over k, divided by |S|^2.
    """
    count, faces = len(mesh.vertices), mesh.faces
    corners = mesh.vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turn = np.cross(np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1), mesh.vertex_normals[faces])
    # Each face tells each of its corners (rows) what the moves of all three (columns) do to it.
    place = np.repeat(faces, 3, axis=1).ravel(), np.tile(faces, 3).ravel()
    total, square, along = np.zeros((count, 3)), np.zeros(count), csr_array((count, count))
    for axis in range(3):
        moved = csr_array((np.tile(turn[..., axis], 3).ravel(), place), (count, count))
        square += moved.power(2).sum(1)
        along = along + moved.multiply(mesh.vertex_normals[:, [axis]])
        total[:, axis] = np.bincount(faces.ravel(), np.repeat(cross[:, axis], 3), count)
    square -= along.power(2).sum(1)
    return np.sqrt(np.maximum(square, 0)) / np.maximum(np.linalg.norm(total, axis=1), 1e-300)

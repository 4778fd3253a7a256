"""Where the surface breaks: edges of the mesh that cross a crease, found under noise.

The faces' normals around a suspicion are averaged over neighbours that agree, again and again: each side of a crease
comes to rest, and the narrow faces that bridge it agree with nobody [Zheng2011].
"""

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from align.scan.jets import Neighbours
from scene.mesh import Mesh

ROUNDS = 8
ALIKE = 0.25
"""Normals that differ by more than two of these (chord of the angle: 14 degrees) hardly average."""
SWEEPS = 4
BEND_DEG = 35.0
"""Vertices of one edge whose sides differ by more are on two sides of a crease."""
RING = 256
"""Vertices of a ring and its ring; more are not asked."""


def cross_creases(
    mesh: Mesh, near: Neighbours, suspect: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return which half-edges cross a crease, (3 T,) in the order corner 0 to 1, 1 to 2, 2 to 0 of each face.

    And each vertex's normal on its own side, (V, 3): the mesh's own away from `suspect` vertices (V,), near which the
    surface bends more than smooth fits can follow; nowhere else is a crease looked for.
    """
    cut, side = np.zeros(3 * len(mesh.faces), bool), mesh.vertex_normals.copy()
    faces = np.flatnonzero(suspect[mesh.faces].any(1))
    if not len(faces):
        return cut, side
    corners, normals = mesh.faces[faces], mesh.face_normals[faces]
    numbers = np.repeat(np.arange(len(faces)), 3)
    has = csr_array((np.ones(corners.size), (numbers, corners.ravel())), (len(faces), len(mesh.vertices)))
    beside = (has @ has.T).tocoo()
    first, second = (mesh.vertices[corners[:, k]] - mesh.vertices[corners[:, 0]] for k in (1, 2))
    area = np.linalg.norm(np.cross(first, second), axis=1)

    def agreeing(weight: NDArray) -> coo_array:
        """Return (T, T): how much faces that share a corner agree, by the other's weight (T,)."""
        apart = ((rested[beside.row] - rested[beside.col]) ** 2).sum(1)
        alike = beside.data * weight[beside.col] * np.exp(-0.5 * apart / ALIKE**2)
        return coo_array((alike, (beside.row, beside.col)), beside.shape)

    rested = normals
    for _ in range(ROUNDS):
        rested = agreeing(area) @ rested
        rested /= np.maximum(np.linalg.norm(rested, axis=1, keepdims=True), 1e-300)
    # A bridging face that was talked over to one side says nothing of its vertices.
    trust = agreeing(area * np.exp(-0.5 * ((rested - normals) ** 2).sum(1) / ALIKE**2)).sum(1)
    # Of the faces around a vertex the one that is trusted most comes last, and stays.
    order = np.argsort(trust)
    side[corners[order].ravel()] = np.repeat(rested[order], 3, axis=0)
    side[~suspect] = mesh.vertex_normals[~suspect]
    for _ in range(SWEEPS):
        side = _move_over(np.flatnonzero(suspect), near.graph, side)
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    both = np.flatnonzero(suspect[start] & suspect[end])
    cut[both] = np.einsum("ek,ek->e", side[start[both]], side[end[both]]) < np.cos(np.radians(BEND_DEG))
    return cut, side


@numba.njit(nogil=True, cache=True)
def _move_over(suspects, graph, side):  # pragma: no cover
    """Give each vertex the side on whose planes it lies: those of its neighbours' neighbours, seen from each."""
    vertices, indptr, indices = graph
    out = side.copy()
    alike = np.cos(np.radians(BEND_DEG / 2))
    ring, height = np.zeros(RING, np.int64), np.zeros(RING)
    for vertex in suspects:
        count = 0
        for k in range(indptr[vertex], indptr[vertex + 1]):
            for m in range(indptr[indices[k]], indptr[indices[k] + 1]):
                j = indices[m]
                if j != vertex and count < RING:
                    ring[count], height[count] = j, 0.0
                    for axis in range(3):
                        height[count] += (vertices[vertex, axis] - vertices[j, axis]) * side[j, axis]
                    count += 1
        best = np.inf
        for k in range(indptr[vertex], indptr[vertex + 1]):
            total, members = 0.0, 0
            for m in range(count):
                cosine = 0.0
                for axis in range(3):
                    cosine += side[ring[m], axis] * side[indices[k], axis]
                if cosine > alike:
                    total += height[m]
                    members += 1
            # A side of one or two vertices is none.
            if members >= 5 and abs(total / members) < best:
                best = abs(total / members)
                out[vertex] = side[indices[k]]
    return out

"""Where the surface breaks: edges of the mesh that cross a crease, found under noise.

The faces' normals around a suspicion are averaged over neighbours that agree, again and again: each side of a crease
comes to rest, and the narrow faces that bridge it agree with nobody [Zheng2011].
"""

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from align.scan.scan_noise import Neighbours
from scene.mesh import Mesh

ROUNDS = 8
ALIKE = 0.25
"""Normals that differ by more than two of these (chord of the angle: 14 degrees) hardly average."""
SWEEPS = 4
BEND_DEG = 35.0
"""Vertices of one edge whose sides differ by more are on two sides of a crease."""


def cross_creases(
    mesh: Mesh, near: Neighbours, suspect: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return which half-edges cross a crease, (3 T,) in the order corner 0 to 1, 1 to 2, 2 to 0 of each face.

    And each vertex's normal on its own side, (V, 3): the mesh's own away from `suspect` vertices (V,), near which the
    surface bends more than smooth fits can follow; nowhere else is a crease looked for.
    """
    cut = np.zeros(3 * len(mesh.faces), bool)
    side = mesh.vertex_normals.copy()
    faces = np.flatnonzero(suspect[mesh.faces].any(1))
    if not len(faces):
        return cut, side
    count = len(mesh.vertices)
    corners = mesh.faces[faces]
    around = csr_matrix(
        (np.ones(corners.size, np.int8), (corners.ravel(), np.repeat(np.arange(len(faces)), 3))), (count, len(faces))
    )
    normals = mesh.face_normals[faces]
    first, second = (mesh.vertices[corners[:, k]] - mesh.vertices[corners[:, 0]] for k in (1, 2))
    area = np.linalg.norm(np.cross(first, second), axis=1)
    rested = normals
    for _ in range(ROUNDS):
        rested = _agree(corners, around.indptr, around.indices, rested, area)
    # A bridging face that was talked over to one side says nothing of its vertices.
    trust = area * np.exp(-0.5 * ((rested - normals) ** 2).sum(1) / ALIKE**2)
    _sides(np.flatnonzero(suspect), around.indptr, around.indices, rested, trust, side)
    for _ in range(SWEEPS):
        side = _move_over(np.flatnonzero(suspect), near.graph, side)
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    both = np.flatnonzero(suspect[start] & suspect[end])
    bend = np.einsum("ek,ek->e", side[start[both]], side[end[both]])
    cut[both] = bend < np.cos(np.radians(BEND_DEG))
    return cut, side


@numba.njit(nogil=True, cache=True)
def _likeness(normals, one, two):  # pragma: no cover
    square = 0.0
    for axis in range(3):
        square += (normals[one, axis] - normals[two, axis]) ** 2
    return np.exp(-0.5 * square / ALIKE**2)


@numba.njit(nogil=True, cache=True)
def _agree(corners, indptr, indices, normals, area):  # pragma: no cover
    """Average each face's normal over the faces at its corners that agree with it."""
    out = np.zeros_like(normals)
    for face in range(len(corners)):
        for corner in range(3):
            vertex = corners[face, corner]
            for k in range(indptr[vertex], indptr[vertex + 1]):
                weight = area[indices[k]] * _likeness(normals, face, indices[k])
                for axis in range(3):
                    out[face, axis] += weight * normals[indices[k], axis]
        length = np.sqrt((out[face] ** 2).sum())
        out[face] = out[face] / length if length > 0 else normals[face]
    return out


@numba.njit(nogil=True, cache=True)
def _sides(vertices, indptr, indices, normals, trust, side):  # pragma: no cover
    """Give each vertex the normal that most of its faces' trust agrees on."""
    for vertex in vertices:
        best = 0.0
        for k in range(indptr[vertex], indptr[vertex + 1]):
            votes = 0.0
            for m in range(indptr[vertex], indptr[vertex + 1]):
                votes += trust[indices[m]] * _likeness(normals, indices[k], indices[m])
            if votes > best:
                best = votes
                side[vertex] = normals[indices[k]]


@numba.njit(nogil=True, cache=True)
def _move_over(suspects, graph, side):  # pragma: no cover
    """Give each vertex the side on whose planes it lies: those of its neighbours' neighbours, seen from each."""
    vertices, indptr, indices = graph
    out = side.copy()
    alike = np.cos(np.radians(BEND_DEG / 2))
    ring = np.zeros(256, np.int64)
    for vertex in suspects:
        count = 0
        for k in range(indptr[vertex], indptr[vertex + 1]):
            for m in range(indptr[indices[k]], indptr[indices[k] + 1]):
                if indices[m] != vertex and count < len(ring):
                    ring[count] = indices[m]
                    count += 1
        best = np.inf
        for k in range(indptr[vertex], indptr[vertex + 1]):
            candidate = side[indices[k]]
            total, members = 0.0, 0
            for m in range(count):
                j = ring[m]
                if (side[j] * candidate).sum() > alike:
                    total += ((vertices[vertex] - vertices[j]) * side[j]).sum()
                    members += 1
            # A side of one or two vertices is none.
            if members >= 5 and abs(total / members) < best:
                best = abs(total / members)
                out[vertex] = candidate
    return out

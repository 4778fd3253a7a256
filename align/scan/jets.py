"""Local surfaces: cubics through a vertex's neighbourhood, and the normals they give.

The height over the tangent plane is fitted by weighted least squares; the slope at the vertex turns the normal
[Cazals2005]. Compiled: no Python per vertex.
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

TERMS = 10
"""Of a cubic of two variables."""
MOST = 1024
"""Vertices of one neighbourhood; more are not gathered."""


class Graph(NamedTuple):
    """A mesh as a graph: the neighbours of vertex i are indices[indptr[i]:indptr[i + 1]]."""

    vertices: NDArray[np.float64]
    """(V, 3), mm."""
    indptr: NDArray[np.int64]
    indices: NDArray[np.int64]


class Fits(NamedTuple):
    """Fits around K vertices."""

    normals: NDArray[np.float64]
    """(K, 3) unit; as at the start where not fitted."""
    variance: NDArray[np.float64]
    """(K,), radians squared for noise of 1 mm; infinite where too few neighbours determine the fit."""
    rough: NDArray[np.float64]
    """(K,), mm^2: the mean squared residual; infinite where not fitted."""


@numba.njit(nogil=True, cache=True)
def gather(i, radius, graph, stamp, found):  # pragma: no cover
    """Fill `found` with the vertices within `radius` of vertex i that edges lead to; return how many.

    Along the surface: the other side of a thin wall is near in space, and not reached. `stamp` (V,) holds for each
    vertex for which one it was looked at last.
    """
    found[0] = i
    stamp[i] = i
    count, at = 1, 0
    while at < count:
        here = found[at]
        at += 1
        for k in range(graph.indptr[here], graph.indptr[here + 1]):
            j = graph.indices[k]
            if stamp[j] == i:
                continue
            stamp[j] = i
            square = 0.0
            for axis in range(3):
                square += (graph.vertices[j, axis] - graph.vertices[i, axis]) ** 2
            if square < radius * radius and count < len(found):
                found[count] = j
                count += 1
    return count


@numba.njit(nogil=True, cache=True)
def tangents(normal, frame):  # pragma: no cover
    """Fill `frame` (3, 3) with two tangents and the normal, as rows; the turn about the normal is arbitrary."""
    x, y, z = normal
    side = 1.0 if z >= 0 else -1.0
    a = -1 / (side + z)
    frame[0, 0], frame[0, 1], frame[0, 2] = 1 + side * x * x * a, side * x * y * a, -side * x
    frame[1, 0], frame[1, 1], frame[1, 2] = x * y * a, side + y * y * a, -y
    frame[2, 0], frame[2, 1], frame[2, 2] = x, y, z


@numba.njit(nogil=True, cache=True)
def accumulate(found, radius, vertices, heights, frame, rows, work):  # pragma: no cover
    """Sum the normal equations of a neighbourhood (about its first vertex) into `work`.

    rows : (N, 11), filled: of each neighbour the monomials of its place x, y in the tangent plane, and its height z.
    work : (13, 11): the rows' products, and the slopes' unit vectors (11, 12). Lengths are in radii. Where `heights`
    (V,) are given, they stand in for the surface's own. All neighbours weigh the same: of all weights in the same
    circle these leave the least noise in the slope.
    """
    for n, j in enumerate(found):
        x = y = z = 0.0
        for axis in range(3):
            away = (vertices[j, axis] - vertices[found[0], axis]) / radius
            x += away * frame[0, axis]
            y += away * frame[1, axis]
            z += away * frame[2, axis]
        if len(heights):
            z = heights[j] / radius
        for m, value in enumerate((1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y, z)):
            rows[n, m] = value
    work[: TERMS + 1] = rows.T @ rows
    work[TERMS + 1 :] = 0.0
    work[11, 1] = work[12, 2] = 1.0


@numba.njit(nogil=True, cache=True)
def factor(work, ridge):  # pragma: no cover
    """Replace the normal matrix M = L L^T by L, and each row r below M by r L^-T.

    The dot product of two such rows is r M^-1 s. Return whether M is regular.
    """
    for b in range(TERMS):
        for a in range(b, len(work)):
            value = work[a, b]
            for c in range(b):
                value -= work[a, c] * work[b, c]
            if a > b:
                work[a, b] = value / work[b, b]
            elif value < ridge:
                return False
            else:
                work[b, b] = np.sqrt(value)
    return True


@numba.njit(nogil=True, cache=True)
def fit_normals(chosen, radii, graph, heights, start, fits):  # pragma: no cover
    """Fit around the vertices `chosen` (K,), with one radius each (K,), and fill `fits`.

    `start` (V, 3) are the normals over whose planes heights are measured; `heights`: see `accumulate`.
    """
    normals, variance, rough = fits
    stamp = np.full(len(graph.vertices), -1, np.int64)
    found = np.zeros(MOST, np.int64)
    frame, rows, work = np.zeros((3, 3)), np.zeros((MOST, TERMS + 1)), np.zeros((13, TERMS + 1))
    for k in range(len(chosen)):
        i, radius = chosen[k], radii[k]
        variance[k] = np.inf
        rough[k] = np.inf
        normals[k] = start[i]
        count = gather(i, radius, graph, stamp, found)
        tangents(start[i], frame)
        accumulate(found[:count], radius, graph.vertices, heights, frame, rows[:count], work)
        if count < TERMS + 2 or not factor(work, 1e-6 * count):
            continue
        right, along, across = work[10, :TERMS], work[11, :TERMS], work[12, :TERMS]
        u, v = (along * right).sum(), (across * right).sum()
        # The normal of a surface of these slopes over the frame.
        steep = 1.0 + u * u + v * v
        normals[k] = (frame[2] - u * frame[0] - v * frame[1]) / np.sqrt(steep)
        variance[k] = ((along * along).sum() + (across * across).sum()) / (radius * steep) ** 2
        rough[k] = max(work[10, 10] - (right * right).sum(), 0.0) * radius * radius / count

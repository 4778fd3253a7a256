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
RIDGE, LOUD = 1e-9, 1e3
"""What is added to the equations' diagonal, a neighbour; and the slope's variance times the neighbours, from which on
they lie too badly for a fit: it is below 20 where they are even."""


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
def fit_normals(chosen, radii, graph, heights, frames, fits):  # pragma: no cover
    """Fit around the vertices `chosen` (K,), with one radius each (K,), and fill `fits`.

    `frames` (K, 3, 3): two tangents and the normal as rows, over whose plane heights are measured. Where `heights` (V,)
    are given, they stand in for the surface's own. Lengths are in radii. All neighbours weigh the same: of all weights
    in the same circle these leave the least noise in the slope.
    """
    normals, variance, rough = fits
    stamp = np.full(len(graph.vertices), -1, np.int64)
    found, rows = np.zeros(MOST, np.int64), np.zeros((MOST, TERMS + 1))
    for k in range(len(chosen)):
        i, radius, frame = chosen[k], radii[k], frames[k]
        normals[k], variance[k], rough[k] = frame[2], np.inf, np.inf
        count = gather(i, radius, graph, stamp, found)
        if count < TERMS + 2:
            continue
        for n, j in enumerate(found[:count]):
            x = y = z = 0.0
            for axis in range(3):
                away = (graph.vertices[j, axis] - graph.vertices[i, axis]) / radius
                x += away * frame[0, axis]
                y += away * frame[1, axis]
                z += away * frame[2, axis]
            if len(heights):
                z = heights[j] / radius
            for m, value in enumerate((1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y, z)):
                rows[n, m] = value
        square = rows[:count].T @ rows[:count]
        for m in range(TERMS):
            square[m, m] += RIDGE * count
        inverse, right = np.linalg.inv(square[:TERMS, :TERMS]), square[TERMS, :TERMS]
        if (inverse[1, 1] + inverse[2, 2]) * count > LOUD:
            continue
        solution = inverse @ right
        u, v = solution[1], solution[2]
        # The normal of a surface of these slopes over the frame.
        steep = 1.0 + u * u + v * v
        normals[k] = (frame[2] - u * frame[0] - v * frame[1]) / np.sqrt(steep)
        variance[k] = (inverse[1, 1] + inverse[2, 2]) / (radius * steep) ** 2
        rough[k] = max(square[TERMS, TERMS] - solution @ right, 0.0) * radius * radius / count

"""Local surfaces: polynomials of degree 2 and 3 through a vertex's neighbourhood, and the normals they give.

The height over the tangent plane is fitted by weighted least squares; the slope at the vertex turns the normal
[Cazals2005]. One Cholesky factor serves both degrees: the square's block of the normal equations is the cube's first.
Compiled: no Python per vertex.
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

QUADRATIC, CUBIC = 6, 10
OF_X, OF_Y = np.array([0, 1, 0, 2, 1, 0, 3, 2, 1, 0]), np.array([0, 0, 1, 0, 1, 2, 0, 1, 2, 3])
"""Exponents of the monomials."""
MOST = 1024
"""Vertices of one neighbourhood; more are not gathered."""


class Graph(NamedTuple):
    """A mesh as a graph: the neighbours of vertex i are indices[indptr[i]:indptr[i + 1]]."""

    vertices: NDArray[np.float64]
    """(V, 3), mm."""
    indptr: NDArray[np.int64]
    indices: NDArray[np.int64]


class Fits(NamedTuple):
    """Fits of degree 2 and 3 around K vertices."""

    normals: NDArray[np.float64]
    """(K, 2, 3) unit; as at the start where not fitted."""
    variance: NDArray[np.float64]
    """(K, 2), radians squared for noise of 1 mm; infinite where too few neighbours determine the fit."""
    rough: NDArray[np.float64]
    """(K, 2), mm^2: the mean squared residual; infinite where not fitted."""

    @classmethod
    def empty(cls, count: int) -> "Fits":
        return cls(np.zeros((count, 2, 3)), np.zeros((count, 2)), np.zeros((count, 2)))


@numba.njit(nogil=True, cache=True)
def gather(i, radius, graph, stamp, tag, found):  # pragma: no cover
    """Fill `found` with the vertices within `radius` of vertex i that edges lead to; return how many.

    Along the surface: the other side of a thin wall is near in space, and not reached.
    """
    found[0] = i
    stamp[i] = tag
    count, at = 1, 0
    while at < count:
        here = found[at]
        at += 1
        for k in range(graph.indptr[here], graph.indptr[here + 1]):
            j = graph.indices[k]
            if stamp[j] == tag:
                continue
            stamp[j] = tag
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
    if x == 0.0 and y == 0.0:
        # Straight up or down, or no normal at all: a vertex that no face uses.
        a, b, c = 1.0, 0.0, 0.0
        z = 1.0 if z == 0.0 else z
    elif abs(z) < 0.9:
        length = np.sqrt(x * x + y * y)
        a, b, c = -y / length, x / length, 0.0
    else:
        length = np.sqrt(y * y + z * z)
        a, b, c = 0.0, -z / length, y / length
    frame[0, 0], frame[0, 1], frame[0, 2] = a, b, c
    frame[1, 0], frame[1, 1], frame[1, 2] = y * c - z * b, z * a - x * c, x * b - y * a
    frame[2, 0], frame[2, 1], frame[2, 2] = x, y, z


@numba.njit(nogil=True, cache=True, fastmath=True)
def accumulate(found, radius, vertices, heights, frame, work):  # pragma: no cover
    """Sum the normal equations of a neighbourhood (about its first vertex) into `work`; return the heights' squares.

    work : (14, 10): normal matrix (rows 0-9, lower half), right-hand side (10), solutions (12, 13).
    Lengths are in radii. Where `heights` (V,) are given, they stand in for the surface's own over the tangent plane.
    All neighbours weigh the same: of all weights in the same circle these leave the least noise in the slope.
    The matrix's 55 elements are but 28 different sums, of x^p y^q; they are summed once each.
    """
    moments, raised = np.zeros((7, 7)), np.zeros((4, 4))
    square = 0.0
    i = found[0]
    for j in found:
        x = y = z = 0.0
        for axis in range(3):
            away = (vertices[j, axis] - vertices[i, axis]) / radius
            x += away * frame[0, axis]
            y += away * frame[1, axis]
            z += away * frame[2, axis]
        if len(heights):
            z = heights[j] / radius
        square += z * z
        start = 1.0
        for p in range(7):
            power = start
            for q in range(7 - p):
                moments[p, q] += power
                if p + q < 4:
                    raised[p, q] += power * z
                power *= y
            start *= x
    for a in range(CUBIC):
        work[10, a] = raised[OF_X[a], OF_Y[a]]
        for b in range(a + 1):
            work[a, b] = moments[OF_X[a] + OF_X[b], OF_Y[a] + OF_Y[b]]
    return square


@numba.njit(nogil=True, cache=True)
def factor(work, first, size, ridge):  # pragma: no cover
    """Replace rows `first` to `size` of the normal matrix by its Cholesky factor's; return whether it is regular."""
    for a in range(first, size):
        for b in range(a + 1):
            value = work[a, b]
            for c in range(b):
                value -= work[a, c] * work[b, c]
            if a == b:
                if value < ridge:
                    return False
                work[a, a] = np.sqrt(value)
            else:
                work[a, b] = value / work[b, b]
    return True


@numba.njit(nogil=True, cache=True)
def solve(work, size, solution):  # pragma: no cover
    """Solve the factored equations in place for a right-hand side in `solution`."""
    for a in range(size):
        for b in range(a):
            solution[a] -= work[a, b] * solution[b]
        solution[a] /= work[a, a]
    for a in range(size - 1, -1, -1):
        for b in range(a + 1, size):
            solution[a] -= work[b, a] * solution[b]
        solution[a] /= work[a, a]


@numba.njit(nogil=True, cache=True)
def slope(work, size, radius, out):  # pragma: no cover
    """Fill `out` with the slope along both tangents and the variance (radians squared) that noise of 1 mm gives it."""
    out[2] = 0.0
    row = work[12]
    for axis in range(2):
        row[:] = 0.0
        row[axis + 1] = 1.0
        solve(work, size, row)
        out[axis] = 0.0
        for a in range(size):
            out[axis] += row[a] * work[10, a]
        out[2] += row[axis + 1] / (radius * radius)


@numba.njit(nogil=True, cache=True)
def fit_normals(chosen, radii, graph, heights, start, fits):  # pragma: no cover
    """Fit both degrees around the vertices `chosen` (K,), with one radius each (K,), and fill `fits`.

    `start` (V, 3) are the normals over whose planes heights are measured; `heights`: see `accumulate`.
    """
    normals, variance, rough = fits
    stamp = np.full(len(graph.vertices), -1, np.int64)
    found = np.zeros(MOST, np.int64)
    frame, work, out = np.zeros((3, 3)), np.zeros((14, 10)), np.zeros(3)
    for k in range(len(chosen)):
        i, radius = chosen[k], radii[k]
        variance[k] = np.inf
        rough[k] = np.inf
        normals[k] = start[i]
        count = gather(i, radius, graph, stamp, k, found)
        tangents(start[i], frame)
        square = accumulate(found[:count], radius, graph.vertices, heights, frame, work)
        first = 0
        for degree, size in enumerate((QUADRATIC, CUBIC)):
            if count < size + 2 or not factor(work, first, size, 1e-6 * count):
                break
            first = size
            slope(work, size, radius, out)
            # The normal of a surface of these slopes over the frame.
            steep = 1.0 + out[0] * out[0] + out[1] * out[1]
            for axis in range(3):
                along = frame[2, axis] - out[0] * frame[0, axis] - out[1] * frame[1, axis]
                normals[k, degree, axis] = along / np.sqrt(steep)
            variance[k, degree] = out[2] / steep**2
            work[13] = work[10]
            solve(work, size, work[13])
            left = square
            for a in range(size):
                left -= work[13, a] * work[10, a]
            rough[k, degree] = max(left, 0.0) * radius * radius / count


@numba.njit(nogil=True, cache=True)
def ring_bend(graph, normals):  # pragma: no cover
    """Return (V,) the rms by which the neighbours' normals miss a linear law of place about each vertex's."""
    vertices, indptr, indices = graph
    out = np.zeros(len(vertices))
    frame, left = np.zeros((3, 3)), np.zeros((64, 3))
    for i in range(len(vertices)):
        tangents(normals[i], frame)
        first, last = indptr[i], min(indptr[i + 1], indptr[i] + len(left))
        a = b = c = 1e-30
        slopes = np.zeros((2, 3))
        for k in range(first, last):
            x = y = 0.0
            for axis in range(3):
                away = vertices[indices[k], axis] - vertices[i, axis]
                x += away * frame[0, axis]
                y += away * frame[1, axis]
            a += x * x
            b += x * y
            c += y * y
            left[k - first, 0], left[k - first, 1] = x, y
            for axis in range(3):
                turned = normals[indices[k], axis] - normals[i, axis]
                slopes[0, axis] += x * turned
                slopes[1, axis] += y * turned
        determinant = a * c - b * b
        if last - first < 4 or determinant <= 1e-6 * a * c:
            out[i] = 0.0
            continue
        square = 0.0
        for k in range(first, last):
            x, y = left[k - first, 0], left[k - first, 1]
            for axis in range(3):
                along = (c * slopes[0, axis] - b * slopes[1, axis]) / determinant
                across = (a * slopes[1, axis] - b * slopes[0, axis]) / determinant
                miss = normals[indices[k], axis] - normals[i, axis] - along * x - across * y
                square += miss * miss
        # Four or more neighbours share two slopes.
        out[i] = np.sqrt(square / (last - first - 2))
    return out

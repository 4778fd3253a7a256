"""Local surfaces: polynomials of degree 3 through a vertex's neighbourhood, and the normals they give.

The height over the tangent plane is fitted by least squares; the slope at the vertex turns the normal [Cazals2005].
Compiled: no Python per vertex.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, eye_array

from scene.fan_out import fan_out
from scene.mesh import Mesh

Array = NDArray[np.float64]

CUBIC = 10
"""Coefficients of a polynomial of degree 3 in x and y."""
MOST = 1024
"""Vertices of one neighbourhood; more are not gathered."""
RIDGE = 1e-7
"""Of the neighbours' number, added to the normal equations: a slope that they do not tell is most uncertain."""
CHUNK = 1 << 14


class Graph(NamedTuple):
    """A mesh as a graph: the neighbours of vertex i are indices[indptr[i]:indptr[i + 1]]."""

    vertices: Array
    """(V, 3), mm."""
    indptr: NDArray[np.int64]
    indices: NDArray[np.int64]


class Fits(NamedTuple):
    """Fits around K vertices."""

    normals: Array
    """(K, 3) unit; as at the start where not fitted."""
    variance: Array
    """(K,), radians squared for noise of 1 mm; infinite where too few neighbours determine the fit."""
    rough: Array
    """(K,), mm^2: the variance of the heights about the fit."""


@dataclass(frozen=True)
class Neighbours:
    """The mesh as a graph."""

    graph: Graph
    """Which vertices share an edge with which."""
    average: csr_array
    """(V, V): the mean over a vertex and its neighbours."""
    spacing_mm: Array
    """(V,): length of the edges around, evened out."""

    @classmethod
    def of(cls, mesh: Mesh, *, keep: NDArray[np.bool_] | None = None) -> "Neighbours":
        """Return the graph of a mesh; `keep` (3 T,) leaves out half-edges (corner 0 to 1, 1 to 2, 2 to 0)."""
        count = len(mesh.vertices)
        start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
        if keep is not None:
            start, end = start[keep], end[keep]
        graph = csr_array((np.ones(len(start)), (start, end)), (count, count))
        graph = (graph + graph.T).tocsr()
        graph.data[:] = 1
        near = graph + eye_array(count)
        average = (diags_array(1 / near.sum(1)) @ near).tocsr()
        degree = np.diff(graph.indptr)
        rows = np.repeat(np.arange(count), degree)
        length = np.linalg.norm(mesh.vertices[rows] - mesh.vertices[graph.indices], axis=1)
        spacing = np.bincount(rows, length, count) / np.maximum(degree, 1)
        # A vertex without edges takes the scan's middle length.
        spacing[degree == 0] = np.median(spacing)
        links = Graph(mesh.vertices, graph.indptr.astype(np.int64), graph.indices.astype(np.int64))
        found = cls(links, average, spacing)
        return cls(links, average, found.smooth(spacing, 3))

    def smooth(self, values: Array, rounds: int) -> Array:
        """Return (V, ...) averaged `rounds` times over each vertex and its neighbours."""
        for _ in range(rounds):
            values = self.average @ values
        return values

    def fit(self, start: Array, chosen: NDArray, step: float) -> Fits:
        """Fit around the vertices `chosen` (K,) within `step` spacings, on all cores.

        `start` (V, 3) are the normals over whose planes heights are measured.
        """
        fits = Fits(start[chosen], np.full(len(chosen), np.inf), np.full(len(chosen), np.inf))

        def work(first: int) -> None:
            part = slice(first, first + CHUNK)
            _fit_normals(
                chosen[part], step * self.spacing_mm[chosen[part]], self.graph, Fits(*(array[part] for array in fits))
            )

        fan_out(work, range(0, len(chosen), CHUNK))
        return fits


@numba.njit(nogil=True, cache=True)
def _gather(i, radius, graph, stamp, found):  # pragma: no cover
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
def _tangents(normal, frame):  # pragma: no cover
    """Fill `frame` (3, 3) with two tangents and the normal, as rows; the turn about the normal is arbitrary."""
    x, y, z = normal
    side = 1.0 if z >= 0 else -1.0
    a = -1 / (side + z)
    frame[0, 0], frame[0, 1], frame[0, 2] = 1 + side * x * x * a, side * x * y * a, -side * x
    frame[1, 0], frame[1, 1], frame[1, 2] = x * y * a, side + y * y * a, -y
    frame[2, 0], frame[2, 1], frame[2, 2] = x, y, z


@numba.njit(nogil=True, cache=True)
def _fit_normals(chosen, radii, graph, fits):  # pragma: no cover
    """Fit around the vertices `chosen` (K,), with one radius each (K,), and fill `fits`, whose normals are the start.

    All neighbours weigh the same: of all weights in the same circle these leave the least noise in the slope. Lengths
    are in radii.
    """
    normals, variance, rough = fits
    stamp = np.full(len(graph.vertices), -1, np.int64)
    found = np.zeros(MOST, np.int64)
    frame, rows = np.zeros((3, 3)), np.zeros((MOST, CUBIC + 1))
    # Of the heights, and the slopes' unit vectors.
    right = np.zeros((CUBIC, 3))
    for k in range(len(chosen)):
        i, radius = chosen[k], radii[k]
        count = _gather(i, radius, graph, stamp, found)
        if count < CUBIC + 2:
            continue
        _tangents(normals[k], frame)
        for n in range(count):
            x = y = z = 0.0
            for axis in range(3):
                away = (graph.vertices[found[n], axis] - graph.vertices[i, axis]) / radius
                x += away * frame[0, axis]
                y += away * frame[1, axis]
                z += away * frame[2, axis]
            for m, value in enumerate((1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y, z)):
                rows[n, m] = value
        products = rows[:count].T @ rows[:count]
        for m in range(CUBIC):
            products[m, m] += RIDGE * count
            right[m, 0] = products[m, CUBIC]
        right[1, 1] = right[2, 2] = 1.0
        solved = np.linalg.solve(np.ascontiguousarray(products[:CUBIC, :CUBIC]), right)
        u, v = solved[1, 0], solved[2, 0]
        # The normal of a surface of these slopes over the frame.
        steep = 1.0 + u * u + v * v
        for axis in range(3):
            normals[k, axis] = (frame[2, axis] - u * frame[0, axis] - v * frame[1, axis]) / np.sqrt(steep)
        variance[k] = (solved[1, 1] + solved[2, 2]) / (radius * steep) ** 2
        left = products[CUBIC, CUBIC] - (right[:, 0] * solved[:, 0]).sum()
        rough[k] = max(left, 0.0) * radius * radius / (count - CUBIC)

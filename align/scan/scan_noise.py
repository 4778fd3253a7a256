"""How rough a scan is by its own noise: its size, its reach along the surface, what it does to fits and plain normals.

Noise is everywhere, detail is not: the noise is read where the surface is smoothest. It may be shared by neighbouring
vertices, as scanners that average make it; then fits of growing size leave growing residuals, and averages help less.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags, eye

from align.pose.motion import looking_along
from align.scan.jets import Fits, Graph, fit_normals
from scene.fan_out import fan_out
from scene.mesh import Mesh

Array = NDArray[np.float64]

STEPS = (2.6, 3.7, 5.3, 7.6)
"""Radii of the fits, in spacings of the vertices: each about twice the area of the one before."""
SMOOTHEST = 0.2
"""The share of the vertices, those with the smallest residuals, that show the noise bare."""
SAMPLE = 3000
DRAWS = 2
REACHES = 3
ROUNDING = 1e-7
"""Of the scan's radius: files hold coordinates as float32."""
GROWTH = np.geomspace(3.0, 16.0, 12)
"""From step to step a surface's own residuals squared grow by so much: r^8 = 16 if smooth, less if rough."""
PREFERENCE = 0.7
CHUNK = 1 << 14
_NONE = np.zeros(0)


@dataclass(frozen=True)
class Neighbours:
    """The mesh as a graph."""

    graph: Graph
    """Which vertices share an edge with which."""
    average: csr_matrix
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
        graph = csr_matrix((np.ones(len(start)), (start, end)), (count, count))
        graph = (graph + graph.T).tocsr()
        graph.data[:] = 1
        near = graph + eye(count)
        average = (diags(1 / np.asarray(near.sum(1)).ravel()) @ near).tocsr()
        rows = np.repeat(np.arange(count), np.diff(graph.indptr))
        length = np.linalg.norm(mesh.vertices[rows] - mesh.vertices[graph.indices], axis=1)
        degree = np.bincount(rows, minlength=count)
        spacing = np.bincount(rows, length, count) / np.maximum(degree, 1)
        # A vertex without edges takes the scan's middle length.
        spacing[degree == 0] = np.median(spacing)
        for _ in range(3):
            spacing = average @ spacing
        links = Graph(mesh.vertices, graph.indptr.astype(np.int64), graph.indices.astype(np.int64))
        return cls(links, average, spacing)

    def smooth(self, values: Array, rounds: int) -> Array:
        """Return (V, ...) averaged `rounds` times over each vertex and its neighbours."""
        for _ in range(rounds):
            values = self.average @ values
        return values

    def bend(self, normals: Array) -> Array:
        """Return (V,) the rms by which the neighbours' normals miss a linear law of place about each vertex's."""
        vertices, first, other = self.graph
        degree = np.diff(first)
        own = np.repeat(np.arange(len(degree)), degree)
        x, y = np.einsum("eak,ek->ae", looking_along(normals)[own, :2], vertices[other] - vertices[own])
        turned = (normals[other] - normals[own]).T

        def total(values: Array) -> NDArray:
            return np.bincount(own, values, len(degree))

        a, b, c, square = total(x * x), total(x * y), total(y * y), total((turned**2).sum(0))
        determinant = a * c - b * b
        # Four or more neighbours share two slopes.
        known = (degree >= 4) & (determinant > 1e-6 * a * c)
        for u, v in ((total(x * axis), total(y * axis)) for axis in turned):
            # What the law explains: s M^-1 s for each axis' slopes s.
            explained = c * u * u - 2 * b * u * v + a * v * v
            square -= np.divide(explained, determinant, out=np.zeros_like(a), where=known)
        return np.where(known, np.sqrt(np.maximum(square, 0) / np.maximum(degree - 2, 1)), 0.0)

    def fit(self, start: Array, chosen: NDArray, step: float, heights: Array = _NONE) -> Fits:
        """Fit around the vertices `chosen` (K,) within `step` spacings, on all cores; see `jets.fit_normals`."""
        count = len(chosen)
        fits = Fits(np.zeros((count, 3)), np.zeros(count), np.zeros(count))

        def work(first: int) -> None:
            part = slice(first, first + CHUNK)
            some, own = chosen[part], Fits(*(array[part] for array in fits))
            fit_normals(some, step * self.spacing_mm[some], self.graph, heights, looking_along(start[some]), own)

        fan_out(work, range(0, len(chosen), CHUNK))
        return fits


@dataclass(frozen=True)
class ScanNoise:
    """The scan's noise, across the surface."""

    sigma_mm: float
    """Standard deviation."""
    reach: int
    """How often white noise is averaged over neighbours to make noise like it; 0: white."""
    excess: Array
    """(L,): variance of the normal of the cubic of step L over what white noise would give it."""
    rest: Array
    """(L,): mean squared residual of those fits, for noise of 1 mm."""


def scan_noise(mesh: Mesh, near: Neighbours) -> ScanNoise:
    """Measure the noise of a scan from the residuals of fits of four sizes.

    Noise of known size and reach is put on the same mesh and fitted alike; the scan's noise is the one
    whose residuals grow with the fit's size as the scan's do. Where they grow faster than any noise's, what is left
    over is the surface's shape: then the smallest fit bounds the noise.
    """
    generator = np.random.default_rng(0)
    count = len(mesh.vertices)
    chosen = generator.permutation(count)[:SAMPLE]
    few = chosen[: SAMPLE // 5]
    own = np.array([_quantile(near.fit(mesh.vertex_normals, chosen, step).rough) for step in STEPS])
    left = np.zeros((REACHES, len(STEPS)))
    answer, rest = np.zeros_like(left), np.zeros_like(left)
    for reach in range(REACHES):
        for _ in range(DRAWS):
            noise = near.smooth(generator.standard_normal(count), reach)
            noise /= noise.std()
            for level, step in enumerate(STEPS):
                # Of 1e-4 mm: slopes stay small, and the answer is linear.
                normals, variance, rough = near.fit(mesh.vertex_normals, few, step, 1e-4 * noise)
                variance, rough = 1e-8 * variance, 1e8 * rough
                turned = 1 - np.einsum("kx,kx->k", normals, mesh.vertex_normals[few]) ** 2
                known = np.isfinite(variance)
                if known.any():
                    answer[reach, level] += np.mean((turned / variance)[known]) / DRAWS
                    rest[reach, level] += np.mean(rough[known]) / DRAWS
                left[reach, level] += _quantile(rough) / DRAWS
    floor = (ROUNDING * mesh.radius_mm) ** 2
    if not (left > 0).all():
        # So few vertices that no fit leaves a residual.
        return ScanNoise(float(np.sqrt(floor)), 0, *np.ones((2, len(STEPS))))
    sigma, reach = _unmix(own + floor, left)
    return ScanNoise(
        float(np.sqrt(sigma**2 + floor)), reach, np.maximum(answer[reach], 1e-3), np.maximum(rest[reach], 1e-3)
    )


def _unmix(own: Array, left: Array) -> tuple[float, int]:
    """Return sigma (mm) and reach of the noise in residuals `own` (L,) that noise of 1 mm makes `left` (R, L).

    own = sigma^2 left + shape, where the shape grows from each fit to the next by one factor.
    """
    from scipy.optimize import nnls

    best, answer = np.inf, (0.0, 0)
    for reach, noise in enumerate(left):
        for factor in GROWTH:
            parts = np.stack([noise, own[0] * factor ** np.arange(len(own))], -1)
            (square, _), miss = nnls(parts / own[:, None], np.ones(len(own)))
            # White, unless shared noise explains the residuals clearly better.
            if miss < (best if reach == 0 or answer[1] == reach else PREFERENCE * best):
                best, answer = miss, (float(np.sqrt(square)), reach)
    return answer


def _quantile(rough: Array) -> float:
    known = rough[np.isfinite(rough)]
    return float(np.quantile(known, SMOOTHEST)) if len(known) else 0.0

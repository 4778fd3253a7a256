"""Normals of a noisy scan: at each vertex from a neighbourhood just large enough, with a sigma.

Small neighbourhoods leave noise, large ones blur. At every vertex, surfaces of two degrees are fitted in neighbourhoods
of growing size [Cazals2005]; what a fit leaves of residuals beyond the scan's noise is shape that it does not follow,
and tells by how much its normal may be off. The fit with the smallest sum of variance and squared bias is taken. A scan
without noise keeps its smallest fits; creases are never crossed.
"""

import numpy as np
from numpy.typing import NDArray

from align.scan.creases import cross_creases
from align.scan.scan_noise import STEPS, Neighbours, ScanNoise, plain_normal_gain, scan_noise
from scene.mesh import Mesh

Array = NDArray[np.float64]

BIASED = 8.0
"""A fit's squared bias is so many times the mean square of its residuals beyond the noise's, over its radius squared.

A quadratic that misses a cubic is off by 16 where that is x^3, by none where it is x^3 - 3 x y^2.
"""
JUDGE = 3
"""The fit that judges the mean of the faces around, which has no residuals: the second cubic."""
ROUNDS = 3
"""What shape fits leave is averaged over so many rings."""
BETWEEN = 0.4
"""How far normals between the vertices may be from interpolated ones, of what a ring's normals miss a linear law by.

A quarter for a quadratic law; more for a crease, which lies anywhere between.
"""
UNEVEN = 0.25
"""The faces' mean is off by this share of the bend within its ring, since the faces around are uneven."""
SUSPECT_DEG = 4.0
"""Where normals are less sure than this, or bend so much within a ring, a crease is looked for."""
LOUD = 5.0
"""A fit whose neighbours lie so badly that noise turns it by this times the usual variance is none."""
EXPLAINED = 0.1


def smooth_normals(mesh: Mesh) -> tuple[Array, Array]:
    """Return the scan's normals at its vertices, freed from its noise, and how sure they are.

    Returns
    -------
    normals : (V, 3) float64
        Unit, the mesh's own frame.
    sigma_deg : (V,) float64
        Expected (rms) angle between the normals, interpolated over the faces around, and the surface's real
        ones: noise left over, bias of the fit, and what bends between the vertices.
    """
    near = Neighbours.of(mesh)
    noise = scan_noise(mesh, near)
    everywhere = np.ones(len(mesh.vertices), bool)
    normals, sigma, misfit = _adapt(mesh, near, noise, mesh.vertex_normals, everywhere)
    bend = near.bend(normals)
    unsure = np.hypot(sigma, bend) > np.radians(SUSPECT_DEG)
    cut, side = cross_creases(mesh, near, near.smooth(unsure.astype(float), 1) > 0)
    if cut.any():
        at_crease = np.zeros(len(mesh.vertices))
        at_crease[mesh.faces.ravel()[cut]] = at_crease[np.roll(mesh.faces, -1, axis=1).ravel()[cut]] = 1
        reached = near.smooth(at_crease, int(np.ceil(STEPS[-1])) + ROUNDS) > 0
        apart = Neighbours.of(mesh, keep=~cut)
        again, doubt, left = _adapt(mesh, apart, noise, side, reached)
        # A crease explains nearly all that smooth fits did not follow; fine detail, cut up, stays fine detail.
        explained = reached & (left < EXPLAINED * misfit)
        normals[explained], sigma[explained] = again[explained], doubt[explained]
    # Where faces are large for the noise, no fit over far neighbours is as good as the faces themselves.
    plain = np.hypot(noise.sigma_mm * plain_normal_gain(mesh), UNEVEN * near.bend(mesh.vertex_normals))
    better = plain < sigma
    normals[better], sigma[better] = mesh.vertex_normals[better], plain[better]
    return normals, np.degrees(np.hypot(sigma, BETWEEN * near.bend(normals)))


def _adapt(
    mesh: Mesh, near: Neighbours, noise: ScanNoise, start: Array, where: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Return normals (V, 3) and sigma (V,), radians, of the best fits `where` asked, and the judge's bias (V,).

    Of each step the quadratic and the cubic, and last the mean of the faces around the vertex.
    """
    count, rungs, square = len(mesh.vertices), 2 * len(STEPS) + 1, noise.sigma_mm**2
    normals = np.repeat(start.astype(np.float32)[:, None], rungs, axis=1)
    variance, bias = np.full((count, rungs), np.inf), np.zeros((count, rungs))

    def averaged(values: Array, at: NDArray[np.intp]) -> Array:
        sums = np.zeros((count, 2))
        sums[at, 0], sums[at, 1] = values, 1
        sums = near.smooth(sums, ROUNDS)
        return np.maximum(sums[:, 0] / np.maximum(sums[:, 1], 1e-12), 0)

    asked = np.flatnonzero(where)
    for level, step in enumerate(STEPS):
        fitted, unit, rough = near.fit(start, asked, step)
        unit *= noise.excess[level]
        for degree in range(2):
            rung, known = 2 * level + degree, np.isfinite(unit[:, degree])
            if not known.any():
                continue
            # A neighbourhood in a bad order says little, and says it loudly.
            known &= unit[:, degree] < LOUD * np.median(unit[known, degree])
            at, left = asked[known], rough[known, degree] - noise.rest[level, degree] * square
            normals[asked, rung] = fitted[:, degree]
            variance[at, rung] = unit[known, degree] * square
            bias[:, rung] = averaged(BIASED * left / (step * near.spacing_mm[at]) ** 2, at)
            # What a small fit does not follow, a larger one follows even less, however fine it looks from afar.
            if level:
                bias[:, rung] = np.maximum(bias[:, rung], bias[:, rung - 2])
    # Six faces around a vertex turn by 0.8 sigma / edge; irregular ones by a little more.
    variance[asked, -1] = np.minimum(noise.excess[0, 0], 1.0) * square / near.spacing_mm[asked] ** 2
    at = np.flatnonzero(np.isfinite(variance[:, JUDGE]))
    expected = np.maximum(variance[at, -1] - variance[at, JUDGE], 0) + bias[at, JUDGE]
    bias[:, -1] = averaged(((normals[at, JUDGE] - normals[at, -1]) ** 2).sum(1) - expected, at)

    # Averaged over the vertices that have the fit: those that need no wide one do not speak of it.
    fit = np.isfinite(variance)
    risk = near.smooth(np.where(fit, variance + bias, 0.0), 2) / np.maximum(near.smooth(1.0 * fit, 2), 1e-12)
    best = np.arange(count), np.where(fit, risk, np.inf).argmin(1)
    own = np.where(where, variance[best] + bias[best], 0.0)
    total, known = near.smooth(np.stack([own, 1.0 * where], -1), 1).T
    return normals[best].astype(np.float64), np.sqrt(total / np.maximum(known, 1e-12)), bias[:, JUDGE]

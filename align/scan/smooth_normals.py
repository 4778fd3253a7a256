"""Normals of a noisy scan: at each vertex from a neighbourhood just large enough, with a sigma.

Small neighbourhoods leave noise, large ones blur. At every vertex, normals are fitted in neighbourhoods of growing
size [Cazals2005]. What a wider fit differs by from the one that was taken so far, beyond what their noise explains, is
bias; it is taken where variance and bias together become smaller [Goldenshluger2011]. A scan without noise keeps its
smallest fits; creases are never crossed.
"""

import numpy as np
from numpy.typing import NDArray

from align.scan.creases import cross_creases
from align.scan.scan_noise import STEPS, Neighbours, ScanNoise, scan_noise
from scene.mesh import Mesh

Array = NDArray[np.float64]

JUDGE, *WIDER = range(4)
"""Steps of the fits: the smallest's residuals tell the shape that fits do not follow."""
MARGIN = 1.3
"""Differences count as bias beyond this times their noise: a mean over few neighbours fluctuates by half."""
ROUNDS = 6
"""Differences are averaged over this many rings: about 30 independent neighbours."""
CHOSEN = 1.3
"""The chosen fit is the one whose bias looks smallest: the real one is larger by about this."""
BETWEEN = 0.4
"""How far normals between the vertices may be from interpolated ones, of what a ring's normals miss a linear law by.

A quarter for a quadratic law; more for a crease, which lies anywhere between.
"""
UNEVEN = 0.35
"""The faces' mean is off by this share of the bend within its ring, since the faces around are uneven."""
SHAPE = 10.0
"""Shape that a fit does not follow turns its normal by more than noise of the same size, in variance."""
SUSPECT_DEG = 4.0
"""Where normals are less sure than this, or bend so much within a ring, a crease is looked for."""
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
    # Noise hardly turns large faces: a decimated scan has large ones where it is flat.
    shaken = (noise.sigma_mm / near.spacing_mm) ** 2
    everywhere = np.ones(len(mesh.vertices), bool)
    normals, sigma, misfit = _adapt(near, noise, mesh.vertex_normals, shaken, everywhere)
    bend = near.bend(normals)
    unsure = np.hypot(sigma, bend) > np.radians(SUSPECT_DEG)
    cut, side = cross_creases(mesh, near, near.smooth(unsure.astype(float), 1) > 0)
    if cut.any():
        at_crease = np.zeros(len(mesh.vertices))
        at_crease[mesh.faces.ravel()[cut]] = at_crease[np.roll(mesh.faces, -1, axis=1).ravel()[cut]] = 1
        reached = near.smooth(at_crease, int(np.ceil(STEPS[-1])) + ROUNDS) > 0
        apart = Neighbours.of(mesh, keep=~cut)
        again, doubt, left = _adapt(apart, noise, side, shaken, reached)
        # A crease explains nearly all that smooth fits did not follow; fine detail, cut up, stays fine detail.
        explained = reached & (left < EXPLAINED * misfit)
        normals[explained], sigma[explained] = again[explained], doubt[explained]
    # Where faces are large for the noise, no fit over far neighbours is as good as the faces themselves.
    plain = np.sqrt(shaken + (UNEVEN * near.bend(mesh.vertex_normals)) ** 2)
    better = plain < sigma
    normals[better], sigma[better] = mesh.vertex_normals[better], plain[better]
    return normals, np.degrees(np.hypot(sigma, BETWEEN * near.bend(normals)))


def _adapt(
    near: Neighbours, noise: ScanNoise, start: Array, shaken: Array, where: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Return normals (V, 3) and sigma (V,), radians, of the best fits `where` asked, and what fits left (V,).

    `start` (V, 3) are the mesh's own normals, `shaken` (V,) their variance.
    """
    normals, variance, bias, count = start.copy(), shaken.copy(), (UNEVEN * near.bend(start)) ** 2, len(start)
    active = where.copy()

    def fit(level: int) -> tuple[NDArray, Array, Array, Array]:
        """Return which vertices (K,) could be fitted, their normals (K, 3), variance (K,) and what is left (K,)."""
        chosen = np.flatnonzero(active)
        fitted, unit, rough = near.fit(start, chosen, STEPS[level])
        unit = unit * noise.excess[level]
        known = np.isfinite(unit)
        beyond = rough[known] / noise.rest[level] - noise.sigma_mm**2
        return chosen[known], fitted[known], unit[known] * noise.sigma_mm**2, unit[known] * beyond

    def around(chosen: NDArray, *values: Array) -> Array:
        sums = np.zeros((count, len(values) + 1))
        sums[chosen] = np.stack([*values, np.ones(len(chosen))], -1)
        sums = near.smooth(sums, ROUNDS)
        return (sums[:, :-1] / np.maximum(sums[:, -1:], 1e-12)).T

    chosen, fitted, own, left = fit(JUDGE)
    # What the fit leaves beyond noise is shape that it does not follow, and as bad as noise.
    shape, doubt, every = SHAPE * np.maximum(around(chosen, left)[0], 0), np.zeros(count), np.flatnonzero(where)
    normals[chosen], variance[chosen] = fitted, own
    bias[chosen] = doubt[chosen] = shape[chosen]
    for level in (None, *WIDER):
        chosen, fitted, own = (every, start[every], shaken[every]) if level is None else fit(level)[:3]
        before = variance[chosen] + bias[chosen]
        noisy = np.abs(variance[chosen] - own) + doubt[chosen]
        apart, noisy = around(chosen, ((fitted - normals[chosen]) ** 2).sum(1), noisy)[:, chosen]
        wrong, agreeing = np.maximum(apart - MARGIN * noisy, 0), np.zeros(count)
        better = own + wrong < before
        taken = chosen[better]
        normals[taken], variance[taken], doubt[taken] = fitted[better], own[better], 0
        bias[taken] = np.maximum(apart - noisy, 0)[better]
        agreeing[chosen[wrong < before]] = 1
        # Where one is plainly biased, no wider one is tried.
        active &= near.smooth(agreeing, 2) > 0
    weighted = np.stack([np.where(where, variance + CHOSEN * bias, 0.0), 1.0 * where], -1)
    square = near.smooth(np.asarray(weighted, np.float64), 1)
    return normals, np.sqrt(square[:, 0] / np.maximum(square[:, 1], 1e-12)), shape

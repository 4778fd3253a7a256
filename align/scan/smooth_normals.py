"""Normals of a noisy scan: at each vertex from a neighbourhood just large enough, with a sigma.

Small neighbourhoods leave noise, large ones blur. At every vertex, normals are fitted in neighbourhoods of growing size
[Cazals2005]; each fit is compared with the smaller ones: what it differs by, beyond what their noise explains, is its
bias. The fit with the smallest sum of variance and bias is taken [Goldenshluger2011]. How noisy the scan is is read off
the same differences where the surface is smoothest: noise is everywhere, detail is not. A scan without noise keeps its
smallest fits; creases are never crossed.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from align.scan.creases import cross_creases
from align.scan.jets import Fits, Neighbours
from scene.mesh import Mesh

Array = NDArray[np.float64]

STEPS = (2.6, 3.7, 5.3, 7.6)
"""Radii of the fits, in spacings of the vertices: each about twice the area of the one before."""
FACES = 0.9
"""Noise of the mean of the faces around a vertex: the rms turn for noise of one spacing. Six even faces have 0.8."""
SMOOTHEST, LUCKY = 0.1, 0.64
"""The share of the vertices, those with the smallest differences, that show the noise bare; by what factor they do so
by chance where all is noise."""
NOISE = (1.0, 1.0, 1.0, 1.0), (1.0, 4.4, 10.5, 20.0)
"""How noise of each vertex's own, and noise that neighbours share, as scanners that average make it (twice over the
ring), make the fits' differences grow with their size, against noise of the first kind."""
SHAPES = (1.0, 10.0, 100.0), (1.0, 32.0, 1024.0)
"""The same of a surface's own shape: rough, and smooth."""
UNLIKE = 0.3
"""How far, relative, differences may be from what noise and shape make of them."""
ROUNDING = 1e-7
"""Of the scan's radius: files hold coordinates as float32."""
MARGIN = 1.25
"""Differences count as bias beyond this times their noise: a mean over few neighbours fluctuates by half."""
ROUNDS = 6
"""Differences are averaged over this many rings: about 30 independent neighbours."""
SHAPE = 3.0
"""Shape that a fit does not follow turns its normal by more than noise of the same size, in variance."""
CHOSEN = 1.2
"""The chosen fit is the one whose bias looks smallest: the real one is larger by about this."""
BETWEEN = 0.4
"""How far normals between the vertices may be from interpolated ones, of what a vertex's differs from its ring's."""
UNEVEN = 0.3
"""The faces' mean is off by at most this share of the bend within its ring, since the faces around are uneven."""
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
    near, everywhere = Neighbours.of(mesh), np.arange(len(mesh.vertices))
    fits = [near.fit(mesh.vertex_normals, everywhere, step) for step in STEPS]
    noise = scan_noise(mesh, near, fits)
    normals, sigma, misfit = _adapted(mesh.vertex_normals, near, noise, fits)
    unsure = np.hypot(sigma, _bend(near, normals)) > np.radians(SUSPECT_DEG)
    cut, side = cross_creases(mesh, near, near.smooth(unsure * 1.0, 1) > 0)
    if cut.any():
        at_crease = np.zeros(len(mesh.vertices))
        at_crease[mesh.faces.ravel()[cut]] = at_crease[np.roll(mesh.faces, -1, axis=1).ravel()[cut]] = 1
        reached = near.smooth(at_crease, int(np.ceil(STEPS[-1])) + ROUNDS) > 0
        chosen, apart = np.flatnonzero(reached), Neighbours.of(mesh, keep=~cut)
        for one, step in zip(fits, STEPS, strict=True):
            for array, again in zip(one, apart.fit(side, chosen, step), strict=True):
                array[chosen] = again
        again, doubt, left = _adapted(side, apart, noise, fits)
        # A crease explains nearly all that smooth fits did not follow; fine detail, cut up, stays fine detail.
        explained = reached & (left < EXPLAINED * misfit)
        normals[explained], sigma[explained] = again[explained], doubt[explained]
    return normals, np.degrees(np.hypot(sigma, BETWEEN * _bend(near, normals)))


def scan_noise(mesh: Mesh, near: Neighbours, fits: list[Fits]) -> Array:
    """Return the scan's noise, mm, as the fits of each size feel it (L,): all alike unless neighbours share it.

    What two fits differ by, over what noise of 1 mm would make of them, is noise and shape, in such parts that they
    grow with the fits' size as they are seen to.
    """
    from scipy.optimize import nnls

    seen = np.full(len(fits) - 1, (ROUNDING * mesh.radius_mm) ** 2)
    for k, (small, large) in enumerate(pairwise(fits)):
        known = np.isfinite(small.variance)
        apart = ((small.normals - large.normals) ** 2).sum(1)
        told = np.maximum(np.where(known, small.variance, 0.0) - np.where(known, large.variance, 0.0), 0)
        apart, told = near.smooth(np.stack([known * apart, told], -1), ROUNDS)[told > 0].T
        if len(told):
            seen[k] += np.quantile(apart / told, SMOOTHEST) / LUCKY
    answer, least = seen.min(keepdims=True), UNLIKE
    for kind in np.array(NOISE):
        parts = np.stack([kind[:-1], *SHAPES], 1) / seen[:, None]
        amounts, miss = nnls(parts, np.ones(len(seen)))
        # Each vertex's own, unless that explains hardly anything.
        if miss < least:
            answer, least = amounts[0] * kind, 0.0
    return np.sqrt(np.maximum(answer, 1e-4 * seen.min()) * np.ones(len(fits)))


def _adapted(plain: Array, near: Neighbours, noise: Array, fits: list[Fits]) -> tuple[Array, Array, Array]:
    """Return the best normals (V, 3), their sigma (V,), radians, and the bias of the smallest fit (V,)."""
    normals = np.stack([plain, *(one.normals for one in fits)], 1)
    gain = np.stack([(FACES / near.spacing_mm) ** 2, *(one.variance for one in fits)], 1)
    known = np.isfinite(gain)
    # What each fit is surer by than the smaller one, by the noise that they differ by.
    more = np.maximum(np.diff(np.where(known, gain, 0.0)[:, ::-1], axis=1, prepend=0.0), 0)[:, ::-1]
    variance = np.cumsum((more * noise[[0, *range(len(fits))]] ** 2)[:, ::-1], axis=1)[:, ::-1]

    def differ(k: int, j: int, beyond: float) -> Array:
        """Return (V,), what fits k and j differ by, squared, more than what the noise of j explains."""
        both = known[:, k] & known[:, j]
        apart = ((normals[:, k] - normals[:, j]) ** 2).sum(1)
        expected = np.abs(np.where(both, variance[:, j], 0.0) - np.where(both, variance[:, k], 0.0))
        apart, expected, weight = near.smooth(np.stack([both * apart, expected, both], -1).astype(np.float64), ROUNDS).T
        return np.maximum(apart - beyond * expected, 0) / np.maximum(weight, 1e-12)

    # What the smallest fit leaves beyond noise is shape that it does not follow, and as bad as noise.
    left = np.where(known[:, 1], fits[0].variance * (fits[0].rough - noise[0] ** 2), 0.0)
    sums = near.smooth(np.stack([left, known[:, 1]], -1).astype(np.float64), ROUNDS)
    bias = np.zeros_like(variance)
    bias[:, 1] = SHAPE * np.maximum(sums[:, 0] / np.maximum(sums[:, 1], 1e-12), 0)
    bias[:, 0] = np.maximum(differ(1, 0, 1.0) - bias[:, 1], 0)
    seen = bias.copy()
    # The smallest fit may be no judge of the faces: it is worse, then, and they are as even as they look.
    bent = near.smooth((UNEVEN * _bend(near, plain)) ** 2, ROUNDS)
    bias[:, 0] = np.minimum(bias[:, 0], bent)
    for k in range(2, bias.shape[1]):
        bias[:, k] = np.maximum(bias[:, k - 1], differ(k, k - 1, MARGIN))
        seen[:, k] = differ(k, k - 1, 1.0)
    # Averaged over the vertices that have the fit: those that need no wide one do not speak of it.
    risk = near.smooth(np.where(known, variance + bias, 0.0), 2) / np.maximum(near.smooth(known * 1.0, 2), 1e-12)
    pick = np.where(known, risk, np.inf).argmin(1)
    here = np.arange(len(pick)), pick
    square = near.smooth(variance[here] + CHOSEN * seen[here], 1)
    return normals[here], np.sqrt(square), bias[:, 1]


def _bend(near: Neighbours, normals: Array) -> Array:
    """Return (V,) by how much each vertex's normal differs from the mean of its ring's."""
    return np.linalg.norm(normals - near.smooth(normals, 1), axis=1)

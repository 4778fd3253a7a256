"""Normals of a noisy scan: at each vertex from a neighbourhood just large enough, with a sigma.

Small neighbourhoods leave noise, large ones blur. At every vertex, normals are fitted in neighbourhoods of growing
size and of two degrees [Cazals2005]; each fit is compared with all noisier ones: what it differs by, beyond what
their noise explains, is its bias. The fit with the smallest sum of variance and bias is taken [Goldenshluger2011].
A scan without noise keeps its smallest fits; creases are never crossed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.scan.creases import cross_creases
from align.scan.scan_noise import STEPS, Neighbours, ScanNoise, plain_normal_gain, scan_noise
from scene.mesh import Mesh

Array = NDArray[np.float64]

LADDER = ((0, 0), (1, 1), (1, 0), (2, 1), (2, 0), (3, 1), (3, 0), (4, 1))
"""(step, degree) of the fits: the smallest cubic and the widest quadratic say nothing that the others do not.

One more stands behind them: the mean of the faces around the vertex, as the mesh has it.
"""
FACES, JUDGE = -1, 1
"""The faces' mean, and the cubic that judges it: the two whose neighbourhoods are too small for the wider to judge."""
CLOSE, FAR = 1.3, 10.0
"""Fits are compared when their variances differ by a factor between these: less says nothing, more is all noise."""
MARGIN = 1.6
"""Differences count as bias beyond this times their noise: a mean over few neighbours fluctuates by half."""
ROUNDS = 6
"""Differences are averaged over this many rings: about 30 independent neighbours."""
CHOSEN = 1.2
"""The chosen fit is the one whose bias looks smallest: the real one is larger by about this."""
BETWEEN = 0.4
"""How far normals between the vertices may be from interpolated ones, of what a ring's normals miss a linear law by.

A quarter for a quadratic law; more for a crease, which lies anywhere between.
"""
UNEVEN = 0.25
"""The faces' mean is off by this share of the bend within its ring, since the faces around are uneven."""
SHAPE = 3.0
"""Shape that a fit does not follow turns its normal by more than noise of the same size, in variance."""
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


@dataclass
class _Fits:
    """All fits of the ladder, and the faces' mean."""

    normals: NDArray[np.float32]
    """(V, K, 3)."""
    variance: Array
    """(V, K): radians squared, by the scan's noise; infinite where not fitted."""
    doubt: Array
    """(V, K): what more the two smallest are off by: the surface's shape, as far as they do not resolve it."""


def _adapt(
    mesh: Mesh, near: Neighbours, noise: ScanNoise, start: Array, where: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Return normals (V, 3) and sigma (V,), radians, of the best fits `where` asked, and what fits left (V,)."""
    fits = _fit_ladder(mesh, near, noise, start, where)
    variance, doubt = fits.variance, fits.doubt
    typical = np.array([np.median(v[np.isfinite(v)]) if np.isfinite(v).any() else 0.0 for v in variance.T])
    last = len(typical) - 1
    bias, signed = doubt.copy(), np.full_like(variance, -np.inf)
    raw: dict[tuple[int, int], Array] = {}
    mean = _compare(near, fits, JUDGE, last)[2]
    doubt[:, last] = bias[:, last] = np.maximum(mean[:, 0] - mean[:, 1], 0)
    signed[:, [JUDGE, last]] = doubt[:, [JUDGE, last]]
    order = np.argsort(-typical)
    for place, k in enumerate(order):
        if k in (JUDGE, last):
            continue
        for j in order[:place]:
            if not CLOSE * typical[k] < typical[j] <= FAR * typical[k]:
                continue
            apart, expected, mean = _compare(near, fits, k, j)
            bias[:, k] = np.maximum.reduce([bias[:, k], mean[:, 0] - MARGIN * mean[:, 1], bias[:, j] - doubt[:, j]])
            signed[:, k] = np.maximum(signed[:, k], mean[:, 0] - mean[:, 1])
            raw[k, j] = apart - expected
    # Averaged over the vertices that have the fit: those that need no wide one do not speak of it.
    fitted = np.isfinite(variance)
    risk = near.smooth(np.where(fitted, variance + bias, 0.0), 2) / np.maximum(near.smooth(fitted * 1.0, 2), 1e-12)
    pick = np.where(fitted, risk, np.inf).argmin(1)
    return *_judge(near, fits, typical, signed, raw, pick, where), doubt[:, JUDGE]


def _compare(near: Neighbours, fits: _Fits, k: int, j: int) -> tuple[Array, Array, Array]:
    """Return (V,) squared distances of fits k and j, what noise explains of them, and both (V, 2) averaged.

    NaN in the first two where either is not fitted.
    """
    known = np.isfinite(fits.variance[:, k]) & np.isfinite(fits.variance[:, j])
    apart = ((fits.normals[:, k] - fits.normals[:, j]) ** 2).sum(1)
    expected = np.zeros(len(known))
    expected[known] = np.maximum(fits.variance[known, j] - fits.variance[known, k], 0)
    # The two smallest judge each other: then it is the cubic's doubt that counts, else that of the noisier fit.
    expected += fits.doubt[:, k if k == JUDGE else j]
    both = near.smooth(np.stack([apart, expected, np.ones(len(known))], 1) * known[:, None], ROUNDS)
    unknown = np.where(known, 0.0, np.nan)
    return apart + unknown, expected + unknown, both[:, :2] / np.maximum(both[:, 2:], 1e-12)


def _judge(near: Neighbours, fits: _Fits, typical: Array, signed: Array, raw: dict, pick: NDArray, where: NDArray):
    """Return the chosen normals and their sigma: variance, and the bias of the region and of all alike choices."""
    everyone = np.arange(len(pick))
    pooled = np.zeros(len(typical))
    for k in range(len(typical)):
        here = where & (pick == k)
        if not here.any():
            continue
        means = [
            np.nanmean(value[here]) for pair, value in raw.items() if pair[0] == k and np.isfinite(value[here]).any()
        ]
        pooled[k] = max([0.0, *means])
    region = signed[everyone, pick]
    bias = np.maximum((np.where(np.isfinite(region), region, pooled[pick]) + pooled[pick]) / 2, 0)
    variance = fits.variance[everyone, pick]
    square = np.stack([np.where(where, variance + CHOSEN * bias, 0.0), where], -1)
    square = near.smooth(square, 1)
    return fits.normals[everyone, pick].astype(np.float64), np.sqrt(square[:, 0] / np.maximum(square[:, 1], 1e-12))


def _fit_ladder(mesh: Mesh, near: Neighbours, noise: ScanNoise, start: Array, where: NDArray[np.bool_]) -> _Fits:
    """Fit all steps of the ladder; where one is plainly biased, no wider one is tried."""
    count = len(mesh.vertices)
    normals = np.zeros((count, len(LADDER) + 1, 3), np.float32)
    variance = np.full((count, len(LADDER) + 1), np.inf)
    doubt = np.zeros_like(variance)
    normals[:] = start[:, None]
    active = where.copy()
    for level, step in enumerate(STEPS):
        chosen = np.flatnonzero(active)
        fitted, unit, rough = near.fit(start, chosen, step)
        unit *= noise.excess[level]
        for degree in range(2):
            known = np.isfinite(unit[:, degree])
            if (level, degree) not in LADDER or not known.any():
                continue
            rung = LADDER.index((level, degree))
            # A neighbourhood in a bad order says little, and says it loudly.
            known &= unit[:, degree] < LOUD * np.median(unit[known, degree])
            normals[chosen, rung] = fitted[:, degree]
            variance[chosen[known], rung] = unit[known, degree] * noise.sigma_mm**2
            if rung == JUDGE:
                # What the fit leaves beyond noise is shape that it does not follow, and as bad as noise.
                left = unit[known, 1] * (rough[known, 1] / noise.rest[level, 1] - noise.sigma_mm**2)
                sums = np.zeros((count, 2))
                sums[chosen[known]] = np.stack([left, np.ones(len(left))], -1)
                sums = near.smooth(sums, ROUNDS)
                doubt[:, rung] = SHAPE * np.maximum(sums[:, 0] / np.maximum(sums[:, 1], 1e-12), 0)
        if level < 2:
            continue
        cubic, before = LADDER.index((level, 1)), LADDER.index((level - 1, 1))
        both = np.isfinite(variance[:, cubic]) & np.isfinite(variance[:, before])
        apart = ((normals[:, cubic] - normals[:, before]) ** 2).sum(1)
        noisy = np.where(both, variance[:, before] + doubt[:, before], 0.0)
        apart, noisy = near.smooth(np.stack([np.where(both, apart, 0), noisy], 1), 3).T
        active &= apart <= 4 * noisy
    # Six faces around a vertex turn by 0.8 sigma / edge; irregular ones by a little more.
    variance[where, FACES] = np.minimum(noise.excess[0, 0], 1.0) * (noise.sigma_mm / near.spacing_mm[where]) ** 2
    return _Fits(normals, variance, doubt)

"""Normals of a noisy scan: at each vertex from a neighbourhood just large enough, with a sigma.

Small neighbourhoods leave noise, large ones blur. At every vertex, normals are fitted in neighbourhoods of growing
size and of two degrees [Cazals2005]; each fit is compared with all noisier ones: what it differs by, beyond what
their noise explains, is its bias. The fit with the smallest sum of variance and bias is taken [Goldenshluger2011].
A scan without noise keeps its smallest fits; creases are never crossed.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.creases import cross_creases
from align.jets import fit_normals, ring_bend
from align.scan_noise import STEPS, Neighbours, ScanNoise, scan_noise
from scene.mesh import Mesh

Array = NDArray[np.float64]

LADDER = tuple((level, degree) for level in range(len(STEPS)) for degree in (1, 0))[:-1]
"""(step, degree) of the fits; the widest quadratics gain less noise than their bias costs in certainty."""
CLOSE, FAR = 1.3, 10.0
"""Fits are compared when their variances differ by a factor between these: less says nothing, more is all noise."""
MARGIN = 1.6
"""Differences count as bias beyond this times their noise: a mean over few neighbours fluctuates by half."""
ROUNDS = 6
"""Differences are averaged over this many rings: about 30 independent neighbours."""
UNSEEN = 0.3
"""Bias that no comparison can see, of the variance."""
CHOSEN = 2.0
"""The chosen fit is the one whose bias looks smallest: the real one is larger by about this."""
BETWEEN = 0.4
"""How far normals between the vertices may be from interpolated ones, of what a ring's normals miss a linear law by.

A quarter for a quadratic law; more for a crease, which lies anywhere between.
"""
SUSPECT_DEG = 4.0
"""Where normals are less sure than this, a crease is looked for."""
CHUNK = 1 << 14


def smooth_normals(mesh: Mesh) -> tuple[Array, Array]:
    """Return the scan's normals at its vertices, freed from its noise, and how sure they are.

    Parameters
    ----------
    mesh : Mesh

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
    normals, sigma = _adapt(mesh, near, noise, mesh.vertex_normals, everywhere)
    cut, side = cross_creases(mesh, near, near.smooth((sigma > np.radians(SUSPECT_DEG)).astype(float), 1) > 0)
    if cut.any():
        at_crease = np.zeros(len(mesh.vertices))
        at_crease[mesh.faces.ravel()[cut]] = at_crease[np.roll(mesh.faces, -1, axis=1).ravel()[cut]] = 1
        reached = near.smooth(at_crease, int(np.ceil(STEPS[-1])) + ROUNDS) > 0
        apart = Neighbours.of(mesh, keep=~cut)
        again, doubt = _adapt(mesh, apart, noise, side, reached)
        normals[reached], sigma[reached] = again[reached], doubt[reached]
    bend = np.zeros(len(normals))
    ring_bend(mesh.vertices, normals, near.indptr, near.indices, bend)
    return normals, np.degrees(np.hypot(sigma, BETWEEN * bend))


@dataclass
class _Fits:
    """All fits of the ladder: normals (V, K, 3); variance (V, K), infinite where not fitted; lack (V,) of fit."""

    normals: NDArray[np.float32]
    variance: Array
    lack: Array


def _adapt(
    mesh: Mesh, near: Neighbours, noise: ScanNoise, start: Array, where: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Return normals (V, 3) and sigma (V,), radians, of the best fits at the vertices `where`."""
    fits = _fit_ladder(mesh, near, noise, start, where)
    variance = fits.variance
    typical = np.array([np.median(v[np.isfinite(v)]) if np.isfinite(v).any() else 0.0 for v in variance.T])
    order = np.argsort(-typical)
    bias, signed = np.zeros_like(variance), np.full_like(variance, -np.inf)
    raw: dict[tuple[int, int], Array] = {}
    for place, k in enumerate(order):
        for j in order[:place]:
            if not CLOSE * typical[k] < typical[j] <= FAR * typical[k]:
                continue
            known = np.isfinite(variance[:, k]) & np.isfinite(variance[:, j])
            apart = ((fits.normals[:, k] - fits.normals[:, j]) ** 2).sum(1)
            expected = np.zeros(len(known))
            expected[known] = np.maximum(variance[known, j] - variance[known, k], 0)
            both = near.smooth(np.stack([apart, expected, np.ones(len(known))], 1) * known[:, None], ROUNDS)
            both[:, :2] /= np.maximum(both[:, 2:], 1e-12)
            bias[:, k] = np.maximum.reduce([bias[:, k], both[:, 0] - MARGIN * both[:, 1], bias[:, j]])
            signed[:, k] = np.maximum(signed[:, k], both[:, 0] - both[:, 1])
            raw[k, j] = np.where(known, apart - expected, np.nan)
    # Averaged over the vertices that have the fit: those that need no wide one do not speak of it.
    fitted = np.isfinite(variance)
    risk = near.smooth(np.where(fitted, variance + bias, 0.0), 2) / np.maximum(near.smooth(fitted * 1.0, 2), 1e-12)
    pick = np.where(fitted, risk, np.inf).argmin(1)
    return _judge(near, fits, typical, signed, raw, pick, where)


def _judge(near: Neighbours, fits: _Fits, typical: Array, signed: Array, raw: dict, pick: NDArray, where: NDArray):
    """Return the chosen normals and their sigma: variance, and the bias of the region and of all alike choices."""
    everyone = np.arange(len(pick))
    pooled = np.zeros(len(typical))
    lack = near.smooth(fits.lack, ROUNDS)
    finest = typical.argmax()
    for k in range(len(typical)):
        here = where & (pick == k)
        if not here.any():
            continue
        means = [
            np.nanmean(value[here]) for pair, value in raw.items() if pair[0] == k and np.isfinite(value[here]).any()
        ]
        pooled[k] = max([0.0, *means])
        if typical[finest] <= FAR * typical[k]:
            pooled[k] += max(float(fits.lack[here].mean()), 0.0)
            signed[:, k] = np.maximum(signed[:, k], 0) + lack
    region = signed[everyone, pick]
    bias = np.maximum((np.where(np.isfinite(region), region, pooled[pick]) + pooled[pick]) / 2, 0)
    variance = fits.variance[everyone, pick]
    square = (1 + UNSEEN) * variance + CHOSEN * bias
    return fits.normals[everyone, pick].astype(np.float64), np.sqrt(near.smooth(square, 1))


def _fit_ladder(mesh: Mesh, near: Neighbours, noise: ScanNoise, start: Array, where: NDArray[np.bool_]) -> _Fits:
    """Fit all steps of the ladder; where one is plainly biased, no wider one is tried."""
    count = len(mesh.vertices)
    normals = np.zeros((count, len(LADDER), 3), np.float32)
    variance = np.full((count, len(LADDER)), np.inf)
    lack = np.zeros(count)
    normals[:] = start[:, None]
    active = where.copy()
    for level, step in enumerate(STEPS):
        chosen = np.flatnonzero(active)
        fitted, unit_variance, rough = _fit_all(mesh, near, start, chosen, step)
        for degree in range(2):
            if (level, degree) in LADDER:
                rung = LADDER.index((level, degree))
                normals[chosen, rung] = fitted[:, degree]
                variance[chosen, rung] = unit_variance[:, degree] * noise.excess[level, degree] * noise.sigma_mm**2
        cubic = LADDER.index((level, 1))
        if level == 0:
            known = np.isfinite(unit_variance[:, 1])
            gain = np.minimum(unit_variance[known, 1], 10.0) * noise.excess[0, 1]
            lack[chosen[known]] = gain * (rough[known, 1] / max(noise.rest, 1e-12) - noise.sigma_mm**2)
            continue
        before = LADDER.index((level - 1, 1))
        both = np.isfinite(variance[:, cubic]) & np.isfinite(variance[:, before])
        apart = ((normals[:, cubic] - normals[:, before]) ** 2).sum(1)
        noisy = np.where(both, variance[:, before], 0.0)
        apart, noisy = near.smooth(np.stack([np.where(both, apart, 0), noisy], 1), 3).T
        active &= apart <= 4 * noisy
    # Too few neighbours for any fit: the faces' own normals, as sure as one ring makes them.
    alone = ~np.isfinite(variance).any(1)
    variance[alone, 0] = (noise.sigma_mm / near.spacing_mm[alone]) ** 2
    return _Fits(normals, variance, lack)


def _fit_all(mesh: Mesh, near: Neighbours, start: Array, chosen: NDArray, step: float) -> tuple[Array, Array, Array]:
    """Fit around the vertices `chosen` on all cores."""
    out = np.zeros((len(chosen), 2, 3)), np.zeros((len(chosen), 2)), np.zeros((len(chosen), 2))

    def work(first: int) -> None:
        part = slice(first, first + CHUNK)
        fit_normals(
            chosen[part], step * near.spacing_mm[chosen[part]], mesh.vertices, np.zeros(0), start,
            near.indptr, near.indices, *(array[part] for array in out),
        )  # fmt: skip

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(work, range(0, len(chosen), CHUNK)))
    return out

"""Intensities of lights whose directions are known, from what the pixels under them have in common."""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GROUPS = 10
"""Parts of the object whose intensities, each found without one of them, tell the standard deviation."""
_LEAST_SAMPLES = 4
"""A pixel with fewer says nothing of the intensities: three numbers are its own."""
_LEAST_EVIDENCE = 30.0
"""Samples beyond those that the normals take up, under which a light's intensity counts as not told."""
_ROUNDING = 1e-12
"""Misfit, as a share of the samples' squares, that rounding leaves."""
_SINGULAR = 1e-3
"""det / (trace / 3)^3 of a pixel's light vectors under which it says nothing reliable."""


@dataclass(frozen=True)
class Evidence:
    """What pixels say of one channel's intensities: quadratic forms, a group of pixels each.

    Parameters
    ----------
    misfit : (groups, F, F) float64
        x' misfit x is the sum of squares that no normal explains, x being 1 / intensity.
    noise : (groups, F) float64
        What unit noise of the samples adds to the diagonal.
    """

    misfit: Array
    noise: Array


@dataclass(frozen=True)
class Intensities:
    """One channel's intensities.

    Parameters
    ----------
    relative : (F,) float64
        To those that the samples were divided by; mean 1 over those that are told, 1 for the others.
    sigma : (F,) float64
        Relative standard deviation, by leaving out each group in turn: what the pixels of a group share counts, not
        only their noise. NaN where nothing is told.
    contrast : float
        The misfit of the next best intensities over that of the best: 1 where they cannot be told apart.
    misfit : float
        What no normal explains, mean square over the samples' mean square.
    """

    relative: Array
    sigma: Array
    contrast: float
    misfit: float


def evidence(values: NDArray, used: NDArray[np.bool_], toward: Array, groups: NDArray[np.intp]) -> list[Evidence]:
    """Eliminate each pixel's normal and albedo.

    Parameters
    ----------
    values : (P, F, C) float
        Samples of C channels.
    used : (P, F) bool
        Those that obey Lambert's law.
    toward : (P, F, 3) float64
        Light vectors of intensity 1; see `Lights.toward`.
    groups : (P,) int
        The group of each pixel, 0 ... GROUPS - 1.

    Returns
    -------
    list of C Evidence

    Notes
    -----
    m_pf = e_f (l_f . b_p) is linear in b_p and x_f = 1 / e_f together: x_f m_pf - l_f . b_p = 0 [Cho2020]. With
    M_p = diag(m_p), and the projector H_p on what normals explain under the lights that pixel p uses, b_p drops out:
    min_b = x' M_p (1 - H_p) M_p x. Summed over pixels this is an F x F matrix, from one pass over the samples.
    """
    channels, lights = values.shape[2], values.shape[1]
    misfit, noise = np.zeros((GROUPS, channels, lights, lights)), np.zeros((GROUPS, lights))
    _eliminate(values, used, toward, groups, misfit, noise)
    return [Evidence(misfit[:, channel], noise) for channel in range(channels)]


@numba.njit(nogil=True, cache=True)
def _eliminate(values, used, toward, groups, misfit, noise):  # pragma: no cover
    pixels, lights, channels = values.shape
    basis, chosen = np.empty((lights, 3)), np.empty(lights, np.int64)
    normal = np.empty((3, 3))
    for p in range(pixels):
        size = 0
        normal[:] = 0.0
        for k in range(lights):
            if used[p, k]:
                chosen[size] = k
                size += 1
                for i in range(3):
                    for j in range(3):
                        normal[i, j] += toward[p, k, i] * toward[p, k, j]
        mean = (normal[0, 0] + normal[1, 1] + normal[2, 2]) / 3
        if size < _LEAST_SAMPLES or np.linalg.det(normal) <= _SINGULAR * mean**3:
            continue
        root = np.linalg.cholesky(np.linalg.inv(normal))
        for at in range(size):
            v = toward[p, chosen[at]]
            for j in range(3):
                basis[at, j] = v[0] * root[0, j] + v[1] * root[1, j] + v[2] * root[2, j]
        group = groups[p]
        for at in range(size):
            noise[group, chosen[at]] += 1 - basis[at, 0] ** 2 - basis[at, 1] ** 2 - basis[at, 2] ** 2
        for c in range(channels):
            square = 0.0
            for at in range(size):
                square += np.float64(values[p, chosen[at], c]) ** 2
            if square <= 0.0:
                continue
            # Dark pixels count as bright ones: what is not Lambert's law grows with the albedo.
            factor = size / square
            for one in range(size):
                k = chosen[one]
                mine = factor * values[p, k, c]
                misfit[group, c, k, k] += mine * values[p, k, c]
                for other in range(size):
                    shared = (
                        basis[one, 0] * basis[other, 0]
                        + basis[one, 1] * basis[other, 1]
                        + basis[one, 2] * basis[other, 2]
                    )
                    misfit[group, c, k, chosen[other]] -= mine * values[p, chosen[other], c] * shared


def solve_intensities(found: Evidence, *, with_sigma: bool = False) -> Intensities:
    """Return the intensities that leave the least misfit.

    Notes
    -----
    The least generalised eigenvector of (misfit, diag(noise)): noise adds its diagonal to the misfit, which shifts
    all eigenvalues alike and turns no vector.
    """
    misfit, noise = found.misfit.sum(0), found.noise.sum(0)
    told = noise > _LEAST_EVIDENCE
    relative, sigma = np.ones(len(noise)), np.full(len(noise), np.nan)
    if np.count_nonzero(told) < 4:
        return Intensities(relative, sigma, 1.0, 1.0)
    misfit, noise = found.misfit[:, told][:, :, told], found.noise[:, told]
    best, values = _least(misfit.sum(0), noise.sum(0))
    relative[told] = best
    contrast = values[1] / max(values[0], _ROUNDING) if (best > 0).all() else 1.0
    if not with_sigma:
        sigma[told] = 0.0
        return Intensities(relative, sigma, float(contrast), float(values[0]))
    parts = [
        _least(misfit.sum(0) - less, np.maximum(noise.sum(0) - fewer, 1e-6))[0]
        for less, fewer in zip(misfit, noise, strict=True)
    ]
    with np.errstate(invalid="ignore"):
        sigma[told] = np.sqrt((GROUPS - 1) / GROUPS * ((np.stack(parts) / best - 1) ** 2).sum(0))
    return Intensities(relative, sigma, float(contrast), float(values[0]))


def _least(misfit: Array, noise: Array) -> tuple[Array, Array]:
    """Return intensities (F,) of mean 1, not all positive where they cannot be told; and the eigenvalues, ascending."""
    scale = 1 / np.sqrt(noise)
    values, vectors = np.linalg.eigh(scale[:, None] * misfit * scale)
    x = vectors[:, 0] * scale
    x *= np.sign(x.sum())
    intensities = 1 / np.where(x == 0, 1e-30, x)
    return intensities / np.mean(intensities), values

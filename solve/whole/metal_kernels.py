"""How well normals of a metal explain a pixel, and which do: compiled kernels."""

from typing import NamedTuple

import numba
import numpy as np

from scene import microfacets
from scene.microfacets import VECTORS
from solve.pixelwise.kernels import half_vector, light_vector
from solve.whole.reflectance_kernels import tangents

facets = numba.njit(**VECTORS)(microfacets.facets)
GRID = 2 * np.radians(1) ** 2 / 12
"""Variance of what lies between normals that are tried one degree apart, radians squared of both axes."""
SMALLEST = 0.05
"""Cosine to the camera of the steepest normal that is tried."""
UNEVEN, DOUBT = 0.2, 2.0
"""Errors of the model, standard deviation, as a share of what it says; how many times as large all errors may be, for
the normals' standard deviation."""
UNSURE = 10.0
"""Standard deviation, degrees, from which a pixel's normal is a guess."""


class Metal(NamedTuple):
    """Facets of one roughness that mirror alike all over.

    Parameters
    ----------
    alpha : float
        The facets' roughness.
    value : float
        Gray value of what mirrors all light, as Lambert's albedo is: a white surface that faces the light has it.
    stray : float
        Light that comes by way of other surfaces, standard deviation of the gray value.
    """

    alpha: float
    value: float
    stray: float


@numba.njit(nogil=True, cache=True)
def _look(i, samples, view, room):  # pragma: no cover
    """Fill in what does not change with a pixel's normal: rows 0-2 the lights, 3-5 half vectors, 6 the light there."""
    for f in range(room.shape[1]):
        x, y, z = light_vector(f, samples.points[i], samples.lights)
        room[3, f], room[4, f], room[5, f], power = half_vector(x, y, z, view)
        room[0, f], room[1, f], room[2, f] = x / power, y / power, z / power
        room[6, f] = power


@numba.njit(**VECTORS)
def _mirrored(n, nv, squared, room):  # pragma: no cover
    """Fill row 9 with what a normal mirrors of each light where all is mirrored; rows 7 and 8 are cosines."""
    nx, ny, nz = n[0], n[1], n[2]
    for f in range(room.shape[1]):
        room[7, f] = nx * room[0, f] + ny * room[1, f] + nz * room[2, f]
        room[8, f] = nx * room[3, f] + ny * room[4, f] + nz * room[5, f]
    facets(squared, room[7], room[8], nv, room[9])
    for f in range(room.shape[1]):
        room[9, f] = np.pi * room[6, f] * room[9, f] / (4 * nv) if room[7, f] > 0 else 0.0


@numba.njit(nogil=True, cache=True)
def _likelihood(gray, valid, n, view, metal, room):  # pragma: no cover
    """Return the log likelihood of a normal, by errors as they are expected and by those that its doubt allows for.

    Surfaces that turn away take less of the picture: that is the prior.
    """
    nv = n[0] * view[0] + n[1] * view[1] + n[2] * view[2]
    if nv < SMALLEST:
        return -np.inf, -np.inf
    _mirrored(n, nv, metal.alpha * metal.alpha, room)
    total, odds, doubted, doubted_odds = 0.0, 1.0, 0.0, 1.0
    for f in range(len(gray)):
        if valid[f]:
            model = metal.value * room[9, f]
            square, uneven = (gray[f] - model) ** 2, (UNEVEN * model) ** 2
            # Student's errors of three degrees of freedom: other parts' light comes in few frames, and is bright.
            variance = metal.stray**2 + uneven
            odds *= variance / metal.stray**2 * (1 + square / (3 * variance)) ** 4
            doubted_odds *= variance / metal.stray**2 * (1 + square / (3 * DOUBT**2 * variance)) ** 4
            if odds > 1e100:
                total, odds = total - 0.5 * np.log(odds), 1.0
                doubted, doubted_odds = doubted - 0.5 * np.log(doubted_odds), 1.0
    seen = np.log(nv)
    return seen + total - 0.5 * np.log(odds), seen + doubted - 0.5 * np.log(doubted_odds)


@numba.njit(nogil=True, cache=True)
def _sum_up(candidates, likelihood, mean):  # pragma: no cover
    """Fill in the mean normal (3,) of candidates (N, 3); `likelihood` (2, N): as `_likelihood` has it.

    Return the mean square of the angle to it, radians, by the second; that by the first; the log of the mean odds.
    """
    top, doubted = likelihood[0].max(), likelihood[1].max()
    mean[:] = 0.0
    whole = 0.0
    for c in range(len(candidates)):
        odds = np.exp(likelihood[0, c] - top)
        whole += odds
        for axis in range(3):
            mean[axis] += odds * candidates[c, axis]
    length = np.sqrt(mean[0] ** 2 + mean[1] ** 2 + mean[2] ** 2)
    mean /= length
    along = total = 0.0
    for c in range(len(candidates)):
        odds = np.exp(likelihood[1, c] - doubted)
        total += odds
        along += odds * (mean[0] * candidates[c, 0] + mean[1] * candidates[c, 1] + mean[2] * candidates[c, 2])
    spread = 2 * max(1 - length / whole, 0.0)
    return 2 * max(1 - along / total, 0.0), spread, top + np.log(whole / len(candidates))


@numba.njit(nogil=True, cache=True)
def search(samples, views, candidates, around, metal, mean, sigma):  # pragma: no cover
    """Fill in the normals (P, 3) and their standard deviation along one axis, degrees (P,).

    Return the log of the mean odds (P,) and of the largest (P,). `around` (M, 2): Tangents of what is tried beside the
    likeliest normal; none: nothing more is tried.
    """
    pixels, frames = samples.gray.shape
    room, likelihood = np.empty((10, frames)), np.empty((2, len(candidates)))
    evidence, largest = np.empty(pixels), np.empty(pixels)
    near, likely, across = np.empty((len(around), 3)), np.empty((2, len(around))), np.empty((2, 3))
    for i in range(pixels):
        gray, valid, view = samples.gray[i], samples.valid[i], views[i]
        _look(i, samples, view, room)
        for c in range(len(candidates)):
            likelihood[0, c], likelihood[1, c] = _likelihood(gray, valid, candidates[c], view, metal, room)
        best, largest[i] = candidates[np.argmax(likelihood[0])], likelihood[0].max()
        doubt, spread, evidence[i] = _sum_up(candidates, likelihood, mean[i])
        # Of normals far from each other the mean is as good as any.
        if len(around) and spread < 2 * np.radians(UNSURE) ** 2:
            tangents(best, across)
            for m in range(len(around)):
                a, b = around[m, 0], around[m, 1]
                length = np.sqrt(1 + a * a + b * b)
                for axis in range(3):
                    near[m, axis] = (best[axis] + a * across[0, axis] + b * across[1, axis]) / length
                likely[0, m], likely[1, m] = _likelihood(gray, valid, near[m], view, metal, room)
            around_it, _, _ = _sum_up(near, likely, mean[i])
            largest[i] = max(largest[i], likely[0].max())
            if doubt < 2 * np.radians(UNSURE) ** 2:
                doubt = around_it + GRID
        sigma[i] = np.degrees(np.sqrt(doubt / 2))
    return evidence, largest


@numba.njit(nogil=True, cache=True)
def appearance(samples, views, normals, alpha):  # pragma: no cover
    """Return (P, F) what normals (P, 3) of a metal of value 1 mirror of each light."""
    pixels, frames = samples.gray.shape
    out, room = np.empty((pixels, frames)), np.empty((10, frames))
    for i in range(pixels):
        _look(i, samples, views[i], room)
        n, view = normals[i], views[i]
        nv = n[0] * view[0] + n[1] * view[1] + n[2] * view[2]
        _mirrored(n, max(nv, SMALLEST), alpha * alpha, room)
        out[i] = room[9]
    return out

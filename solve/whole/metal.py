"""A metal: no light comes out of its body, and all that is seen is what its facets mirror.

Where Lambert's law is asked about a metal, normals are wrong by tens of degrees: a pixel is bright in the few frames
whose flash it mirrors, and dark in all others. Two numbers of the whole object, how rough and how bright it is, tell
from them where it faces.
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from scene.fan_out import fan_out
from scene.microfacets import VECTORS, facets
from solve.methods import Method, Whole
from solve.pixelwise.kernels import light_vector
from solve.problem import Problem
from solve.samples import Samples

Array = NDArray[np.float64]
CHUNK = 512
NEIGHBOURS, REACH = 6, 5
"""Degrees between the normals that are tried first; those tried then are one degree apart, so many to each side."""
SMALLEST = 0.05
"""Cosine to the camera of the steepest normal that is tried."""
STARTS, BROAD = (0.1, 0.2, 0.35), 0.5
"""Values of alpha that are tried first; and the one from which lobes are as broad as Lambert's: of matte and glossy
objects, and under wrong lights, it comes out at 0.65 to 1, of bronzes of roughness 0.36 to 0.5 at 0.19 to 0.28.
"""
UNSURE = 10.0
"""Standard deviation, degrees, from which a pixel's normal is a guess."""


class MetalSettings(NamedTuple):
    """Settings of `metal`.

    Parameters
    ----------
    pixels : int
        That tell how rough and how bright the object is, evenly spread over the brightest `bright`.
    bright : float
        Share of the pixels: the others may mirror no flash.
    stray : float
        Light that comes by way of other surfaces, standard deviation, as a share of the stack's 99th percentile.
    uneven : float
        Errors of the model, standard deviation, as a share of what it says.
    doubt : float
        How many times as large they may be, for the normals' standard deviation.
    """

    pixels: int = 300
    bright: float = 0.6
    stray: float = 0.04
    uneven: float = 0.2
    doubt: float = 2.0


class Metal(NamedTuple):
    """Facets of one roughness that mirror alike all over.

    Parameters
    ----------
    alpha : float
        The facets' roughness.
    value : float
        Gray value of what mirrors all light, as Lambert's albedo is: a white surface that faces the light has it.
    stray, uneven, doubt
        As in `MetalSettings`; `stray` is a gray value.
    """

    alpha: float
    value: float
    stray: float
    uneven: float
    doubt: float


def normals_around(step_deg: float) -> Array:
    """Return unit vectors (N, 3) toward the camera's half of space, about so far apart: a spiral of equal areas."""
    count = round(2 * np.pi / np.radians(step_deg) ** 2)
    z = 1 - (np.arange(count) + 0.5) / count
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    return np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], -1)


@numba.njit(nogil=True, cache=True)
def _look(i, samples, view, room):  # pragma: no cover
    """Fill in what does not change with a pixel's normal: rows 0-2 the lights, 3-5 half vectors, 6 the light there."""
    for f in range(room.shape[1]):
        x, y, z = light_vector(f, samples.points[i], samples.lights)
        power = np.sqrt(x * x + y * y + z * z)
        x, y, z = x / power, y / power, z / power
        hx, hy, hz = x + view[0], y + view[1], z + view[2]
        length = np.sqrt(hx * hx + hy * hy + hz * hz)
        room[0, f], room[1, f], room[2, f] = x, y, z
        room[3, f], room[4, f], room[5, f] = hx / length, hy / length, hz / length
        room[6, f] = power


@numba.njit(nogil=True, cache=True, **VECTORS)
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
            square, uneven = (gray[f] - model) ** 2, (metal.uneven * model) ** 2
            # Student's errors of three degrees of freedom: other parts' light comes in few frames, and is bright.
            variance = metal.stray**2 + uneven
            odds *= variance / metal.stray**2 * (1 + square / (3 * variance)) ** 4
            doubted_odds *= variance / metal.stray**2 * (1 + square / (3 * metal.doubt**2 * variance)) ** 4
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
def _search(samples, views, candidates, around, metal, mean, sigma):  # pragma: no cover
    """Fill in the normals (P, 3) and their standard deviation along one axis, degrees (P,); return log evidence (P,).

    `around` (M, 2): Tangents of what is tried beside the likeliest normal; none: nothing more is tried.
    """
    pixels, frames = samples.gray.shape
    room, likelihood, evidence = np.empty((10, frames)), np.empty((2, len(candidates))), np.empty(pixels)
    near, likely = np.empty((len(around), 3)), np.empty((2, len(around)))
    for i in range(pixels):
        gray, valid, view = samples.gray[i], samples.valid[i], views[i]
        _look(i, samples, view, room)
        for c in range(len(candidates)):
            likelihood[0, c], likelihood[1, c] = _likelihood(gray, valid, candidates[c], view, metal, room)
        best = candidates[np.argmax(likelihood[0])]
        doubt, spread, evidence[i] = _sum_up(candidates, likelihood, mean[i])
        # Of normals far from each other the mean is as good as any.
        if len(around) and spread < 2 * np.radians(UNSURE) ** 2:
            x, y, z = best
            ux, uy, uz = (0.0, z, -y) if abs(x) < 0.6 else (-z, 0.0, x)
            across = np.sqrt(ux * ux + uy * uy + uz * uz)
            ux, uy, uz = ux / across, uy / across, uz / across
            for m in range(len(around)):
                a, b = around[m, 0], around[m, 1]
                length = np.sqrt(1 + a * a + b * b)
                near[m, 0] = (x + a * ux + b * (y * uz - z * uy)) / length
                near[m, 1] = (y + a * uy + b * (z * ux - x * uz)) / length
                near[m, 2] = (z + a * uz + b * (x * uy - y * ux)) / length
                likely[0, m], likely[1, m] = _likelihood(gray, valid, near[m], view, metal, room)
            around_it, _, _ = _sum_up(near, likely, mean[i])
            if doubt < 2 * np.radians(UNSURE) ** 2:
                doubt = around_it
        sigma[i] = np.degrees(np.sqrt(doubt / 2))
    return evidence


@numba.njit(nogil=True, cache=True)
def _appearance(samples, views, normals, alpha, out):  # pragma: no cover
    """Fill `out` (P, F) with what normals mirror of each light, of the value 1."""
    room = np.empty((10, out.shape[1]))
    for i in range(len(out)):
        _look(i, samples, views[i], room)
        n, view = normals[i], views[i]
        nv = n[0] * view[0] + n[1] * view[1] + n[2] * view[2]
        _mirrored(n, max(nv, SMALLEST), alpha * alpha, room)
        out[i] = room[9]


def learn(samples: Samples, views: Array, settings: MetalSettings) -> Metal:
    """Return the metal that explains some bright pixels best; `is_one` tells whether it is one.

    Notes
    -----
    The sum of a pixel's odds over all normals is how well the two numbers explain it, whichever way it faces: largest
    is their product over the pixels (by Nelder and Mead's method). So nobody has to know a normal before.
    """
    brightest = np.where(samples.valid, samples.gray, 0).max(1)
    bright = np.flatnonzero(brightest >= np.quantile(brightest, 1 - settings.bright))
    chosen = bright[np.linspace(0, len(bright) - 1, min(settings.pixels, len(bright))).astype(int)]
    some, toward, scale = samples.some(chosen), views[chosen], samples.scale()
    candidates, nothing = normals_around(NEIGHBOURS), np.zeros((0, 2))
    normals, sigma = np.empty((len(chosen), 3)), np.empty(len(chosen))
    step = len(chosen) // 8 + 1
    parts = [slice(first, first + step) for first in range(0, len(chosen), step)]

    def metal_of(logs: Array) -> Metal:
        alpha, value = np.exp(np.minimum(logs, [0.0, 50.0]))
        return Metal(alpha, value, settings.stray * scale, settings.uneven, settings.doubt)

    def cost(logs: Array) -> float:
        metal = metal_of(logs)

        def work(part: slice) -> float:
            pixels = some.some(part), toward[part]
            return _search(*pixels, candidates, nothing, metal, normals[part], sigma[part]).sum()

        return -sum(fan_out(work, parts)) / len(chosen)

    # Where facets mirror best, they show a light 1 / (4 alpha^2) times as bright as a white surface does.
    start = min((np.log([alpha, 4 * alpha**2 * scale]) for alpha in STARTS), key=cost)
    simplex = start + np.array([[0, 0], [0.3, 0], [0, 0.5]])
    options = {"xatol": 0.02, "fatol": 0.005, "initial_simplex": simplex}
    return metal_of(minimize(cost, start, method="Nelder-Mead", options=options).x)


def appearance(samples: Samples, views: Array, normals: Array, alpha: float) -> Array:
    """Return (P, F) what normals (P, 3) of a metal of value 1 mirror of each light."""
    out = np.empty(samples.gray.shape)
    _appearance(samples, views, normals, alpha, out)
    return out


def _fit_whole(problem: Problem, samples: Samples, settings: MetalSettings) -> Whole:
    """Find each pixel's normal by the metal that the object is.

    Notes
    -----
    A sample is value pi D G / (4 n . v) of GGX's facets [Walter2007], times the light there; the rise of a metal's
    reflectance towards grazing is left out. The normal is the mean over all that face the camera, weighed by their
    odds: Student's errors, and the share of the picture that such a surface takes. So the dark samples count, too,
    and where no flash is mirrored the spread says so. Near lights are seen from the depth of their reference point:
    half vectors turn by half as much as lights do.

    Do not believe it where what the metal mirrors is bright itself: a lit table under steep parts.
    """
    views = problem.views()
    metal = learn(samples, views, settings)
    reach = np.radians(np.arange(-REACH, REACH + 1))
    around = np.stack(np.meshgrid(reach, reach), -1).reshape(-1, 2)
    candidates = normals_around(NEIGHBOURS)
    normals, sigma = np.empty((len(views), 3)), np.empty(len(views))

    def work(part: slice) -> None:
        _search(samples.some(part), views[part], candidates, around, metal, normals[part], sigma[part])

    fan_out(work, [slice(first, first + CHUNK) for first in range(0, len(views), CHUNK)])
    shade = appearance(samples, views, normals, metal.alpha)
    guessed = float(np.mean(sigma > UNSURE))
    cautions = [
        f"{guessed:.0%} of the object mirrors no flash clearly: its normals there may be off by tens of degrees, see "
        "their sigma. Flashes from more sides would help."
    ] * (guessed > 0.05)
    if not is_one(metal):
        cautions = [
            f"the object does not mirror as a metal does (roughness {metal.alpha**0.5:.2f}): not to be believed."
        ]
    # What mirrors no flash says nothing of the reflectance.
    shade[metal.value * shade < metal.stray] = 0
    return Whole(normals * metal.value, samples.valid, tuple(cautions), shade=shade, sigma_deg=sigma)


def is_one(metal: Metal) -> bool:
    """Tell whether it is narrow lobes that explain the object, as of a metal or of dark gloss."""
    return metal.alpha < BROAD


METHOD = Method("metal", {"default": MetalSettings()}, fit_whole=_fit_whole)

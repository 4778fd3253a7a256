"""A metal: no light comes out of its body, and all that is seen is what its facets mirror.

Where Lambert's law is asked about a metal, normals are wrong by tens of degrees: a pixel is bright in the few frames
whose flash it mirrors, and dark in all others. Two numbers of the whole object, how rough and how bright it is, tell
from them where it faces.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from scene.fan_out import fan_out
from scene.light_layouts import cap
from solve.methods import NO_SETTINGS, Method, Settings, Whole
from solve.pixelwise import iterative
from solve.problem import Problem, spread_over
from solve.samples import Samples
from solve.whole.metal_kernels import UNEVEN, UNSURE, Metal, appearance, search

Array = NDArray[np.float64]
CHUNK = 512
CANDIDATES = cap(round(2 * np.pi / np.radians(6) ** 2), 90)
"""Normals (N, 3) that are tried first: all that face the camera, six degrees apart."""
BESIDE = np.radians([(across, up) for up in range(-5, 6) for across in range(-5, 6)])
"""Tangents (M, 2) of what is tried then beside the likeliest: five to each side, one degree apart."""
SMOOTHEST, STARTS, BROAD = 0.02, (0.1, 0.2, 0.35), 0.5
"""Least alpha, and those that are tried first; and the one from which lobes are as broad as Lambert's: of matte and
glossy objects, and under wrong lights, it comes out at 0.65 to 1, of bronzes of roughness 0.36 to 0.5 at 0.19 to 0.28.
Paint in bright and dark looks narrow, too, to what takes the object for of one value: see `explains`.
"""
FEWEST = 30
"""Pixels that a metal is told from."""


PIXELS, BRIGHT = 300, 0.6
"""That tell how rough and how bright the object is, evenly spread over this share of them, the brightest: others may
mirror no flash."""
STRAY = 0.04
"""Light that comes by way of other surfaces, standard deviation, as a share of the stack's 99th percentile."""


def learn(samples: Samples, views: Array) -> Metal:
    """Return the metal that explains some bright pixels best; `explains` tells whether the object is one.

    Notes
    -----
    The sum of a pixel's odds over all normals is how well the two numbers explain it, whichever way it faces: largest
    is their product over the pixels (by Nelder and Mead's method). So nobody has to know a normal before.
    """
    brightest = np.where(samples.valid, samples.gray, 0).max(1)
    brightest[~_is_seen(samples)] = -1
    bright = brightest >= np.quantile(brightest, 1 - BRIGHT)
    chosen = np.flatnonzero(spread_over(bright, PIXELS))
    some, toward, scale = samples.some(chosen), views[chosen], samples.scale()
    nothing, normals, sigma = np.zeros((0, 2)), np.empty((len(chosen), 3)), np.empty(len(chosen))
    step = len(chosen) // 8 + 1
    parts = [slice(first, first + step) for first in range(0, len(chosen), step)]

    def metal_of(logs: Array) -> Metal:
        alpha, value = np.exp(np.clip(logs, np.log([SMOOTHEST, 1e-6 * scale]), np.log([1, 1e6 * scale])))
        return Metal(alpha, value, STRAY * scale)

    def cost(logs: Array) -> float:
        metal = metal_of(logs)

        def work(part: slice) -> float:
            pixels = some.some(part), toward[part]
            return search(*pixels, CANDIDATES, nothing, metal, normals[part], sigma[part])[0].sum()

        return -sum(fan_out(work, parts)) / len(chosen)

    # Where facets mirror best, they show a light 1 / (4 alpha^2) times as bright as a white surface does.
    start = min((np.log([alpha, 4 * alpha**2 * scale]) for alpha in STARTS), key=cost)
    simplex = start + np.array([[0, 0], [0.3, 0], [0, 0.5]])
    options = {"xatol": 0.02, "fatol": 0.005, "initial_simplex": simplex}
    return metal_of(minimize(cost, start, method="Nelder-Mead", options=options).x)


def explains(metal: Metal, samples: Samples, views: Array) -> bool:
    """Tell whether the object is this metal: by narrow lobes, and better than by Lambert's law.

    By what `iterative` finds of Lambert's law each pixel has an albedo of its own, which the metal's have not; both are
    held to the metal's errors, each at its likeliest normal.
    """
    chosen = np.flatnonzero(spread_over(_is_seen(samples), PIXELS))
    if metal.alpha > BROAD or len(chosen) < FEWEST:
        return False
    some, toward = samples.some(chosen), views[chosen]
    normals, sigma = np.empty((len(chosen), 3)), np.empty(len(chosen))
    _, largest = search(some, toward, CANDIDATES, BESIDE, metal, normals, sigma)
    b, _ = iterative.fit(some, samples.scale(), iterative.IterativeSettings())
    matte = np.maximum(np.einsum("pi,pfi->pf", b, some.toward()), 0)
    variance = metal.stray**2 + (UNEVEN * matte) ** 2
    odds = np.log(variance / metal.stray**2) + 4 * np.log1p((some.gray - matte) ** 2 / (3 * variance))
    return bool(largest.sum() > -0.5 * odds[some.valid].sum())


def found(samples: Samples, views: Array) -> Metal | None:
    """Return the metal that the object is; None: it is none, or nothing tells."""
    metal = learn(samples, views) if np.count_nonzero(_is_seen(samples)) >= FEWEST else None
    return metal if metal and explains(metal, samples, views) else None


def _is_seen(samples: Samples) -> NDArray[np.bool_]:
    """Tell of which pixels (P,) enough samples are not clipped."""
    return samples.valid.sum(1) > max(3, samples.gray.shape[1] // 2)


def _fit_whole(problem: Problem, samples: Samples, _: Settings) -> Whole:
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
    metal = learn(samples, views)
    normals, sigma = np.empty((len(views), 3)), np.empty(len(views))

    def work(part: slice) -> None:
        search(samples.some(part), views[part], CANDIDATES, BESIDE, metal, normals[part], sigma[part])

    fan_out(work, [slice(first, first + CHUNK) for first in range(0, len(views), CHUNK)])
    shade = appearance(samples, views, normals, metal.alpha)
    known = samples.valid.sum(1) >= 3
    normals[~known], sigma[~known] = 0, np.nan
    guessed = float(np.mean(sigma[known] > UNSURE)) if known.any() else 0.0
    cautions = [
        f"{guessed:.0%} of the object mirrors no flash clearly: its normals there may be off by tens of degrees, see "
        "their sigma. Flashes from more sides would help."
    ] * (guessed > 0.05)
    if not explains(metal, samples, views):
        cautions = [
            f"the object does not mirror as a metal does (roughness {metal.alpha**0.5:.2f}): not to be believed."
        ]
    # What mirrors no flash says nothing of the reflectance.
    shade[metal.value * shade < metal.stray] = 0
    return Whole(normals * metal.value, samples.valid, tuple(cautions), shade=shade, sigma_deg=sigma)


METHOD = Method("metal", {"default": NO_SETTINGS}, fit_whole=_fit_whole)

"""One reflectance for the whole object: a table over half and difference angle, fitted together with every normal.

Least squares throws away what is not matte; gloss and retroreflection tell of the normal, too, once it is known how the
object reflects. All pixels share that, but for their albedo; the pixels teach it to each other.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from solve.methods import Method, Whole
from solve.pixelwise import iterative
from solve.problem import Problem
from solve.samples import Samples
from solve.whole import near_depth
from solve.whole.light_distance import find_positions
from solve.whole.reflectance_kernels import DIFFERENCE, HALF, SIZE, Given, Pixels, accumulate, back_substitute, refine

RIDGE = 1e-8
"""Pull of the table to 1 where nothing is seen, per sample; it also settles what is albedo and what is table."""
CHUNK = 1024
WORSE = 1.02
"""Where the table leaves more than this times what the matte model leaves unexplained, it has gone astray."""


class Settings(NamedTuple):
    """Settings of `reflectance`.

    Parameters
    ----------
    pixels : int
        How many pixels, evenly spread, the table is learnt from; the others are fitted to it.
    rounds, steps : int
        Of the joint fit, and of each pixel's own afterwards.
    shadow_threshold : float
        Samples under this share of the stack's 99th percentile are shadowed.
    noise_floor : float
        Least sigma of a pixel's residuals, as a share of the same.
    smoothness : float
        Weight of the table's second differences, per sample.
    sigmas : float
        Residuals beyond this times their pixel's own robust sigma count ever less.
    """

    pixels: int = 8000
    rounds: int = 12
    steps: int = 12
    shadow_threshold: float = 0.02
    noise_floor: float = 0.004
    smoothness: float = 1e-4
    sigmas: float = 2.0


def _prepare(problem: Problem, settings: Settings) -> Problem:
    """Near lights are taken as each pixel's own place sees them."""
    problem = find_positions(problem)
    is_near = problem.lights.positions_mm is not None
    return near_depth.find_depth(problem, near_depth.Settings()) if is_near else problem


def _fit_whole(problem: Problem, samples: Samples, settings: Settings) -> Whole:
    row, column = np.nonzero(problem.mask)
    return fit_to_views(samples, -problem.camera.rays(np.stack([column, row], -1))[1], settings)


def fit_to_views(samples: Samples, views, settings: Settings) -> Whole:
    """Fit normals, albedos and one table of reflectance.

    `views` (P, 3) are the unit vectors from the pixels' points to the camera.

    Notes
    -----
    m = albedo (n . l) f(theta_h, theta_d), f bilinear between knots, theta_h the angle between normal and half vector
    and theta_d that between half vector and light: many materials are that nearly [Rusinkiewicz1998], whatever turns
    with the normal about the view left out [Romeiro2008]. Minimised is
    sum w (m / albedo - (n . l) f)^2 + smoothness |D f|^2 over all normals, albedos and f at once: the normals are
    eliminated pixel by pixel (Schur complement), as points are in bundle adjustment [Triggs2000], since taking turns
    creeps. Weights fall off beyond `sigmas` (shadows, bounced light) and where f is far from 1 (highlights are steep).
    Starts from `iterative`; where the table goes astray, that is what is returned. One table serves one material: of
    an object of several, the best is a compromise.
    """
    scale = samples.scale()
    b, used = iterative.fit(samples, scale, iterative.Settings())
    known = np.flatnonzero((b != 0).any(1))
    if len(known) < SIZE:
        return Whole(b, used, ("reflectance: too few pixels to learn from; the normals are those of `iterative`.",))
    albedo = np.linalg.norm(b[known], axis=1)
    normals = b[known] / albedo[:, None]
    given = Given(samples, views, settings.shadow_threshold * scale, settings.noise_floor * scale, settings.sigmas)
    place = np.unique(np.linspace(0, len(known) - 1, min(settings.pixels, len(known))).astype(int))
    table, before, after = _learn(given, Pixels(known, normals, albedo).some(place), settings)
    if not after <= WORSE * before:
        said = "reflectance: no one table explains the object better than matte; the normals are those of `iterative`."
        return Whole(b, used, (said,))

    def run(first: int) -> None:
        refine(given, Pixels(known, normals, albedo).some(slice(first, first + CHUNK)), table, settings.steps, used)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run, range(0, len(known), CHUNK)))
    b[known] = normals * albedo[:, None]
    return Whole(b, used, ())


def _learn(given: Given, chosen: Pixels, settings: Settings):
    """Return the table (SIZE,), and the residuals' middle sigma with the matte table and with it.

    Moves the normals and albedos of the pixels that are chosen, in place.
    """
    smoothness = settings.smoothness
    table = np.ones(SIZE)
    bend = _second_differences()
    before = sigma = 0.0
    parts = [chosen.some(slice(first, first + CHUNK)) for first in range(0, len(chosen.index), CHUNK)]
    for turn in range(settings.rounds + 1):
        # At first the table alone: highlights must not look like outliers only because no table knows them yet.
        joint = turn > 0

        def work(part: Pixels, joint=joint, table=table):
            return accumulate(given, part, table, joint)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            found = list(pool.map(work, parts))
        hessian, slope, samples = (sum(part[k] for part in found) for k in range(3))
        sigma = float(np.median(np.concatenate([part[3] for part in found])))
        before = before or sigma
        hessian = hessian + samples * (smoothness * bend + RIDGE * np.eye(SIZE))
        slope = slope - samples * (smoothness * bend @ table + RIDGE * (table - 1))
        step = np.linalg.solve(hessian, slope)
        table = np.maximum(table + step, 0.05)
        if joint:
            for part, (*_, inverse, own, coupling) in zip(parts, found, strict=True):
                back_substitute(part, inverse, own, coupling, step)
    return table, before, sigma


def _second_differences():
    """Return (SIZE, SIZE), the matrix of the table's summed squared second differences; along half angles a tenth."""
    grid = np.arange(SIZE).reshape(len(HALF), len(DIFFERENCE))
    out = np.zeros((SIZE, SIZE))
    for rows, weight in (
        (np.stack([grid[:, :-2], grid[:, 1:-1], grid[:, 2:]], -1), 1.0),
        (np.stack([grid[:-2], grid[1:-1], grid[2:]], -1), 0.1),
    ):
        for triple in rows.reshape(-1, 3):
            out[np.ix_(triple, triple)] += weight * np.outer([1, -2, 1], [1, -2, 1])
    return out


METHOD = Method("reflectance", {"default": Settings(), "seed": Settings()}, fit_whole=_fit_whole, prepare=_prepare)

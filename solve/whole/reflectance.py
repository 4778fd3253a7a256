"""One reflectance for the whole object: a table over half and difference angle, fitted together with every normal.

Least squares throws away what is not matte; gloss and retroreflection tell of the normal, too, once it is known how the
object reflects. All pixels share that, but for their albedo; the pixels teach it to each other.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from solve.pixelwise import iterative
from solve.whole import near
from solve.whole.reflectance_kernels import DIFFERENCE, HALF, SIZE, accumulate, back_substitute, refine
from solve.whole_result import Whole, scale_of_samples

POSITIONS = True
WHOLE = True
VIEWS = True
CALIBRATED = True

SETTINGS = {
    "pixels": 8000,
    "rounds": 12,
    "steps": 12,
    "shadow_threshold": 0.02,
    "noise_floor": 0.004,
    "smoothness": 1e-4,
    "sigmas": 2.0,
}

SEED_SETTINGS = SETTINGS
"""The benchmark has no such method."""

RIDGE = 1e-8
"""Pull of the table to 1 where nothing is seen, per sample; it also settles what is albedo and what is table."""
CHUNK = 1024
WORSE = 1.02
"""Where the table leaves more than this times what the matte model leaves unexplained, it has gone astray."""


def find_depth(frames, lights, camera, mask, **_):
    """Return what `solve.whole.near.find_depth` does: near lights are taken as each pixel's own place sees them."""
    if lights.positions_mm is None:
        return None, ()
    return near.find_depth(frames, lights, camera, mask, **near.SETTINGS)


def fit_whole(
    gray,
    valid,
    points,
    geometry,
    mask,
    *,
    views,
    pixels,
    rounds,
    steps,
    shadow_threshold,
    noise_floor,
    smoothness,
    sigmas,
):
    """Fit normals, albedos and one table of reflectance.

    Parameters
    ----------
    gray, valid, points, geometry, mask
        See `solve.whole.rpca.fit_whole`.
    views : (P, 3) float64
        Unit, from the pixels' points to the camera.
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

    Returns
    -------
    Whole

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
    scale = scale_of_samples(gray, valid)
    samples: tuple = (gray, valid, points, *geometry, scale)
    b, used = iterative.fit(*samples, **iterative.SETTINGS)
    known = np.flatnonzero((b != 0).any(1))
    if len(known) < SIZE:
        return Whole(b, used, ("reflectance: too few pixels to learn from; the normals are those of `iterative`.",))
    albedo = np.linalg.norm(b[known], axis=1)
    normals = b[known] / albedo[:, None]
    given: tuple = (valid, points, views, *geometry, shadow_threshold * scale, noise_floor * scale, sigmas)
    chosen = known[np.unique(np.linspace(0, len(known) - 1, min(pixels, len(known))).astype(int))]
    place = np.searchsorted(known, chosen)
    table, before, after = _learn(gray, given, chosen, normals[place], albedo[place], rounds, smoothness)
    if not after <= WORSE * before:
        said = "reflectance: no one table explains the object better than matte; the normals are those of `iterative`."
        return Whole(b, used, (said,))

    def run(first: int) -> None:
        some = slice(first, first + CHUNK)
        arguments: tuple = (gray, *given, known[some], normals[some], albedo[some], table, steps, used)
        refine(*arguments)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run, range(0, len(known), CHUNK)))
    b[known] = normals * albedo[:, None]
    return Whole(b, used, ())


def _learn(gray, given: tuple, chosen, normals, albedo, rounds, smoothness):
    """Return the table (SIZE,), and the residuals' middle sigma with the matte table and with it."""
    normals, albedo = normals.copy(), albedo.copy()
    table = np.ones(SIZE)
    bend = _second_differences()
    before = sigma = 0.0
    for turn in range(rounds + 1):
        parts = [chosen[first : first + CHUNK] for first in range(0, len(chosen), CHUNK)]
        # At first the table alone: highlights must not look like outliers only because no table knows them yet.
        joint = turn > 0

        def work(first: int, joint=joint, table=table):
            some = slice(first, first + CHUNK)
            arguments: tuple = (gray, *given, chosen[some], normals[some], albedo[some], table, joint)
            return accumulate(*arguments)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            found = list(pool.map(work, range(0, len(chosen), CHUNK)))
        hessian, slope, samples = (sum(part[k] for part in found) for k in range(3))
        sigma = float(np.median(np.concatenate([part[3] for part in found])))
        before = before or sigma
        hessian = hessian + samples * (smoothness * bend + RIDGE * np.eye(SIZE))
        slope = slope - samples * (smoothness * bend @ table + RIDGE * (table - 1))
        step = np.linalg.solve(hessian, slope)
        table = np.maximum(table + step, 0.05)
        if joint:
            for part, place in zip(found, range(0, len(chosen), CHUNK), strict=True):
                some = slice(place, place + len(parts[place // CHUNK]))
                inverse, own, coupling = part[4:]
                back_substitute(normals[some], albedo[some], inverse, own, coupling, step)
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

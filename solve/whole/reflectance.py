"""One reflectance for the whole object, fitted together with every normal: a table, a curve, light from itself.

Least squares throws away what is not matte; gloss and retroreflection tell of the normal, too, once it is known how the
object reflects. All pixels share that, but for their albedo; the pixels teach it to each other.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from scene.fan_out import fan_out
from scene.spheres import WHITE_BALL_ALBEDO
from solve.assess import DARK
from solve.methods import NO_SETTINGS, Method, Settings, Whole
from solve.pixelwise import iterative
from solve.problem import Problem, spread_over
from solve.samples import GRAY, Samples
from solve.whole.interreflection import Relief, Thrown
from solve.whole.near import find_positions
from solve.whole.near_depth import find_depth
from solve.whole.reflectance_equations import accumulate, back_substitute, refine
from solve.whole.reflectance_kernels import DIFFERENCE, HALF, INCIDENCE, SIZE, TABLE, Given, Pixels, Room

RIDGE = 1e-8
"""Pull of all that is shared to matte where nothing is seen, per sample."""
PULL, PULL_CURVE = 0.01, 0.1
"""Pull of the table and of the curve to matte, per sample, in units of the residuals' variance: normals a little
steeper or flatter and another reflection explain the samples almost as well. It also settles what is albedo.
"""
FAR = 0.3
"""How far from matte the pull is half as strong: highlights are not held back."""
HALF_WHITE = 0.5
"""Reflectance that the brightest parts are pulled to."""
MATTE_OBJECT = np.repeat([1.0, 0.0, HALF_WHITE], [TABLE, SIZE - TABLE - 1, 1])
CHUNK = 1024
WORSE = 1.02
"""Where the table leaves more than this times what the matte model leaves unexplained, it has gone astray."""
WORSE_WITH_WHITE = 2.0
"""The same where a white ball tells the reflectance: a matte hollow that lights itself looks like a shallower one that
does not, and to the noise; the light that it throws is known less well than that.
"""
LOBE, GLOSSY = 5, 1.05
"""Half angles of the table from 0 on, and what it is there (median) of a glossy object."""


PIXELS = 4000
"""Pixels, evenly spread, from which the table is learnt; the others are fitted to it."""
ROUNDS, STEPS, TURNS = 12, 12, 2
"""Of the joint fit; of each pixel's own afterwards; and how often the object's light upon itself is found anew, with
half as many rounds after it."""
SMOOTHNESS = 1e-4
"""Weight of the table's second differences, per sample."""


def prepare(problem: Problem, _: Settings) -> Problem:
    """Return the problem with near lights as each pixel's own place sees them."""
    problem = find_positions(problem)
    is_near = problem.lights.positions_mm is not None
    return find_depth(problem, iterative.IterativeSettings()) if is_near else problem


def _fit_whole(problem: Problem, samples: Samples, _: Settings) -> Whole:
    return fit_prepared(problem, samples)[0]


def fit_prepared(problem: Problem, samples: Samples) -> tuple[Whole, NDArray, Thrown]:
    """Return what `fit_to_views` does of a prepared problem."""
    relief = Relief(problem.mask, problem.camera, problem.depth_mm(), PIXELS)
    ball = problem.lights.white_value
    white = None if ball is None else float(GRAY @ ball) / WHITE_BALL_ALBEDO
    return fit_to_views(samples, problem.views(), relief, white)


def _is_matte(shared: NDArray) -> bool:
    """Whether the object shows no gloss."""
    return bool(np.median(shared[: LOBE * len(DIFFERENCE)]) < GLOSSY)


def fit_to_views(
    samples: Samples, views: NDArray, relief: Relief | None = None, white: float | None = None
) -> tuple[Whole, NDArray, Thrown]:
    """Fit normals, albedos and one reflectance; return also what all pixels share (SIZE,), and the light on them.

    `views` (P, 3) are the unit vectors from the pixels' points to the camera; without `relief`, the object throws no
    light upon itself; `white`: gray value of a surface of reflectance 1 that faces a light of intensity 1, if known.

    Notes
    -----
    m = albedo (c f + r t), f = T(theta_h, theta_d) + C(c), c = n . l. T is bilinear between knots, theta_h the angle
    between normal and half vector and theta_d that between half vector and light: many materials are that nearly
    [Rusinkiewicz1998], whatever turns with the normal about the view left out [Romeiro2008]. C is what T cannot hold:
    light that enters a glossy surface and comes out matte has passed it the more weakly the lower the light stands
    [Wolff1994]; without C, plastic looks two degrees too steep. t is the light thrown by the object's other parts, see
    `interreflection`, r the reflectance of the brightest.

    Minimised is sum w (m / albedo - c f - r t)^2 + SMOOTHNESS |D f|^2 + the pull to matte, over all normals, albedos,
    T, C and r at once: the normals are eliminated pixel by pixel (Schur complement), as points are in bundle adjustment
    [Triggs2000], since taking turns creeps. Weights fall off beyond `SIGMAS` (shadows) and where f is far from 1
    (highlights are steep). Starts from `iterative`; where it goes astray, that is what is returned. One reflectance
    serves one material: of an object of several, the best is a compromise.
    """
    scale, how = samples.scale(), iterative.IterativeSettings()
    b, used = iterative.fit(samples, scale, how)
    is_known = (b != 0).any(1)
    known = np.flatnonzero(is_known)
    if len(known) < SIZE:
        said = "reflectance: too few pixels to learn from; the normals are those of `iterative`."
        return Whole(b, used, (said,)), MATTE_OBJECT, Thrown.none(*samples.gray.shape)
    albedo = np.linalg.norm(b[known], axis=1)
    normals = b[known] / albedo[:, None]
    given = Given(samples, views, DARK * scale, how.noise_floor * scale, Thrown.none(*samples.gray.shape))
    chosen = np.flatnonzero(spread_over(is_known, PIXELS)) if relief is None else relief.patches(is_known)
    learnt = Pixels(known, normals, albedo).some(np.searchsorted(known, chosen))
    alone, before, after = _learn(given, learnt, ROUNDS)
    shared = alone
    if relief is not None:
        # Of a glossy object nobody knows how much of its brightness it throws upon itself: the samples tell.
        white = white if _is_matte(shared) else None
        for _ in range(TURNS):
            brightest = np.percentile(learnt.albedo, 95)
            thrown = relief.throw(chosen, samples.gray[chosen] / np.float32(brightest), learnt.normals)
            given, known_white = given._replace(thrown=thrown), None if white is None else brightest / white
            shared, _, after = _learn(given, learnt, ROUNDS // 2, shared, known_white)
    if not after <= (WORSE if white is None else WORSE_WITH_WHITE) * before:
        said = "reflectance: no one table explains the object better than matte; the normals are those of `iterative`."
        return Whole(b, used, (said,)), MATTE_OBJECT if _is_matte(alone) else alone, given.thrown

    def run(first: int) -> None:
        some = Pixels(known, normals, albedo).some(slice(first, first + CHUNK))
        refine(given, some, shared, Room.of(used.shape[1]), STEPS, used)

    fan_out(run, range(0, len(known), CHUNK))
    b[known] = normals * albedo[:, None]
    return Whole(b, used, ()), shared, given.thrown


def _learn(given: Given, chosen: Pixels, rounds: int, start: NDArray | None = None, brightest: float | None = None):
    """Return what is shared (SIZE,), and the residuals' middle sigma with the start and with it.

    Moves the normals and albedos of the pixels that are chosen, in place. Without a start: from a matte object.
    `brightest`: the reflectance of the brightest parts, where it is known.
    """
    shared = MATTE_OBJECT if start is None else start
    bend = _second_differences()
    pull = np.repeat([PULL, PULL_CURVE, PULL], [TABLE, SIZE - TABLE - 1, 1])
    before = sigma = 0.0
    parts = [chosen.some(slice(first, first + CHUNK)) for first in range(0, len(chosen.index), CHUNK)]
    for turn in range(rounds + 1):
        # At first what is shared alone: highlights must not look like outliers only because no table knows them yet.
        joint = turn > 0 or start is not None

        def work(part: Pixels, joint=joint, shared=shared):
            return accumulate(given, part, shared, Room.of(given.samples.gray.shape[1]), joint)

        found = fan_out(work, parts)
        hessian, slope, samples = (sum(part[k] for part in found) for k in range(3))
        spread, albedo = np.concatenate([part[3] for part in found]), np.concatenate([part.albedo for part in parts])
        sigma = float(np.median(spread * albedo))
        before = before or sigma
        towards = RIDGE + pull * np.median(spread) ** 2 / (1 + ((shared - MATTE_OBJECT) / FAR) ** 2)
        hessian = hessian + np.triu(hessian, 1).T + samples * (SMOOTHNESS * bend + np.diag(towards))
        slope = slope - samples * (SMOOTHNESS * bend @ shared + towards * (shared - MATTE_OBJECT))
        step = np.linalg.solve(hessian, slope)
        shared = shared + step
        shared[:TABLE] = np.maximum(shared[:TABLE], 0.05)
        # Nothing throws more light than falls on it.
        shared[-1] = np.clip(shared[-1] if brightest is None else brightest, 0, 1)
        if joint:
            for part, (*_, inverse, own, coupling) in zip(parts, found, strict=True):
                back_substitute(part, inverse, own, coupling, step)
    return shared, before, sigma


def _second_differences():
    """Return (SIZE, SIZE), the matrix of the table's summed squared second differences; along half angles a tenth."""
    half, difference, curve = (
        step.T @ step for step in (np.diff(np.eye(len(knots)), 2, 0) for knots in (HALF, DIFFERENCE, INCIDENCE))
    )
    table = np.kron(np.eye(len(HALF)), difference) + 0.1 * np.kron(half, np.eye(len(DIFFERENCE)))
    return np.asarray(block_diag(table, curve, 0))


METHOD = Method("reflectance", {"default": NO_SETTINGS}, fit_whole=_fit_whole, prepare=prepare)

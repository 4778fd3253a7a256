"""Point lights and perspective: the depth of every pixel is found first, in turn with its normal, see `near_depth`.

Where lights stand whose directions alone are known is found from the object itself: near ones dim and turn across it.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from scene.intensities import Eliminated
from scene.lights import Lights
from scene.normals import unit
from scene.robust import spread
from solve.methods import Method
from solve.pixelwise import iterative
from solve.problem import Problem, spread_over
from solve.samples import Geometry, all_samples, scale_of
from solve.surface.integration import integrate
from solve.whole.near_depth import find_depth

Array = NDArray[np.float64]

PIXELS = 6_000
"""Of the picture that this is read from, at most."""
SAMPLED = 2_000
"""Of those, what distances are fitted to; all of them make the relief."""
NEARNESS = (0.02, 0.04, 0.07, 0.1, 0.14, 0.2, 0.3, 0.45)
"""Object's size over the lights' distance: what is tried first, upon the relief that distant lights make."""
ENOUGH = 100
"""Fewest pixels that distances are estimated from."""
GAIN = 0.15
"""By how much the residuals' logarithm must fall before lights are taken for near ones: gloss alone gives a tenth."""
FARTHEST = 70.0
"""Object sizes: lights beyond are distant. What they would tell, other reflection than Lambert's tells as well."""
FEWEST = 5
"""Lights whose distances can be told."""
RANGE = 2.5
"""Ratio to the first of the mean distances that are tried then, each with its own relief."""
TRIALS = 5
"""Mean distances that are tried. With eight DiLiGenT's ball and cat come out the same, in half as much time again."""
STEPS = 5
"""Of the single distances, for each of these."""
LOOSE = 1e-3
"""Pull of each light's nearness to their mean, beside what its samples tell."""


def find_positions(problem: Problem) -> Problem:
    """Return the problem under lights with positions; as it is if they have them or are too far to tell.

    Directions and intensities are taken to hold somewhere in the object.

    Notes
    -----
    A light at the distance d of an object of size s dims by some 2 s / d across it and turns by s / d. With
    l_f(p) = |q_f - c|^2 (q_f - p) / |q_f - p|^3 and q_f = c + (s / k_f) direction_f: for a mean nearness k,
    `near_depth` makes the relief, also how far it stands before c; upon that, each k_f is found by Gauss and Newton on
    m = l_f(p) . b, each pixel's b eliminated (Schur complement [Triggs2000]). The mean is where the residuals are
    least then. Relief and mean in turn would drift off together: the one follows the other.

    Lengths have the camera's unit; under perspective, the object is taken to be where the lights' reference point
    is, or 1000 away.
    """
    lights = problem.lights
    if lights.positions_mm is not None:
        return problem
    thin = problem.thinned(PIXELS)
    if np.count_nonzero(thin.mask) < ENOUGH:
        return problem.warned("too few pixels to tell how far the lights are: they are taken as distant.")
    if len(lights) < FEWEST:
        # A pixel's own three numbers leave one sample or none.
        return problem
    small = _Small(thin)
    small.raise_relief(lights)
    center, size = small.center(), small.size()
    distant = small.spread(lights)
    rough = [small.spread(_placed(lights, center, size / np.full(len(lights), near))) for near in NEARNESS]
    left, nearness = _by_trials(small, lights, center, size, NEARNESS[int(np.argmin(rough))])
    if np.median(1 / nearness) > FARTHEST or not left < distant - GAIN:
        return problem
    return problem.under(_placed(lights, center, size / nearness)).warned(
        f"the lights came without positions; by how the object is lit, they are {1 / nearness.max():.1f} to "
        f"{1 / nearness.min():.1f} times its size away."
    )


def _by_trials(small: "_Small", lights: Lights, center: Array, size: float, start: float) -> tuple[float, Array]:
    """Return the least spread over the mean nearness, and each light's nearness (F,) there."""
    tried: dict[float, tuple[float, Array]] = {}

    def trial(log_nearness: float) -> float:
        nearness = np.full(len(lights), np.exp(log_nearness))
        small.follow(_placed(lights, center, size / nearness))
        for _ in range(STEPS):
            nearness = small.nearer(_placed(lights, center, size / nearness), nearness, size)
        tried[log_nearness] = small.spread(_placed(lights, center, size / nearness)), nearness
        return tried[log_nearness][0]

    bounds = np.log(start) + np.array([-1, 1]) * np.log(RANGE)
    minimize_scalar(trial, bounds=bounds, method="bounded", options={"maxiter": TRIALS})
    return min(tried.values(), key=lambda pair: pair[0])


def _placed(lights: Lights, center: Array, distance: Array) -> Lights:
    return replace(lights, positions_mm=center + distance[:, None] * lights.directions, reference_point_mm=center)


class _Small:
    """Every n-th pixel of the stack: its samples, and where they are."""

    def __init__(self, small: Problem) -> None:
        # What lay beside a clipped sample does not lie beside it here.
        self.problem = small = replace(small, frames=replace(small.frames, is_mosaic=False))
        self.mask, self.camera = small.mask, small.camera
        self.scale = scale_of(small)
        self.samples = all_samples(small)
        self.depth = small.depth_mm()
        self.z_mm = np.where(self.mask, self.depth, np.nan)
        self.some = np.flatnonzero(spread_over(np.ones(len(self.samples.gray), bool), SAMPLED))

    def _points(self) -> Array:
        return replace(self.problem, z_mm=self.z_mm).points()

    def center(self) -> Array:
        """Return the middle of the visible surface."""
        return self._points().mean(0)

    def size(self) -> float:
        """Return twice the root mean square of the surface's lateral distance from its middle."""
        return 2 * float(np.sqrt(np.sum(self._points()[:, :2].var(0))))

    def _fit(self, lights: Lights, chosen: NDArray | slice) -> tuple[Array, NDArray[np.bool_], Array]:
        samples = self.samples._replace(points=self._points(), lights=Geometry.of(lights)).some(chosen)
        b, used = iterative.fit(samples, self.scale, iterative.IterativeSettings())
        return b, used, samples.points

    def raise_relief(self, lights: Lights) -> None:
        """Let the normals under these lights make the relief."""
        normals = np.full((*self.mask.shape, 3), np.nan)
        normals[self.mask] = unit(self._fit(lights, slice(None))[0])
        if np.isfinite(normals[self.mask]).all(-1).any():
            z_mm = integrate(normals, self.camera, z_mm=self.depth).z_mm
            self.z_mm = np.where(self.mask, np.where(np.isfinite(z_mm), z_mm, self.depth), np.nan)

    def follow(self, lights: Lights) -> None:
        """Let `near_depth` make the relief."""
        found = find_depth(replace(self.problem, lights=lights), iterative.IterativeSettings()).z_mm
        assert found is not None
        self.z_mm = found

    def spread(self, lights: Lights) -> float:
        """Return the logarithm of the pixels' robust sigma, relative to their albedo: its mean."""
        b, used, points = self._fit(lights, self.some)
        shade = np.einsum("fpk,pk->pf", lights.toward(points), b)
        residuals = np.where(used, self.samples.gray[self.some] - shade, np.nan)
        count, albedo = used.sum(1), np.linalg.norm(b, axis=1)
        known = (count > 4) & (albedo > 0)
        sigma = np.nanmedian(np.abs(residuals[known]), 1) / albedo[known]
        sigma *= np.sqrt(count[known] / (count[known] - 3))
        return float(np.mean(np.log(np.maximum(sigma, 1e-6))))

    def nearer(self, lights: Lights, nearness: Array, size: float) -> Array:
        """Return the nearness (F,) of the lights after one step."""
        b, used, points = self._fit(lights, self.some)
        center, small = lights.reference_point_mm, 1e-3
        vectors = lights.toward(points).transpose(1, 0, 2)
        moved = _placed(lights, center, size / (nearness * (1 + small)))
        slope = (np.einsum("fpk,pk->pf", moved.toward(points), b) - np.einsum("pfk,pk->pf", vectors, b)) / small
        residuals = np.where(used, self.samples.gray[self.some] - np.einsum("pfk,pk->pf", vectors, b), 0.0)
        albedo = np.linalg.norm(b, axis=1)
        relative = residuals / np.maximum(albedo, 1e-9)[:, None]
        sigma = spread(relative[used]) + 1e-9
        weight = np.where(used, 1 / (1 + (relative / (2 * sigma)) ** 2) ** 2, 0.0)
        weight /= np.maximum(albedo, 1e-9)[:, None] ** 2
        block = np.swapaxes(vectors, 1, 2) @ (vectors * weight[..., None])
        third = np.maximum(np.trace(block, axis1=1, axis2=2) / 3, 1e-30)
        sound = (albedo > 0) & (np.linalg.det(block) > 1e-6 * third**3)
        slope, residuals = slope[sound], residuals[sound]
        pixels = Eliminated.of(vectors[sound], weight[sound], residuals)
        hessian = pixels.left_over(slope, slope)
        # What b cannot take up of the residuals pulls at the distances.
        unexplained = residuals - np.einsum("pfk,pk->pf", vectors[sound], pixels.b)
        gradient = np.einsum("pf,pf,pf->f", pixels.weight, slope, unexplained)
        pull = LOOSE * float(np.trace(hessian)) / len(nearness)
        logs = np.log(nearness)
        step = np.linalg.solve(hessian + pull * np.eye(len(nearness)), gradient + pull * (logs.mean() - logs))
        return np.clip(nearness * np.exp(np.clip(step, -0.3, 0.3)), 1e-3, 0.8)


def _prepare(problem: Problem, settings: iterative.IterativeSettings) -> Problem:
    problem = find_positions(problem)
    if problem.lights.positions_mm is None:
        return problem.warned("the lights have no positions: this is `iterative`.")
    return find_depth(problem, settings)


# The same turns about the plain reading of `iterative`. (The seed has no such method.)
METHOD = Method("near", iterative.METHOD.profiles, fit=iterative.fit, prepare=_prepare)

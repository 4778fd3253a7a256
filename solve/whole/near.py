"""Point lights and perspective: the depth of every pixel is found first, in turn with its normal, see `near_depth`."""

from solve.methods import Method
from solve.pixelwise import iterative
from solve.problem import Problem
from solve.samples import Samples
from solve.whole.light_distance import find_positions
from solve.whole.near_depth import Settings, find_depth


def _prepare(problem: Problem, settings: Settings) -> Problem:
    problem = find_positions(problem)
    if problem.lights.positions_mm is None:
        return problem.warned("the lights have no positions: this is `iterative`.")
    return find_depth(problem, settings)


def _fit(samples: Samples, scale: float, settings: Settings):
    return iterative.fit(samples, scale, settings.pixelwise)


# The same turns about the plain reading of `iterative`. (The seed has no such method.)
METHOD = Method("near", {"default": Settings(), "seed": Settings(iterative.SEED)}, fit=_fit, prepare=_prepare)

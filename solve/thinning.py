"""A problem of every n-th pixel."""

from dataclasses import replace

import numpy as np

from solve.problem import Problem


def step_for(problem: Problem, pixels: float) -> int:
    """Return n such that every n-th pixel leaves about so many of the mask."""
    return max(1, round(np.sqrt(np.count_nonzero(problem.mask) / pixels)))


def thinned(problem: Problem, step: int) -> Problem:
    """Return every n-th pixel of a whole problem: pixel u becomes u / n."""
    mask = np.ascontiguousarray(problem.mask[::step, ::step])
    depth = None if problem.z_mm is None else np.ascontiguousarray(problem.z_mm[::step, ::step])
    frames, camera = problem.frames.every(step), problem.camera.every(step)
    return replace(problem, frames=frames, camera=camera, mask=mask, rows=slice(0, len(mask)), z_mm=depth)

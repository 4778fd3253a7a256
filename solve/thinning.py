"""A problem of every n-th pixel, and its maps brought back to all pixels."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

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


def at_pixels(maps: NDArray, step: int, row: NDArray, column: NDArray) -> NDArray:
    """Return (P, k) of maps (h, w, k) of every `step`-th pixel, bilinear between those that are known (not NaN).

    NaN where none of the four about a pixel (row, column) is.
    """
    height, width = maps.shape[:2]
    (top, down), (left, right) = (np.divmod(place / step, 1.0) for place in (row, column))
    total, share = np.zeros((len(row), maps.shape[2])), np.zeros((len(row), maps.shape[2]))
    for below in (0, 1):
        for beside in (0, 1):
            y = np.minimum(top.astype(int) + below, height - 1)
            x = np.minimum(left.astype(int) + beside, width - 1)
            # Never quite 0: a pixel beside the only known one takes its value.
            weight = (np.abs(1 - below - down) + 1e-6) * (np.abs(1 - beside - right) + 1e-6)
            value = maps[y, x]
            known = np.isfinite(value)
            total += weight[:, None] * np.where(known, value, 0)
            share += weight[:, None] * known
    return np.divide(total, share, out=np.full_like(total, np.nan), where=share > 0)

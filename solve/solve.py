"""Run a method over a stack, band by band."""

import importlib
import os
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import nullcontext
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit

METHODS = ("ls", "iterative", "position", "l1", "sbl")
"""Calibrated methods, each a module of this folder with `SETTINGS` and `fit`."""


def solve(
    method: str,
    frames: Frames,
    lights: Lights,
    camera: Camera,
    mask: NDArray[np.bool_],
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Estimate:
    """Recover normals and albedo under the mask.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    frames : Frames
    lights : Lights
        Near lights are evaluated at each pixel's ray, at the depth of `lights.reference_point_mm`.
    camera : Camera
    mask : (H, W) bool
    executor : Executor, optional
        Runs the row bands. Default: threads, one a core (the kernels release the interpreter).
    progress : callable, optional
        Called with (bands done, bands).

    Returns
    -------
    Estimate
        NaN outside the mask and where the lit lights do not span space.

    Raises
    ------
    SceneError
        Unknown method, empty mask, sizes that differ.
    CalibrationError
        Fewer than three lights, or coplanar lights.
    """
    if method not in METHODS:
        raise SceneError(f"solve: unknown method {method!r}; there are {', '.join(METHODS)}.")
    if mask.shape != (frames.height, frames.width):
        raise SceneError(
            f"solve: the mask is {mask.shape[1]} x {mask.shape[0]} px, the frames are {frames.width} x {frames.height}."
        )
    if not mask.any():
        raise SceneError("solve: the object's mask is empty. Give one under [object] mask in session.toml.")
    lights.check()
    from solve.samples import bands, scale_of

    _compile(method, frames, lights, camera, mask)
    start = time.perf_counter()
    scale = scale_of(frames, lights, mask)
    normals = np.full((*mask.shape, 3), np.nan, np.float32)
    albedo = np.full((*mask.shape, 3), np.nan, np.float32)
    samples = np.zeros(mask.shape, np.uint16)
    parts = list(bands(frames, mask))
    workers = os.cpu_count() or 1
    with nullcontext(executor) if executor else ThreadPoolExecutor(workers) as pool:
        assert pool is not None
        # A window of bands at a time: results that wait for their turn would add up to another set of maps.
        waiting: set[Future] = set()
        todo = iter(parts)
        done = 0
        try:
            while True:
                for rows in islice(todo, 2 * workers - len(waiting)):
                    band = mask[rows]
                    waiting.add(pool.submit(_solve_band, method, frames, lights, camera, band, rows, scale))
                if not waiting:
                    break
                finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                while finished:
                    rows, n, a, used = finished.pop().result()
                    inside = mask[rows]
                    normals[rows][inside], albedo[rows][inside], samples[rows][inside] = n, a, used
                    done += 1
                    if progress:
                        progress(done, len(parts))
        except BaseException:
            for future in waiting:
                future.cancel()
            raise
    settings = dict(importlib.import_module(f"solve.{method}").SETTINGS)
    return Estimate(
        method,
        normals,
        albedo,
        samples,
        time.perf_counter() - start,
        settings,
        _doubts(mask, normals, samples),
    )


def _compile(method, frames, lights, camera, mask) -> None:
    """Solve one pixel, so that compiling the kernels does not count as the method's time."""
    row, column = np.unravel_index(int(mask.argmax()), mask.shape)
    one = np.zeros((1, mask.shape[1]), bool)
    one[0, column] = True
    _solve_band(method, frames, lights, camera, one, slice(int(row), int(row) + 1), 1.0)


def _solve_band(method, frames, lights, camera, mask, rows, scale):
    """Return the rows, and normals, albedo and sample counts of the pixels of their mask (h, W), in its order."""
    from solve.kernels import albedo_given_normal
    from solve.samples import read_samples

    module = importlib.import_module(f"solve.{method}")
    part = read_samples(frames, lights, camera, mask, rows)
    is_near = lights.positions_mm is not None
    positions = lights.positions_mm if is_near else np.zeros_like(lights.directions)
    reach = np.sum((positions - lights.reference_point_mm) ** 2, 1)
    geometry = (lights.directions, positions, reach, is_near)
    b, used = module.fit(part.gray, part.valid, part.points, *geometry, scale, **module.SETTINGS)
    normals = unit(b)
    albedo = albedo_given_normal(part.color, used, part.points, normals, *geometry, lights.intensities)
    count = np.where(np.isfinite(normals[:, 0]), used.sum(1), 0)
    return rows, normals.astype(np.float32), albedo, count.astype(np.uint16)


def _doubts(mask: NDArray[np.bool_], normals: NDArray, samples: NDArray) -> tuple[str, ...]:
    """Say why the result should not be believed, before the error is known."""
    inside = int(mask.sum())
    unknown = np.count_nonzero(mask & ~np.isfinite(normals[..., 0])) / inside
    few = np.count_nonzero(mask & (samples == 3)) / inside
    away = np.count_nonzero(mask & (normals[..., 2] < 0)) / inside
    doubts = []
    if unknown > 0.01:
        doubts.append(f"{unknown:.0%} of the object's pixels have no normal: their lit lights do not span space.")
    if few > 0.05:
        doubts.append(f"{few:.0%} of the object's pixels rest on three samples: nothing there checks the fit.")
    if away > 0.02:
        doubts.append(
            f"{away:.0%} of the normals point away from the camera: light directions, mask or linearity are in doubt."
        )
    return tuple(doubts)

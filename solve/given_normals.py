"""A normal map that another program found, judged as a method of ours is: albedo, samples, sigma, cautions."""

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from solve.axes import Axes, find_axes, some_pixels
from solve.external import External, normals_by
from solve.medians import row_medians
from solve.methods import Method, Whole
from solve.problem import Problem
from solve.samples import Samples
from solve.solve import solve

_FACING = 0.1
"""Cosine under which a sample says nothing of the albedo."""
_DARK = 0.02
_SIGMAS = 2.5
_FLOOR = 0.004
_BLOCK = 1 << 14


def solve_external(
    external: External,
    frames: Frames,
    lights: Lights,
    camera: Camera,
    mask: NDArray[np.bool_],
    folder: Path,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Estimate:
    """Let another program find the normals.

    `folder` is where the program reads and writes, see `external.normals_by`; all else is as in `solve.solve.solve`.

    Returns
    -------
    Estimate
        In the camera frame: the axes in which the program writes are found by the photographs, and named in the
        settings. Albedo and sigma are those of Lambert's law under its normals.

    Raises
    ------
    SceneError
        The program fails, or no axes explain the photographs.
    """
    start = time.perf_counter()
    lights.check()
    found = normals_by(external, frames, lights, mask, folder)[mask]
    name = f"--external {external.name}"
    used_axes: list[Axes] = []

    def fit(_problem: Problem, samples: Samples, _settings: tuple) -> Whole:
        whole, axes = _judge_given(found, samples, name)
        used_axes.append(axes)
        return whole

    method = Method(external.name, {"default": NoSettings()}, fit_whole=fit)
    estimate = solve(method, frames, lights, camera, mask, executor=executor, progress=progress)
    settings = {"command": external.command, "timeout_s": external.timeout_s, "axes": str(used_axes[0])}
    return replace(estimate, seconds=time.perf_counter() - start, settings=settings)


class NoSettings(NamedTuple):
    """A method without any."""


def _judge_given(normals: NDArray[np.float64], samples: Samples, name: str) -> tuple[Whole, Axes]:
    """Return normals (P, 3), known already, with their albedo; and the axes that they turned out to be in."""
    known = np.isfinite(normals[:, 0])
    axes = find_axes(normals[some := some_pixels(known)], samples.some(some), name=name)
    normals = np.where(known[:, None], normals, 0) @ axes.matrix.T
    scale = samples.scale()
    b, used = np.zeros(normals.shape), np.zeros(samples.gray.shape, bool)
    for first in range(0, len(b), _BLOCK):
        part = slice(first, first + _BLOCK)
        albedo, used[part] = _albedo(samples.some(part), normals[part], scale)
        b[part] = albedo[:, None] * normals[part]
    return Whole(b, used, axes.cautions), axes


def _albedo(samples: Samples, normals: NDArray, scale: float) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return the median ratio of sample to shading (P,), and the samples (P, F) that agree with it.

    A pixel without any lit sample keeps its normal: its albedo is the least that is not zero.
    """
    gray, valid = samples.gray, samples.valid
    shade = np.einsum("pfi,pi->pf", samples.toward(), normals)
    facing = valid & (shade > _FACING) & (gray > _DARK * scale)
    ratio = row_medians(gray / np.where(facing, shade, 1), facing)
    residual = np.abs(gray - ratio[:, None] * shade)
    spread = np.maximum(1.4826 * row_medians(residual, facing), _FLOOR * scale)
    return np.maximum(ratio, 1e-9 * scale), facing & (residual <= _SIGMAS * spread[:, None])

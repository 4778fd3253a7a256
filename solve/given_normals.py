"""A normal map that another program found, judged as a method of ours is: albedo, samples, sigma, cautions."""

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.clock import now, since
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from scene.robust import MAD
from solve.assess import DARK, FACING
from solve.axes import PIXELS, find_axes, relief_cautions
from solve.external import External, normals_by
from solve.methods import NO_SETTINGS, Method, Whole
from solve.pixelwise.iterative import IterativeSettings
from solve.plausible_axes import AXES, axes_words, plausible_axes
from solve.problem import Problem, spread_over
from solve.samples import Geometry, Samples, row_medians
from solve.solve import solve
from solve.uncalibrated.front_end import lights_of

_BLOCK = 1 << 14
_ROUNDS = 10


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
        settings; under unknown lights by the map itself. Albedo and sigma are those of Lambert's law under its normals,
        and under unknown lights these are found with them.

    Raises
    ------
    SceneError
        The program fails, or no axes explain the photographs.
    """
    start = now()
    if not lights.is_unknown:
        lights.check()
    found = normals_by(external, frames, lights, mask, folder)
    name = f"--external {external.name}"
    used_axes: list[str] = []

    def fit(_problem: Problem, samples: Samples, _settings: tuple) -> Whole:
        given = found[mask]
        if lights.is_unknown:
            # No light tells better than the map itself, in which axes it is a surface that faces the camera.
            axes = AXES[plausible_axes(found, mask).by_rim]
            said = (
                f"its axes are taken as {axes_words(axes)}, in which it is a surface that faces the camera: the lights "
                "are unknown and do not tell. It may be inverted, convex for concave."
            )
            whole = _with_lights_of_its_own(given @ axes.T, samples, (said,))
        else:
            some = spread_over(np.isfinite(given[:, 0]), PIXELS)
            axes, cautions = find_axes(given[some], samples.some(some), name=name)
            whole = with_lambertian_albedo(given @ axes.T, samples, cautions)
        used_axes.append(axes_words(axes))
        return whole

    method = Method(external.name, {"default": NO_SETTINGS}, fit_whole=fit, is_calibrated=not lights.is_unknown)
    estimate = solve(method, frames, lights, camera, mask, executor=executor, progress=progress)
    cautions = (*estimate.warnings, *relief_cautions(estimate.normals, frames, lights, camera, mask))
    settings = {"command": external.command, "timeout_s": external.timeout_s, "axes": used_axes[0]}
    return replace(estimate, **since(start), settings=settings, warnings=cautions)


def with_lambertian_albedo(normals: NDArray[np.float64], samples: Samples, cautions: tuple[str, ...]) -> Whole:
    """Return normals (P, 3), known already, camera frame, with their albedo: the median ratio of sample to shading.

    Used are the samples that agree with it. A pixel without any lit sample keeps its normal: its albedo is the least
    that is not zero.
    """
    b, used = np.where(np.isfinite(normals[:, :1]), normals, 0), np.zeros(samples.gray.shape, bool)
    scale, how = samples.scale(), IterativeSettings()
    for first in range(0, len(b), _BLOCK):
        part = slice(first, first + _BLOCK)
        gray, valid, *_ = some = samples.some(part)
        shade = np.einsum("pfi,pi->pf", some.toward(), b[part])
        facing = valid & (shade > FACING) & (gray > DARK * scale)
        ratio = row_medians(gray / np.where(facing, shade, 1), facing)
        residual = np.abs(gray - ratio[:, None] * shade)
        spread = np.maximum(MAD * row_medians(residual, facing), how.noise_floor * scale)
        used[part] = facing & (residual <= how.outlier_sigmas * spread[:, None])
        b[part] *= np.maximum(ratio, 1e-9 * scale)[:, None]
    return Whole(b, used, cautions)


def _with_lights_of_its_own(normals: NDArray[np.float64], samples: Samples, cautions: tuple[str, ...]) -> Whole:
    """Return normals (P, 3), camera frame, with albedo and the lights that explain the photographs under them.

    Notes
    -----
    value = albedo * max(0, l . n): least squares for each l over pixels that it lights, and each pixel's median ratio
    for its albedo, in turn.
    """
    some = spread_over(np.isfinite(normals[:, 0]), PIXELS)
    few, n, scale = samples.some(some), normals[some], samples.scale()
    lit = few.valid & (few.gray > DARK * scale)
    albedo = np.maximum(np.quantile(np.where(lit, few.gray, 0), 0.9, axis=1), 1e-9 * scale)
    lights = np.zeros((few.gray.shape[1], 3))
    for _ in range(_ROUNDS):
        lights = lights_of(few.gray, lit, albedo[:, None] * n)
        shade = n @ lights.T
        lit = few.valid & (shade > FACING * np.linalg.norm(lights, axis=1)) & (few.gray > DARK * scale)
        albedo = np.maximum(row_medians(few.gray / np.where(lit, shade, 1), lit), 1e-9 * scale)
    lights /= max(float(np.mean(np.linalg.norm(lights, axis=1))), 1e-12)
    whole = with_lambertian_albedo(normals, samples._replace(lights=Geometry.distant(lights)), cautions)
    return replace(whole, lights=lights)

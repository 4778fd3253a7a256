"""A normal map that another program found, judged as a method of ours is: albedo, samples, sigma, doubts."""

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from solve.axes import find_axes, some_pixels
from solve.external import External, normals_by
from solve.medians import row_medians
from solve.solve import solve
from solve.whole_result import Whole, scale_of_samples

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

    Parameters
    ----------
    external : External
    frames, lights, camera, mask, executor, progress
        As in `solve.solve.solve`.
    folder : Path
        Where the program reads and writes; see `external.normals_by`.

    Returns
    -------
    Estimate
        In the camera frame: the axes in which the program writes are told by the photographs, and named in the
        settings. Albedo and sigma are those of Lambert's law under its normals.

    Raises
    ------
    SceneError
        The program fails, or no axes explain the photographs.
    """
    start = time.perf_counter()
    lights.check()
    found = normals_by(external, frames, lights, mask, folder)
    fit = _Given(external, found[mask])
    estimate = solve(external.name, frames, lights, camera, mask, module=fit, executor=executor, progress=progress)
    return replace(estimate, seconds=time.perf_counter() - start, settings=fit.SETTINGS)


@dataclass
class _Given:
    """What `solve` takes for a module: normals (P, 3) that are known already, in axes that are not."""

    external: External
    normals: NDArray[np.float64]
    WHOLE: bool = True
    SETTINGS: dict[str, Any] = field(default_factory=dict)

    def fit_whole(self, gray, valid, points, geometry, mask, **settings) -> Whole:
        known = np.isfinite(self.normals[:, 0])
        some = some_pixels(known)
        toward = _toward(points[some], *geometry)
        axes = find_axes(self.normals[some], gray[some], valid[some], toward, name=f"--external {self.external.name}")
        self.SETTINGS |= {
            "command": self.external.command, "timeout_s": self.external.timeout_s, "axes": str(axes)
        }  # fmt: skip
        normals = np.where(known[:, None], self.normals, 0) @ axes.matrix.T
        scale = scale_of_samples(gray, valid)
        b, used = np.zeros(normals.shape), np.zeros(gray.shape, bool)
        for first in range(0, len(gray), _BLOCK):
            part = slice(first, first + _BLOCK)
            shade = np.einsum("pfi,pi->pf", _toward(points[part], *geometry), normals[part])
            albedo, used[part] = _albedo(gray[part], valid[part], shade, scale)
            b[part] = albedo[:, None] * normals[part]
        return Whole(b, used, axes.doubts)


def _toward(points, directions, positions, reach, is_near) -> NDArray[np.float64]:
    """Return the light vectors (P, F, 3) at points (P, 3); see `Lights.toward`."""
    if not is_near:
        return np.broadcast_to(directions, (len(points), *directions.shape))
    arm = positions - points[:, None]
    return arm * (reach / np.linalg.norm(arm, axis=-1) ** 3)[..., None]


def _albedo(gray, valid, shade, scale) -> tuple[NDArray, NDArray[np.bool_]]:
    """Return the median ratio of sample to shading (P,), and the samples (P, F) that agree with it.

    A pixel without any lit sample keeps its normal: its albedo is the least that is not zero.
    """
    facing = valid & (shade > _FACING) & (gray > _DARK * scale)
    ratio = row_medians(gray / np.where(facing, shade, 1), facing)
    residual = np.abs(gray - ratio[:, None] * shade)
    spread = np.maximum(1.4826 * row_medians(residual, facing), _FLOOR * scale)
    return np.maximum(ratio, 1e-9 * scale), facing & (residual <= _SIGMAS * spread[:, None])

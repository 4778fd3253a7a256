"""Run a method over a stack, band by band."""

import importlib
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import nullcontext
from itertools import islice
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights

UNCALIBRATED = ("ldr", "entropy", "tv")  # they know the intensities, where those were calibrated, and no more
FOLDERS = {
    "pixelwise": ("ls", "iterative", "position", "l1", "sbl", "hsh"),
    "whole": ("rpca", "semicalibrated", "near", "reflectance"), "uncalibrated": UNCALIBRATED,
}  # fmt: skip
METHODS = tuple(name for names in FOLDERS.values() for name in names)
"""Each a module with `SETTINGS`, `SEED_SETTINGS` and `fit`, or `fit_whole` where it says `WHOLE`.

One with VIEWS is given the unit vectors toward the camera, too. A module with `find_lights` corrects the lights first:
fit, albedo and sigma are under those. One with POSITIONS is given positions for lights that have none, where the
object tells them (`solve.whole.light_distance`). One with `find_depth` finds each pixel's depth first: they are there.
"""


def solve(
    method: str,
    frames: Frames,
    lights: Lights,
    camera: Camera,
    mask: NDArray[np.bool_],
    *,
    profile: str = "default",
    module: Any = None,
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
    profile : str
        `default`: what serves best. `seed`: the plain reading of the benchmark's text, where a method breaks as it
        breaks there [Berkiten2016]. A method may have more: every NAME_SETTINGS of its module is one.
    module : optional
        What fits, when it is no method of ours: has WHOLE, SETTINGS and `fit_whole`; see `solve.given_normals`.
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
        Unknown method or profile, empty mask, sizes that differ.
    CalibrationError
        Fewer than three lights, or coplanar lights.
    """
    if module is None and method not in METHODS:
        raise SceneError(f"solve: unknown method {method!r}; there are {', '.join(METHODS)}.")
    if mask.shape != (frames.height, frames.width):
        raise SceneError(
            f"solve: the mask is {mask.shape[1]} x {mask.shape[0]} px, the frames are {frames.width} x {frames.height}."
        )
    if not mask.any():
        raise SceneError("solve: the object's mask is empty. Give one under [object] mask in session.toml.")
    settings = settings_of(method, profile) if module is None else dict(module.SETTINGS)
    module = module or _module(method)
    if getattr(module, "CALIBRATED", True):
        lights.check()
    from solve.cautions import doubts
    from solve.samples import bands, scale_of

    said = module.doubts(lights.directions, **settings) if hasattr(module, "doubts") else ()
    if not getattr(module, "WHOLE", False):
        _compile(method, settings, frames, lights, camera, mask)
    start = time.perf_counter()
    own_lights = None
    if hasattr(module, "find_lights"):
        own_lights, more = module.find_lights(frames, lights, camera, mask, **settings)
        lights, said = own_lights, (*said, *more)
    if getattr(module, "POSITIONS", False) and lights.positions_mm is None:
        from solve.whole.light_distance import find_positions

        placed, more = find_positions(frames, lights, camera, mask)
        said = (*said, *more)
        if placed.positions_mm is not None:
            lights = own_lights = placed
    z_mm = None
    if hasattr(module, "find_depth"):
        z_mm, more = module.find_depth(frames, lights, camera, mask, **settings)
        said = (*said, *more)
    parts = list(bands(frames, mask))
    maps = _empty_maps(mask.shape)
    work: Iterator[tuple[Callable, tuple]]
    if getattr(module, "WHOLE", False):
        found, gray, geometry = _fit_whole(module, settings, frames, lights, camera, mask, parts, z_mm)
        said += found.doubts
        if found.lights is not None:
            own_lights = _own_lights(lights, found.lights)
        work = _judgements(frames, lights, camera, mask, parts, found, gray, geometry, z_mm)
    else:
        scale = scale_of(frames, lights, mask)
        task = (method, settings, frames, lights, camera)
        depth = {} if z_mm is None else {rows.start: z_mm[rows] for rows in parts}
        work = ((_solve_band, (*task, mask[rows], rows, scale, depth.get(rows.start))) for rows in parts)
    dark = 0
    with nullcontext(executor) if executor else ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        assert pool is not None
        for done, (rows, values) in enumerate(_finished(pool, work), 1):
            inside = mask[rows]
            for place, value in zip(maps, values, strict=False):
                if inside.all():
                    # Four times faster than by the mask.
                    place[rows] = value.reshape(place[rows].shape)
                else:
                    place[rows][inside] = value
            dark += int(np.count_nonzero(values[-1]))
            if progress:
                progress(done, len(parts))
    normals, albedo, samples, condition, sigma_deg = maps
    seconds = time.perf_counter() - start
    said += doubts(mask, normals, samples, condition, dark)
    return Estimate(method, normals, albedo, samples, seconds, settings, said, condition, sigma_deg, own_lights, z_mm)


def settings_of(method: str, profile: str) -> dict[str, Any]:
    """Return the settings of a method's profile.

    Raises
    ------
    SceneError
        The method has no such profile.
    """
    module = _module(method)
    named = {"default": "SETTINGS"} | {
        name.removesuffix("_SETTINGS").lower(): name for name in vars(module) if name.endswith("_SETTINGS")
    }
    if profile not in named:
        raise SceneError(f"solve: {method} has no profile {profile!r}; there are {', '.join(named)}.")
    return dict(getattr(module, named[profile]))


def _module(method: str) -> ModuleType:
    return importlib.import_module(f"solve.{next(key for key, names in FOLDERS.items() if method in names)}.{method}")


def _empty_maps(shape: tuple[int, ...]) -> tuple[NDArray, ...]:
    """Return normals, albedo, samples, condition and sigma with nothing known yet."""
    return (
        np.full((*shape, 3), np.nan, np.float32),
        np.full((*shape, 3), np.nan, np.float32),
        np.zeros(shape, np.uint16),
        np.full(shape, np.nan, np.float32),
        np.full(shape, np.nan, np.float32),
    )


def _compile(method, settings, frames, lights, camera, mask) -> None:
    """Solve one pixel, so that compiling the kernels does not count as the method's time."""
    row, column = np.unravel_index(int(mask.argmax()), mask.shape)
    one = np.zeros((1, mask.shape[1]), bool)
    one[0, column] = True
    _solve_band(method, settings, frames, lights, camera, one, slice(int(row), int(row) + 1), 1.0)


def _finished(pool: Executor, work: Iterator[tuple[Callable, tuple]]) -> Iterator[Any]:
    """Run the calls and yield their results as they come.

    A window of calls at a time: results that wait for their turn would add up to another set of maps.
    """
    waiting: set[Future] = set()
    try:
        while True:
            for call, arguments in islice(work, 2 * (os.cpu_count() or 1) - len(waiting)):
                waiting.add(pool.submit(call, *arguments))
            if not waiting:
                return
            finished, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            while finished:
                yield finished.pop().result()
    except BaseException:
        for future in waiting:
            future.cancel()
        raise


def _solve_band(method, settings, frames, lights, camera, mask, rows, scale, z_mm=None):
    """Return the rows, and what `assess` returns of the pixels of their mask (h, W), in its order."""
    from solve.samples import points_of, read_band

    module = _module(method)
    band = read_band(frames, mask, rows)
    streamed = module.stream(band, lights, scale, **settings) if hasattr(module, "stream") else None
    if streamed is None:
        points = points_of(camera, lights, mask, rows, z_mm)
        return rows, _fit_and_judge(module, settings, band, points, lights, scale)
    *values, left = streamed
    if left.any():
        points = points_of(camera, lights, mask, rows, z_mm)
        rest = _fit_and_judge(module, settings, band.only(left), points[left], lights, scale)
        for value, more in zip(values, rest, strict=False):
            value[left] = more
        left[left] = rest[-1]
    return rows, (*values, left)


def _fit_and_judge(module, settings, band, points, lights, scale):
    """Return what `assess` returns of the pixels of a band."""
    from solve.samples import GRAY, Geometry

    geometry = Geometry.of(lights)
    gray, valid = band.gray((GRAY / lights.intensities).astype(np.float32))
    b, used = module.fit(gray, valid, points, *geometry, scale, **settings)
    return _judge(band, gray, b, used, points, geometry, lights.intensities, scale)


def _judge(band, gray, b, used, points, geometry, intensities, scale):
    """Return normals, albedo, samples, condition, sigma and darkness of the pixels of a band; see `assess`."""
    from solve.assess import DARK, assess

    store: tuple = (band.codes, band.shape, band.ambient, band.black, band.unit, band.runs)
    rest: tuple = (gray, b, used, points, *geometry, np.ascontiguousarray(intensities), DARK * scale)
    return assess(*store, *rest)


def _fit_whole(module: ModuleType, settings, frames, lights, camera, mask, parts, z_mm):
    """Fit a method that looks at all pixels at once; return its `Whole`, the samples, and the lights' geometry."""
    from solve.samples import GRAY, Geometry, points_of, read_band

    calibrated = getattr(module, "CALIBRATED", True)
    weights = GRAY / lights.intensities
    total, done = int(mask.sum()), 0
    gray, valid = np.empty((total, len(frames)), np.float32), np.empty((total, len(frames)), bool)
    for rows in parts:
        some, good = read_band(frames, mask[rows], rows).gray(weights.astype(np.float32))
        gray[done : done + len(some)], valid[done : done + len(some)] = some, good
        done += len(some)
    points = points_of(camera, lights, mask, slice(0, len(mask)), z_mm)
    geometry = Geometry.of(lights) if calibrated else None
    if getattr(module, "VIEWS", False):
        row, column = np.nonzero(mask)
        settings = {**settings, "views": -camera.rays(np.stack([column, row], -1))[1]}
    found = module.fit_whole(gray, valid, points, None if geometry is None else tuple(geometry), mask, **settings)
    return found, gray, geometry or Geometry.distant(found.lights)


def _own_lights(lights: Lights, found: NDArray[np.float64]) -> Lights:
    """Return the lights that a method recovered: (F, 3), direction times what the calibrated intensities leave over.

    A light of no strength has no direction: NaN.
    """
    strength = np.linalg.norm(found, axis=1, keepdims=True)
    directions = np.divide(found, strength, out=np.full_like(found, np.nan), where=strength > 0)
    return Lights(lights.names, directions, lights.intensities * strength).normalised()


def _judgements(frames, lights, camera, mask, parts, found, gray, geometry, z_mm):
    """Yield the call that judges each band of a method that has fitted all pixels at once."""
    from solve.whole_result import scale_of_samples

    scale = scale_of_samples(gray, np.isfinite(gray))
    done = 0
    for rows in parts:
        some = slice(done, done + int(np.count_nonzero(mask[rows])))
        done = some.stop
        rest = (geometry, lights.intensities, scale, None if z_mm is None else z_mm[rows])
        yield (
            _judge_band,
            (frames, lights, camera, mask[rows], rows, gray[some], found.b[some], found.used[some], *rest),
        )


def _judge_band(frames, lights, camera, mask, rows, gray, b, used, geometry, intensities, scale, z_mm):
    from solve.samples import points_of, read_band

    band, points = read_band(frames, mask, rows), points_of(camera, lights, mask, rows, z_mm)
    return rows, _judge(band, gray, np.nan_to_num(b), used, points, geometry, intensities, scale)

"""Run a method over a stack, band by band."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import nullcontext
from dataclasses import replace
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.clock import now, since
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import unit
from solve.methods import Method, Settings, Whole, method_of
from solve.problem import Problem

# Kernels are loaded where they are called: a sweep names its cells without them.
if TYPE_CHECKING:
    from solve.samples import Band, Samples

Call = tuple[Callable, tuple]


def solve(
    method: str | Method,
    frames: Frames,
    lights: Lights,
    camera: Camera,
    mask: NDArray[np.bool_],
    *,
    profile: str = "default",
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Estimate:
    """Recover normals and albedo under the mask.

    Parameters
    ----------
    method : str or Method
        One of `scene.method_names`; or one that is not in the table, with `fit_whole`, as in `solve.given_normals`.
    frames : Frames
    lights : Lights
        Near lights are evaluated at each pixel's ray, at the depth of `lights.reference_point_mm`.
    camera : Camera
    mask : (H, W) bool
    profile : str
        See `solve.methods.Method`.
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
    from solve.samples import bands, scale_of

    what = method if isinstance(method, Method) else method_of(method)
    if mask.shape != (frames.height, frames.width):
        raise SceneError(
            f"solve: the mask is {mask.shape[1]} x {mask.shape[0]} px, the frames are {frames.width} x {frames.height}."
        )
    if not mask.any():
        raise SceneError("solve: the object's mask is empty. Give one under [object] mask in session.toml.")
    settings = what.settings(profile)
    if what.is_calibrated:
        lights.check()
    problem = Problem.of(frames, lights, camera, mask)
    if what.fit:
        _compile(what, settings, problem)
    start = now()
    problem = what.prepare(problem, settings) if what.prepare else problem
    rows_of = list(bands(frames, mask))
    if what.fit_whole:
        problem, work = _fit_whole(what.fit_whole, settings, problem, rows_of, what.is_calibrated)
    else:
        scale = scale_of(problem)
        work = ((_fit_band, (what.name, settings, problem.part(rows), scale)) for rows in rows_of)
    # Nothing is known yet of normals, albedo, samples and sigma.
    normals, albedo = (np.full((*mask.shape, 3), np.nan, np.float32) for _ in range(2))
    maps = normals, albedo, np.zeros(mask.shape, np.uint16), np.full(mask.shape, np.nan, np.float32)
    doubts = np.zeros(2, int)
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
            doubts += values[-1]
            if progress:
                progress(done, len(rows_of))
    _, _, samples, sigma_deg = maps
    if what.fit and not what.is_linear:
        from solve.bootstrap import sigma_factors

        sigma_deg *= sigma_factors(problem, what.fit, settings)[samples]
    if problem.intensity_covariance is not None:
        from solve.assess import shared_sigma_deg

        shared = shared_sigma_deg(normals, problem.lights.directions, problem.intensity_covariance)
        sigma_deg = np.hypot(sigma_deg, shared)
    spent = since(start)
    cautions = (*problem.cautions, *_cautions_of(mask, normals, samples, *doubts.tolist()))
    if not what.is_calibrated:
        from solve.axes import relief_cautions

        cautions += relief_cautions(normals, frames, lights, camera, mask)
    return Estimate(
        what.name, normals, albedo, samples, spent["seconds"], spent["processor_seconds"], settings._asdict(), cautions,
        sigma_deg, problem.own_lights, problem.z_mm,
    )  # fmt: skip


def _finished(pool: Executor, work: Iterator[Call]) -> Iterator[Any]:
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


def _compile(what: Method, settings: Settings, problem: Problem) -> None:
    """Solve one pixel, so that compiling the kernels does not count as the method's time."""
    row, column = np.unravel_index(int(problem.mask.argmax()), problem.mask.shape)
    one = np.zeros((1, problem.mask.shape[1]), bool)
    one[0, column] = True
    _fit_band(what.name, settings, replace(problem, mask=one, rows=slice(int(row), int(row) + 1)), 1.0)


def _fit_band(name: str, settings: Settings, part: Problem, scale: float) -> tuple[slice, tuple]:
    """Fit the pixels of a problem's rows; see `_judge_band`."""
    from solve.samples import read_band, samples_of

    what, band = method_of(name), read_band(part)
    assert what.fit
    samples = samples_of(band, part)
    b, used = what.fit(samples, scale, settings)
    return _judge_band(part, samples._replace(valid=used), b, scale, band=band)


def _fit_whole(
    fit: Callable[[Problem, "Samples", Settings], Whole], settings: Settings, problem: Problem, rows_of: list[slice],
    is_calibrated: bool,
) -> tuple[Problem, Iterator[Call]]:  # fmt: skip
    """Fit all pixels; return the problem with what was found, and the call that judges each band."""
    from solve.samples import Geometry, all_samples

    lights = problem.lights
    if not is_calibrated:
        nowhere = np.full_like(lights.directions, np.nan)
        problem = replace(problem, lights=replace(lights, directions=nowhere, positions_mm=None))
    parts, samples = [problem.part(rows) for rows in rows_of], all_samples(problem)
    found = fit(problem, samples, settings)
    scale = samples._replace(valid=np.isfinite(samples.gray)).scale()
    used = samples._replace(valid=found.used)
    if found.lights is not None:
        used = used._replace(lights=Geometry.distant(found.lights))
        # What the calibrated intensities leave over. A light of no strength has no direction: NaN.
        strength = np.linalg.norm(found.lights, axis=1, keepdims=True)
        own = Lights(lights.names, unit(found.lights), lights.intensities * strength).normalised()
        problem = replace(problem, own_lights=own)

    def calls() -> Iterator[Call]:
        done = 0
        for part in parts:
            some = slice(done, done + int(np.count_nonzero(part.mask)))
            done = some.stop
            own = tuple(None if each is None else each[some] for each in (found.shade, found.sigma_deg))
            yield _judge_band, (part, used.some(some), np.nan_to_num(found.b[some]), scale, *own)

    return problem.warned(*found.cautions), calls()


def _judge_band(
    part: Problem,
    used: "Samples",
    b: NDArray,
    scale: float,
    shade: NDArray | None = None,
    sigma_deg: NDArray | None = None,
    band: "Band | None" = None,
) -> tuple[slice, tuple]:
    """Return the rows, and what `assess` returns of the pixels of their mask, in its order."""
    from solve.assess import DARK, assess
    from solve.samples import read_band

    shade, intensities = np.zeros((0, 0)) if shade is None else shade, np.ascontiguousarray(part.lights.intensities)
    *maps, sigma, doubts = assess(band or read_band(part), used, b, intensities, DARK * scale, shade)
    if sigma_deg is not None:
        # Its samples are not held to what Lambert's law needs of them.
        sigma, doubts = sigma_deg.astype(np.float32), 0 * doubts
    return part.rows, (*maps, sigma, doubts)


def _cautions_of(mask: NDArray[np.bool_], normals: NDArray, samples: NDArray, dark: int, flat: int) -> tuple[str, ...]:
    """Return what is suspicious about the maps (H, W[, 3]) of an estimate, said before its error is known.

    `dark` and `flat`: see `solve.assess.assess`; for the maps see `scene.estimate.Estimate`.
    """
    shares = (
        (~np.isfinite(normals[..., 0]), 0.01, "pixels have no normal: their lit lights do not span space."),
        (dark, 0.01, "pixels have fewer than three lit samples: not to be believed."),
        (samples == 3, 0.05, "pixels rest on three samples: nothing there checks the fit."),
        (
            flat, 0.05,
            "pixels are lit from nearly one plane: noise is amplified there. Lights from more sides would help.",
        ),
        (
            normals[..., 2] < 0, 0.02,
            "normals point away from the camera: light directions, mask or linearity are in doubt.",
        ),
    )  # fmt: skip
    told = [(np.sum(which & mask if np.ndim(which) else which) / mask.sum(), bar, text) for which, bar, text in shares]
    return tuple(f"{share:.0%} of the object's {text}" for share, bar, text in told if share > bar)

"""`--self-test`: render the calibrated balls, calibrate the rendering, hold the errors against the stated sigmas.

The truth is what was calibrated, so this says nothing of how true that is. It says what this code makes of balls of
this size and place under such flashes with such noise, and whether its sigmas are honest there.
"""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.job import Job, Outcome
from lab.progress import progress_bar
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.files import write_json
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere, SphereRequest
from scene.store import Store

FOLDER = "self_test"
CHI2_95 = {1: 3.841, 2: 5.991, 3: 7.815}
"""95 % of a chi-squared variable with so many degrees of freedom lie below."""
DISHONEST = 0.75
"""Share of lights inside their 95 % region below which the sigmas are called too small: of 12 lights that are honest,
fewer than 9 are inside once in 500 times."""


def self_test(job: Job) -> Outcome:
    """Render the calibrated balls with noise, calibrate the rendering, compare."""
    store = job.store
    camera, spheres, lights = store.load_camera(), store.load_spheres(), store.load_lights()
    if not spheres:
        raise SceneError(
            "--self-test: this session has no ball that was found, so there is nothing to render. State balls under "
            "[[spheres]], or leave --self-test out."
        )
    folder = job.record.scratch(FOLDER)
    shutil.rmtree(folder, ignore_errors=True)
    try:
        with progress_bar("self-test: render") as progress:
            frames, requests = _photographed(job, folder, camera, spheres, lights, progress)
        result, warnings = _recalibrated(frames, camera, requests, lights, spheres)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    write_json(store.path("self_test.json"), result)
    return Outcome({key: value for key, value in result.items() if key != "lights"}, warnings)


def _photographed(
    job: Job,
    folder: Path,
    camera: Camera,
    spheres: Sequence[Sphere],
    lights: Lights,
    progress: Callable[[int, int], None],
) -> tuple[Frames, list[SphereRequest]]:
    """Return the rendering's frames, decoded from files as photographs are, and what balls to look for in them."""
    from capture.photographs.decode import decode
    from capture.session.session_types import Session
    from twin.camera.grain import sensor_like
    from twin.camera.virtual_camera import NO_FILTER
    from twin.camera.virtual_photograph import write_photograph
    from twin.virtual_balls import render_balls

    real = job.store.load_frames()
    sensor = sensor_like(real)
    mosaic = real.is_mosaic and not job.session.half and camera.width % 2 == 0 and camera.height % 2 == 0
    if not mosaic:
        sensor = replace(sensor, cfa=NO_FILTER, black_level=0, white_level=65535)
    # Balls that were photographed apart may lie one upon the other: each gets frames of its own.
    together = [sphere for sphere in spheres if not sphere.apart]
    groups = ([together] if together else []) + [[sphere] for sphere in spheres if sphere.apart]
    decoded = []
    for number, group in enumerate(groups):
        files = []
        for index, image in enumerate(render_balls(group, camera, lights, peak=_peak(lights))):
            rng = np.random.default_rng([number, index])
            files.append(folder / str(number) / f"{lights.names[index]}.{'dng' if mosaic else 'png'}")
            time = datetime(2000, 1, 1) + timedelta(seconds=2 * index)
            write_photograph(files[-1], image, sensor, rng, focal_mm=50, time=time)
            progress(number * len(lights) + index + 1, len(groups) * len(lights))
        session = Session("self-test", folder, tuple(files), lights.names, tuple(range(len(files))))
        frames, _ = decode(session, Store(folder / f"{number}_decoded"), executor=job.executor)
        decoded.append(frames)
    requests = []
    for number, group in enumerate(groups):
        own = None if number == 0 else decoded[number]
        requests += [SphereRequest(sphere.kind, sphere.diameter_mm, frames=own) for sphere in group]
    return decoded[0], requests


def _peak(lights: Lights) -> float:
    """Return how bright the white ball is in the session; 0.6 of white where there is none."""
    if lights.white_value is None or not np.isfinite(lights.white_value).all():
        return 0.6
    return float(np.clip((lights.intensities * lights.white_value).max(), 0.05, 0.9))


def _recalibrated(
    frames: Frames, camera: Camera, requests: list[SphereRequest], truth: Lights, spheres: Sequence[Sphere]
) -> tuple[dict[str, Any], list[str]]:
    """Calibrate the rendering, and return the comparison and what to warn of."""
    from calibrate.calibrate import calibrate

    try:
        with progress_bar("self-test: calibrate") as progress:
            found = calibrate(frames, camera, requests, progress=progress)
    except CalibrationError as error:
        return {"calibrated": False, "reason": str(error)}, [f"self-test: the rendering cannot be calibrated: {error}"]
    lights = found.lights
    if lights.positions_mm is not None:
        # Sigmas hold at the rendering's own reference point: the truth is looked at from there.
        truth = truth.seen_from(lights.reference_point_mm)
    angle = angular_error_deg(lights.directions, truth.directions)
    sigma = found.lights.direction_sigma_deg
    rows: list[dict[str, Any]] = [
        {"name": name, "direction_error_deg": angle[i], "direction_sigma_deg": sigma[i]}
        for i, name in enumerate(truth.names)
    ]
    result: dict[str, Any] = {
        "calibrated": True,
        "model": lights.model,
        "model_of_the_session": truth.model,
        "direction_error_deg_median": float(np.median(angle)),
        "direction_error_deg_p95": float(np.quantile(angle, 0.95)),
        "direction_sigma_deg_median": _median(sigma),
        "directions_inside_95": _inside(angle**2 / sigma**2, 2),
    }
    if truth.positions_mm is not None and lights.positions_mm is not None:
        offset = lights.positions_mm - truth.positions_mm
        distance = np.linalg.norm(truth.positions_mm - truth.reference_point_mm, axis=1)
        percent = 100 * np.linalg.norm(offset, axis=1) / distance
        result["position_error_percent_median"] = float(np.median(percent))
        for row, value in zip(rows, percent, strict=True):
            row["position_error_percent"] = value
        if found.position_covariance_mm2 is not None:
            square = np.einsum(
                "fi,fi->f", offset, np.linalg.solve(found.position_covariance_mm2, offset[..., None])[..., 0]
            )
            result["positions_inside_95"] = _inside(square, 3)
    if np.isfinite(lights.intensity_sigma).any() and any(sphere.kind == "white" for sphere in spheres):
        relative = lights.intensities / truth.normalised().intensities - 1
        result["intensity_error_percent_rms"] = float(100 * np.sqrt(np.mean(relative**2)))
        result["intensity_sigma_percent_median"] = 100 * (_median(lights.intensity_sigma) or 0.0)
        result["intensities_inside_95"] = _inside(relative**2 / lights.intensity_sigma[:, None] ** 2, 1)
        for row, value in zip(rows, relative, strict=True):
            row["intensity_error_percent"] = 100 * value
    result["lights"] = rows
    return result, _judged(result)


def _judged(result: dict[str, Any]) -> list[str]:
    warnings = []
    if result["model"] != result["model_of_the_session"]:
        warnings.append(
            f"self-test: the session's lights are {result['model_of_the_session']}, those of its rendering come out "
            f"{result['model']}: balls and noise like these can hardly tell."
        )
    for what in ("directions", "positions", "intensities"):
        share = result.get(f"{what}_inside_95")
        if share is not None and share < DISHONEST:
            warnings.append(
                f"self-test: only {share:.0%} of the recovered {what} lie in the 95 % region of their sigma: it is too "
                "small for balls and flashes like these. Trust the self-test's errors instead."
            )
    return warnings


def _inside(square: NDArray, freedom: int) -> float | None:
    """Return the share of squared, normalised errors inside the 95 % region; None where no sigma is known."""
    known = square[np.isfinite(square)]
    return float(np.mean(known <= CHI2_95[freedom])) if known.size else None


def _median(values: NDArray) -> float | None:
    return float(np.nanmedian(values)) if np.isfinite(values).any() else None

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

from lab.job import Job, Outcome
from lab.progress import progress_bar
from scene.camera import Camera
from scene.errors import CalibrationError, SceneError
from scene.files import write_json
from scene.frames import Frames
from scene.lights import Lights
from scene.spheres import Sphere, SphereRequest
from scene.store import Store

FOLDER = "self_test"
FIRST_SHOT = datetime(2000, 1, 1)
Progress = Callable[[int, int], None]


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
    job: Job, folder: Path, camera: Camera, spheres: Sequence[Sphere], lights: Lights, progress: Progress
) -> tuple[Frames, list[SphereRequest]]:
    """Return the rendering's frames, decoded from files as photographs are, and what balls to look for in them."""
    from capture.photographs.decode import decode
    from capture.session.session_types import Session
    from twin.camera.virtual_camera import NO_FILTER
    from twin.camera.virtual_photograph import write_photograph
    from twin.session_scene import session_sensor
    from twin.virtual_balls import render_balls

    sensor = session_sensor(job.store.load_frames(), half=job.session.half)
    suffix = "dng"
    if sensor.cfa == NO_FILTER:
        # All that a PNG holds.
        suffix, sensor = "png", replace(sensor, black_level=0, white_level=65535)
    # Balls that were photographed apart may lie one upon the other: each gets frames of its own.
    together = [sphere for sphere in spheres if not sphere.apart]
    groups = ([together] if together else []) + [[sphere] for sphere in spheres if sphere.apart]
    requests, decoded = [], []
    for number, group in enumerate(groups):
        files = tuple(folder / str(number) / f"{name}.{suffix}" for name in lights.names)
        for index, image in enumerate(render_balls(group, camera, lights, peak=_peak(lights))):
            rng, time = np.random.default_rng([number, index]), FIRST_SHOT + timedelta(seconds=2 * index)
            write_photograph(files[index], image, sensor, rng, focal_mm=50.0, time=time)
            progress(number * len(lights) + index + 1, len(groups) * len(lights))
        session = Session("self-test", folder, files, lights.names, tuple(range(len(files))))
        decoded.append(decode(session, Store(folder / f"{number}_decoded"), executor=job.executor)[0])
        own = decoded[number] if number else None
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
    from compare.statistics.light_errors import light_errors, sigma_doubts

    try:
        with progress_bar("self-test: calibrate") as progress:
            found = calibrate(frames, camera, requests, progress=progress)
    except CalibrationError as error:
        return {"calibrated": False, "reason": str(error)}, [f"self-test: the rendering cannot be calibrated: {error}"]
    has_white = any(sphere.kind == "white" for sphere in spheres)
    result = light_errors(found.lights, truth, found.position_covariance_mm2, intensities=has_white)
    return {"calibrated": True, **result}, [f"self-test: {text}" for text in sigma_doubts(result)]

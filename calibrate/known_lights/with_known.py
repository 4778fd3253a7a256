"""Lights that are known beforehand: used as they are, completed and checked by whatever balls there are."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from calibrate.calibration import Array, Calibration
from calibrate.detection.balls import Ball, find_balls
from calibrate.detection.detect import Rejected
from calibrate.known_lights.order import wrong_order
from calibrate.known_lights.read_known import NO_INTENSITIES, lacks_intensities, without_flag
from calibrate.known_lights.turned import contradiction
from calibrate.lights.directions import mirrored_rays
from calibrate.lights.highlight import find_spots
from calibrate.photometry.from_white import intensities_from_white
from calibrate.photometry.matte_shading import read_skin, shading_directions
from calibrate.without_balls.from_object import strengths_from_object
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere, SphereRequest

EQUALLY_BRIGHT = "no white ball: all flashes are taken as equally bright. 5 % of variation bends normals by 2 degrees."


def with_known_lights(
    frames: Frames,
    camera: Camera,
    requests: Sequence[SphereRequest],
    lights: Lights,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Calibration:
    """Use given lights; find the balls that were asked for, and say how far chrome agrees."""
    if len(lights) != len(frames):
        raise CalibrationError(f"lights: {len(lights)} known lights for {len(frames)} flash frames.")
    lights.check()
    warnings: tuple[str, ...] = ()
    if lights.positions_mm is not None and camera.is_orthographic and camera.source == "assumed":
        lights = replace(lights, positions_mm=None)
        warnings = (
            "the known lights have positions in mm, but nothing is known of the camera: taken as distant, with the "
            "directions at their reference point. Add [camera].",
        )
    evidence = [f"{len(lights)} known lights ({lights.model}), used as they are"]
    balls: list[Ball] = []
    rejected: tuple[Rejected, ...] = ()
    if requests:
        try:
            balls, rejected, notes = find_balls(frames, camera, requests, progress=progress)
        except CalibrationError as error:
            notes = (str(error),)
        warnings += notes
    contradictions: tuple[str, ...] = ()
    shown = np.full((len(balls), len(frames), 2), np.nan)
    for i, ball in enumerate(balls):
        if ball.sphere.kind == "chrome":
            shown[i] = find_spots(ball.frames, camera, ball.coarse, ball.sphere).pixels[:, 0]
            points, seen = mirrored_rays(camera, ball.sphere, shown[i])
            target = _toward(lights, ball.sphere, points)
            angle = np.nanmedian(angular_error_deg(seen, target))
            evidence.append(f"chrome ball {i + 1} sees the known lights {angle:.2f} degrees off (median)")
        else:
            seen, _ = shading_directions(read_skin(ball.frames, camera, ball.sphere))
            target = _toward(lights, ball.sphere, ball.sphere.center_mm(camera))
        told = contradiction(f"{ball.sphere.kind} ball {i + 1}", frames.names, seen, target)
        contradictions += (told,) if told else ()
    if not balls:
        told = wrong_order(frames, camera, lights, np.ones((frames.height, frames.width), bool))
        contradictions += (told,) if told else ()
    warnings += contradictions
    if lacks_intensities(lights):
        try:
            lights, more = _with_intensities(frames, camera, balls, lights, evidence)
        except CalibrationError as error:
            # Under wrong directions a lit ball looks as if its flash had not fired.
            if not contradictions:
                raise
            raise CalibrationError("\n".join(contradictions)) from error
        warnings += more
    return Calibration([b.sphere for b in balls], lights, shown, rejected, tuple(evidence), warnings)


def _toward(lights: Lights, sphere: Sphere, points: Array) -> Array:
    """Return unit vectors (F, 3) from points (F, 3) or (3,) on a ball to the lights."""
    if lights.positions_mm is None or not sphere.diameter_mm:
        return lights.directions
    offset = lights.positions_mm - points
    return offset / np.linalg.norm(offset, axis=1, keepdims=True)


def _with_intensities(
    frames: Frames, camera: Camera, balls: list[Ball], lights: Lights, evidence: list[str]
) -> tuple[Lights, tuple[str, ...]]:
    """Read on the white balls the intensities that the lights' file does not tell; return warnings too."""
    skins = [read_skin(ball.frames, camera, ball.sphere) for ball in balls if ball.sphere.kind == "white"]
    if not skins:
        return _with_intensities_of_object(frames, camera, balls, lights, evidence)
    meter = (lights.directions, lights.positions_mm, lights.direction_sigma_deg, np.full(len(lights), np.nan))
    warnings: list[str] = []
    intensities, sigma, ambient = intensities_from_white(
        frames, skins, meter, lights.reference_point_mm, evidence, warnings
    )
    evidence.append("intensities from the white ball, read with the known directions: the file has none")
    read = replace(
        lights,
        intensities=intensities,
        intensity_sigma=sigma,
        ambient=ambient,
        white_value=np.ones(3),
        flags=without_flag(lights),
    )
    return read.normalised(), tuple(warnings)


def _with_intensities_of_object(
    frames: Frames, camera: Camera, balls: list[Ball], lights: Lights, evidence: list[str]
) -> tuple[Lights, tuple[str, ...]]:
    """Read from the object what neither the lights' file nor a white ball tells; return warnings too."""
    said = next(flag for flags in lights.flags for flag in flags if flag.endswith(NO_INTENSITIES))
    warnings: list[str] = []
    read = strengths_from_object(frames, camera, [ball.sphere for ball in balls], lights, evidence, warnings)
    if read is None:
        return lights, (
            f"{said}, and there is {EQUALLY_BRIGHT} State a white ball ([[spheres]]), or give a lights.json.",
        )
    told = replace(lights, intensities=read[0], intensity_sigma=read[1], flags=without_flag(lights))
    return told.normalised(), tuple(f"{said}, and there is {text}" for text in warnings)

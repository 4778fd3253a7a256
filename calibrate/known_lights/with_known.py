"""Lights that are known beforehand: used as they are, completed and checked by whatever balls there are."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibrate.calibration import Array, Calibration, Notes, flag_warnings
from calibrate.detection.balls import Ball, find_balls
from calibrate.detection.coarse import Progress
from calibrate.detection.detect import Rejected
from calibrate.known_lights.contradictions import contradiction, wrong_order
from calibrate.known_lights.read_known import NO_INTENSITIES, lacks_intensities, without_flag
from calibrate.lights.directions import mirrored_rays
from calibrate.lights.highlight import find_spots
from calibrate.photometry.from_white import intensities_from_white
from calibrate.photometry.matte_shading import brightness_beside, read_surface, shading_directions
from calibrate.without_balls.from_object import strengths_from_object
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere, SphereRequest

EQUALLY_BRIGHT = "no white ball: all flashes are taken as equally bright. 5 % of variation bends normals by 2 degrees."


def with_known_lights(
    frames: Frames,
    camera: Camera,
    requests: Sequence[SphereRequest],
    lights: Lights,
    *,
    progress: Progress | None = None,
) -> Calibration:
    """Use given lights; find the balls that were asked for, and say how far chrome agrees."""
    if len(lights) != len(frames):
        raise CalibrationError(f"lights: {len(lights)} known lights for {len(frames)} flash frames.")
    lights.check()
    notes = Notes()
    if lights.positions_mm is not None and camera.is_orthographic and camera.source == "assumed":
        lights = replace(lights, positions_mm=None)
        notes.warnings.append(
            "the known lights have positions in mm, but nothing is known of the camera: taken as distant, with the "
            "directions at their reference point. Add [camera]."
        )
    notes.evidence.append(f"{len(lights)} known lights ({lights.model}), used as they are")
    balls: list[Ball] = []
    rejected: tuple[Rejected, ...] = ()
    if requests:
        try:
            balls, rejected, cautions = find_balls(frames, camera, requests, progress=progress)
        except CalibrationError as error:
            cautions = (str(error),)
        notes.warnings.extend(cautions)
    doubts: list[str | None] = []
    shown = np.full((len(balls), len(frames), 2), np.nan)
    for i, ball in enumerate(balls):
        if ball.sphere.kind == "chrome":
            shown[i] = find_spots(ball.frames, camera, ball.coarse, ball.sphere).pixels[:, 0]
            points, seen = mirrored_rays(camera, ball.sphere, shown[i])
            target = _toward(lights, ball.sphere, points)
            angle = np.nanmedian(angular_error_deg(seen, target))
            notes.evidence.append(f"chrome ball {i + 1} sees the known lights {angle:.2f} degrees off (median)")
        else:
            beside = brightness_beside(ball.frames, ball.sphere)
            seen, _ = shading_directions(read_surface(ball.frames, camera, ball.sphere), beside)
            target = _toward(lights, ball.sphere, ball.sphere.center_mm(camera))
        doubts.append(contradiction(f"{ball.sphere.kind} ball {i + 1}", frames.names, seen, target))
    if not balls:
        doubts.append(wrong_order(frames, camera, lights, np.ones((frames.height, frames.width), bool)))
    contradictions = [doubt for doubt in doubts if doubt]
    notes.warnings.extend(contradictions)
    if lacks_intensities(lights):
        try:
            lights = _with_intensities(frames, camera, balls, lights, notes)
        except CalibrationError as error:
            # Under wrong directions a lit ball looks as if its flash had not fired.
            if not contradictions:
                raise
            raise CalibrationError("\n".join(contradictions)) from error
    notes.warnings.extend(flag_warnings(lights.names, lights.flags))
    return Calibration([b.sphere for b in balls], lights, shown, rejected, tuple(notes.evidence), tuple(notes.warnings))


def _toward(lights: Lights, sphere: Sphere, points: Array) -> Array:
    """Return unit vectors (F, 3) from points (F, 3) or (3,) on a ball to the lights."""
    if lights.positions_mm is None or not sphere.diameter_mm:
        return lights.directions
    return unit(lights.positions_mm - points)


def _with_intensities(frames: Frames, camera: Camera, balls: list[Ball], lights: Lights, notes: Notes) -> Lights:
    """Read on the white balls, else on the object, the intensities that the lights' file does not have."""
    surfaces = [read_surface(ball.frames, camera, ball.sphere) for ball in balls if ball.sphere.kind == "white"]
    if surfaces:
        lights = intensities_from_white(frames, surfaces, lights, notes)
        notes.evidence.append("intensities from the white ball, read with the known directions: the file has none")
    else:
        lacking = next(flag for flags in lights.flags for flag in flags if flag.endswith(NO_INTENSITIES))
        own = Notes(notes.evidence)
        read = strengths_from_object(frames, camera, [ball.sphere for ball in balls], lights, own)
        if read is None:
            notes.warnings.append(
                f"{lacking}, and there is {EQUALLY_BRIGHT} State a white ball ([[spheres]]), or give a lights.json."
            )
            return lights
        lights = replace(lights, intensities=read[0], intensity_sigma=read[1])
        notes.warnings.extend(f"{lacking}, and there is {text}" for text in own.warnings)
    return replace(lights, flags=without_flag(lights)).normalised()

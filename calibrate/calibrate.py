"""From photographs with calibration balls to lights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.balls import Ball, find_balls
from calibrate.detect import Rejected
from calibrate.directions import mirrored_rays
from calibrate.from_chrome import lights_from_chrome, spread_over_frames
from calibrate.from_white import APART_DEG, compare_with_chrome, intensities_from_white
from calibrate.highlight import find_spots
from calibrate.known import NO_INTENSITIES, lacks_intensities, without_flag
from calibrate.skin import read_skin, shading_directions
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere, SphereRequest

Array = NDArray[np.float64]
EQUALLY_BRIGHT = "no white ball: all flashes are taken as equally bright. 5 % of variation bends normals by 2 degrees."


@dataclass(frozen=True)
class Calibration:
    """What the balls say.

    Parameters
    ----------
    spheres : list of Sphere
    lights : Lights
    highlights_px : (S, F, 2) float64
        Where each ball mirrors each flash; NaN for white balls and where none was seen or believed.
    rejected : tuple of Rejected
        Circles that are no ball, or not one asked for, with the reason.
    evidence : tuple of str
        Why this model, and how well it fits.
    warnings : tuple of str
        What is suspicious but usable.
    """

    spheres: list[Sphere]
    lights: Lights
    highlights_px: Array
    rejected: tuple[Rejected, ...] = ()
    evidence: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def calibrate(
    frames: Frames,
    camera: Camera,
    requests: Sequence[SphereRequest],
    *,
    known_lights: Lights | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Calibration:
    """Find the balls, and from them every frame's light: direction, position, intensity.

    Parameters
    ----------
    frames : Frames
        One flash a frame.
    camera : Camera
        Orthographic where nothing is known of it; then directions only.
    requests : sequence of SphereRequest
        What the session says of its balls; empty: whatever balls there are.
    known_lights : Lights or None
        Used as they are; balls, where asked for, are then found for their masks and as a check, and a white one
        for the intensities where the lights' file had none.
    progress : callable or None
        Called with (done, total).

    Returns
    -------
    Calibration
        `lights.reference_point_mm` is the mean of the balls' centres, or the origin where no distances are known.

    Raises
    ------
    CalibrationError
        No ball, no highlight in a frame, fewer than three lights, coplanar lights, a clipped white ball.

    Notes
    -----
    Chrome gives directions by the law of the mirror, and ranges where two or more balls of known diameter are
    seen in perspective; near lights are claimed only if BIC demands them. White gives intensities; without
    chrome also directions, from its shading.
    """
    if known_lights is not None:
        return _with_known(frames, camera, requests, known_lights, progress)
    balls, rejected, notes = find_balls(frames, camera, requests, progress=progress)
    warnings = list(notes)
    evidence: list[str] = []
    chrome = [i for i, ball in enumerate(balls) if ball.sphere.kind == "chrome"]
    white = [i for i, ball in enumerate(balls) if ball.sphere.kind == "white"]
    reference = _reference(camera, [ball.sphere for ball in balls])
    flags: list[list[str]] = [[] for _ in frames.names]
    shown = np.full((len(balls), len(frames), 2), np.nan)
    spheres = _placed([ball.sphere for ball in balls], evidence)
    skins = [read_skin(balls[i].frames, camera, spheres[i]) for i in white]
    shaded = [shading_directions(skin) for skin in skins]
    apart = 0.0
    if chrome:
        fit, seen, chosen = lights_from_chrome(camera, [balls[i] for i in chrome], reference, evidence, warnings, flags)
        for row, i in enumerate(chrome):
            spheres[i] = fit.spheres[row]
            shown[i, seen] = np.where(fit.used[row][:, None], chosen[row, seen], np.nan)
        directions, positions, sigma, range_sigma = spread_over_frames(
            frames, fit, seen, shaded, reference, flags, warnings
        )
        if shaded:
            apart = compare_with_chrome(
                camera, spheres[white[0]], shaded[0][0], directions, positions, evidence, warnings
            )
    elif shaded and np.isfinite(shaded[0][0]).all():
        directions, sigma = shaded[0]
        positions, range_sigma = None, np.full(len(frames), np.nan)
        evidence.append("distant lights, from the white ball's shading: no chrome ball")
        if not camera.is_orthographic and not any(spheres[i].apart for i in white):
            warnings.append(
                "only a white ball: the directions hold where it stands, to a degree or two. An object 100 mm beside "
                "it, under flashes a metre away, sees them 6 degrees elsewhere. Put chrome balls on two sides of the "
                "object, and state diameter_mm."
            )
    else:
        raise CalibrationError(
            "spheres: the white ball shows too little lit, unclipped skin to tell the lights from. Add a chrome ball, "
            "or expose so that the white ball stays below white."
        )
    meter = (directions, positions, sigma, range_sigma)
    if apart > APART_DEG and positions is None:
        # Near lights without ranges: at the white ball its own shading knows the direction better.
        meter = (shaded[0][0], None, shaded[0][1], range_sigma)
        evidence.append("intensities are read with the white ball's own directions")
    intensities, intensity_sigma, ambient = np.ones((len(frames), 3)), np.full(len(frames), np.nan), None
    white_value = None
    if skins:
        intensities, intensity_sigma, ambient = intensities_from_white(
            frames, skins, meter, reference, evidence, warnings, apart_deg=apart
        )
        white_value = np.ones(3)
    else:
        warnings.append(EQUALLY_BRIGHT)
    _flag_same(frames.names, directions, positions, flags, warnings)
    lights = Lights(
        frames.names,
        directions,
        intensities,
        positions,
        reference,
        sigma,
        intensity_sigma,
        ambient,
        white_value,
        tuple(tuple(flag) for flag in flags),
    ).normalised()
    lights.check()
    return Calibration(spheres, lights, shown, rejected, tuple(evidence), tuple(warnings))


def _with_known(frames, camera, requests, lights: Lights, progress) -> Calibration:
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
    if lacks_intensities(lights):
        lights, more = _with_intensities(frames, camera, balls, lights, evidence)
        warnings += more
    shown = np.full((len(balls), len(frames), 2), np.nan)
    for i, ball in enumerate(balls):
        if ball.sphere.kind == "chrome":
            shown[i] = find_spots(ball.frames, camera, ball.coarse, ball.sphere).pixels[:, 0]
            points, seen = mirrored_rays(camera, ball.sphere, shown[i])
            target = lights.directions
            if lights.positions_mm is not None and ball.sphere.diameter_mm:
                target = lights.positions_mm - points
                target = target / np.linalg.norm(target, axis=1, keepdims=True)
            angle = np.nanmedian(angular_error_deg(seen, target))
            evidence.append(f"chrome ball {i + 1} sees the known lights {angle:.2f} degrees off (median)")
    return Calibration([b.sphere for b in balls], lights, shown, rejected, tuple(evidence), warnings)


def _with_intensities(
    frames: Frames, camera: Camera, balls: list[Ball], lights: Lights, evidence: list[str]
) -> tuple[Lights, tuple[str, ...]]:
    """Read on the white balls the intensities that the lights' file does not tell; return warnings too."""
    skins = [read_skin(ball.frames, camera, ball.sphere) for ball in balls if ball.sphere.kind == "white"]
    if not skins:
        said = next(flag for flags in lights.flags for flag in flags if flag.endswith(NO_INTENSITIES))
        return lights, (
            f"{said}, and there is {EQUALLY_BRIGHT} State a white ball ([[spheres]]), or give a lights.json.",
        )
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


def _placed(spheres: list[Sphere], evidence: list[str]) -> list[Sphere]:
    """Give white balls of unknown diameter the distance of the others: near lights fall off with it."""
    scales = [s.diameter_mm / s.radius_px for s in spheres if s.diameter_mm]
    if not scales:
        return spheres
    out = []
    for sphere in spheres:
        if sphere.kind == "white" and not sphere.diameter_mm:
            diameter = float(np.median(scales)) * sphere.radius_px
            evidence.append(f"the white ball is taken to stand as far as the others: {diameter:.0f} mm across")
            sphere = replace(sphere, diameter_mm=diameter)
        out.append(sphere)
    return out


def _reference(camera: Camera, spheres: list[Sphere]) -> Array:
    """Return the mean centre of the balls whose distance is known, else the origin."""
    known = [s.center_mm(camera) for s in spheres if s.diameter_mm and not camera.is_orthographic]
    return np.mean(known, axis=0) if known else np.zeros(3)


def _flag_same(
    names: tuple[str, ...], directions: Array, positions: Array | None, flags: list[list[str]], warnings: list[str]
) -> None:
    """Name frames whose lights are the same: they add no information, and often a flash that was not moved."""
    for i in range(len(names)):
        for j in range(i):
            same = angular_error_deg(directions[i], directions[j]) < 0.2
            if same and positions is not None:
                same = np.linalg.norm(positions[i] - positions[j]) < 0.02 * np.linalg.norm(positions[i])
            if same:
                flags[i].append(f"same light as {names[j]}")
                warnings.append(f"{names[j]} and {names[i]} have the same light.")

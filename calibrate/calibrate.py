"""From photographs with calibration balls to lights."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Calibration, Notes, flag_warnings
from calibrate.detection.balls import Ball, NoProbeError, find_balls
from calibrate.detection.coarse import Progress
from calibrate.detection.detect import Rejected
from calibrate.detection.evidence import contradicts_kind
from calibrate.known_lights.with_known import EQUALLY_BRIGHT, with_known_lights
from calibrate.lights.directions import SURROUNDINGS_DEG, Shading, no_shading, unknown_view_deg
from calibrate.lights.from_chrome import lights_from_chrome
from calibrate.photometry.from_white import APART_DEG, compare_with_chrome, intensities_from_white
from calibrate.photometry.matte_shading import (
    MatteSurface,
    brightness_beside,
    read_surface,
    shading_directions,
)
from calibrate.photometry.table_normal import table_normal
from calibrate.without_balls.from_object import strengths_from_object, white_in_shadow
from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.spheres import Sphere, SphereRequest

Array = NDArray[np.float64]
LAB_M = 0.2, 8.0  # how far from the camera balls stand in a lab
AS_FAR = 0.1  # relative sigma of a distance that is taken from the other balls on the table
SAME_DEG, SAME_PLACE = 0.2, 0.02  # angle, and share of its distance, between lights that are the same


def calibrate(
    frames: Frames,
    camera: Camera,
    requests: Sequence[SphereRequest],
    *,
    known_lights: Lights | None = None,
    progress: Progress | None = None,
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
    Chrome gives directions by the law of the mirror, white ones less exactly by their shading, and both together
    ranges where two or more balls of known diameter are seen in perspective, one of them chrome; near lights are
    claimed only if BIC demands them. White gives intensities.
    """
    if known_lights is not None:
        own = partial(lights_of_balls, frames, camera)
        return with_known_lights(frames, camera, requests, known_lights, own=own, progress=progress)
    return lights_of_balls(frames, camera, *find_balls(frames, camera, requests, progress=progress))


def lights_of_balls(
    frames: Frames,
    camera: Camera,
    balls: Sequence[Ball],
    rejected: tuple[Rejected, ...] = (),
    warnings: Sequence[str] = (),
) -> Calibration:
    """Return what balls that were found say of every frame's light; see `calibrate`.

    Only what lies around the balls is read of the frames.
    """
    notes = Notes(warnings=list(warnings), flags=[[] for _ in frames.names])
    spheres = _placed([ball.sphere for ball in balls], notes)
    reference = _reference(camera, spheres)
    white = [i for i, sphere in enumerate(spheres) if sphere.kind == "white"]
    chrome = [i for i, sphere in enumerate(spheres) if sphere.kind == "chrome"]
    table = table_normal(camera, spheres)
    surfaces = [read_surface(balls[i].frames, camera, spheres[i], table) for i in white]
    notes.warnings.extend(told for ball in balls if (told := contradicts_kind(ball.coarse, ball.sphere)))
    shading = _shading(camera, [(balls[i], spheres[i]) for i in white], surfaces, len(frames))
    shown = np.full((len(balls), len(frames), 2), np.nan)
    alone = None
    if chrome:
        of_chrome = [balls[i] for i in chrome]
        fit, chosen, alone = lights_from_chrome(frames.names, camera, of_chrome, shading, reference, notes)
        for row, i in enumerate(chrome):
            spheres[i] = fit.spheres[row]
            shown[i] = np.where(fit.used[row][:, None], chosen[row], np.nan)
        adjusted, lights, covariance = fit.camera, fit.lights(frames.names), fit.position_covariance_mm2
    else:
        adjusted, covariance = camera, None
        lights = _from_shading(frames.names, camera, [spheres[i] for i in white], shading, reference, notes)
    doubt = unknown_view_deg(adjusted, [spheres[i] for i in chrome] or spheres)
    if doubt:
        lights = replace(lights, direction_sigma_deg=np.hypot(lights.direction_sigma_deg, doubt))
        notes.evidence.append(f"nothing is known of the camera: directions to {doubt:.1f} degrees at best, all alike")
    if adjusted != camera:
        surfaces = [read_surface(balls[i].frames, adjusted, spheres[i], table) for i in white]
    _say_scale(adjusted, lights, spheres, notes)
    if lights.positions_mm is not None:
        notes.evidence.append(
            "everything scales with diameter_mm: 1 % too large there, and every distance is, and no photograph differs"
        )
    fired = np.asarray(np.isfinite(shown[..., 0]).any(0))
    lights = _with_intensities(frames, adjusted, spheres, surfaces, shading, lights, covariance, fired, notes)
    _flag_same(lights, notes)
    flags = tuple(tuple(flag) for flag in notes.flags)
    notes.warnings.extend(flag_warnings(frames.names, flags))
    lights = replace(lights, flags=flags).normalised()
    # Of fewer no normals are asked for: a scan finds its place by the outline.
    if len(lights) > 2:
        lights.check()
    said = tuple(notes.evidence), tuple(notes.warnings)
    return Calibration(spheres, lights, shown, rejected, *said, covariance, adjusted, alone, **notes.measured)


def _shading(camera: Camera, white: list[tuple[Ball, Sphere]], surfaces: list[MatteSurface], frames: int) -> Shading:
    """Return what the white balls' shading says of the lights."""
    if not white:
        return no_shading(frames)
    shown, centers = [], []
    for (ball, sphere), surface in zip(white, surfaces, strict=True):
        shown.append(shading_directions(surface, brightness_beside(ball.frames, sphere)))
        is_placed = sphere.diameter_mm and not camera.is_orthographic
        centers.append(sphere.center_mm(camera) if is_placed else np.full(3, np.nan))
    directions, sigma = (np.stack(part) for part in zip(*shown, strict=True))
    return Shading(directions, sigma, np.stack(centers))


def _from_shading(
    names: tuple[str, ...], camera: Camera, white: list[Sphere], shading: Shading, reference: Array, notes: Notes
) -> Lights:
    """Return the directions by the first white ball's shading."""
    if not white or not np.isfinite(shading.directions[0]).all():
        raise NoProbeError(
            "spheres: the white ball shows too little lit, unclipped skin to tell the lights from. Add a chrome ball, "
            "or expose so that the white ball stays below white."
        )
    notes.evidence.append("distant lights, from the white ball's shading: no chrome ball")
    if not camera.is_orthographic and not any(sphere.apart for sphere in white):
        notes.warnings.append(
            "only a white ball: the directions hold where it stands, to a degree or two. An object 100 mm beside "
            "it, under flashes a metre away, sees them 6 degrees elsewhere. Put chrome balls on two sides of the "
            "object, and state diameter_mm."
        )
    equal = np.ones((len(names), 3))
    return Lights(names, shading.directions[0], equal, None, reference, np.hypot(shading.own_deg[0], SURROUNDINGS_DEG))


def _with_intensities(
    frames: Frames,
    camera: Camera,
    spheres: list[Sphere],
    surfaces: list[MatteSurface],
    shading: Shading,
    lights: Lights,
    covariance: Array | None,
    fired: NDArray[np.bool_],
    notes: Notes,
) -> Lights:
    """Return the lights with intensities, their sigma, and the ambient light, where white balls show it."""
    if not surfaces:
        read = strengths_from_object(frames, camera, spheres, lights, notes)
        if read is None:
            notes.warnings.append(EQUALLY_BRIGHT)
            return lights
        return replace(lights, intensities=read[0], intensity_sigma=read[1])
    apart, there = 0.0, lights
    if any(sphere.kind == "chrome" for sphere in spheres):
        white = next(sphere for sphere in spheres if sphere.kind == "white")
        apart = compare_with_chrome(camera, lights, white, shading.directions[0], notes)
        if apart > APART_DEG and lights.positions_mm is None:
            # Near lights without ranges: at the white ball its own shading knows the direction better.
            own = {"directions": shading.directions[0], "direction_sigma_deg": shading.sigma_deg[0]}
            there = replace(lights, **own)
            notes.evidence.append("intensities are read with the white ball's own directions")
    found = intensities_from_white(frames, surfaces, there, notes, covariance=covariance, apart_deg=apart, fired=fired)
    if np.isinf(found.intensity_sigma).any():
        found = white_in_shadow(frames, camera, spheres, found, notes)
    return replace(found, directions=lights.directions, direction_sigma_deg=lights.direction_sigma_deg)


def _placed(spheres: list[Sphere], notes: Notes) -> list[Sphere]:
    """Give balls of unknown diameter the distance of the others: near lights fall off with it."""
    scales = [s.diameter_mm / s.radius_px for s in spheres if s.diameter_mm]
    if not scales:
        return spheres
    out = []
    for sphere in spheres:
        if not sphere.diameter_mm:
            diameter = float(np.median(scales)) * sphere.radius_px
            (u, v), across = sphere.center_px, f"{diameter:.0f} mm across"
            where = f"the {sphere.kind} ball at ({u:.0f}, {v:.0f}) px"
            notes.evidence.append(f"{where} is taken to stand as far as the others, to {AS_FAR:.0%}: {across}")
            sphere = replace(sphere, diameter_mm=diameter, diameter_sigma=AS_FAR)
        out.append(sphere)
    return out


def _say_scale(camera: Camera, lights: Lights, spheres: list[Sphere], notes: Notes) -> None:
    """Say how far balls and flashes are by the diameters given, and doubt what no lab has."""
    placed = [] if camera.is_orthographic else [s for s in spheres if s.diameter_mm and not s.apart]
    if not placed:
        return
    centers = np.stack([s.center_mm(camera) for s in placed])
    far = np.linalg.norm(centers, axis=1) / 1000
    text = f"balls {_span(far)} m from the camera"
    if lights.positions_mm is not None:
        text += (
            f", flashes {_span(np.linalg.norm(lights.positions_mm - centers.mean(0), axis=1) / 1000)} m from the balls"
        )
    notes.evidence.append(text)
    if not LAB_M[0] < np.median(far) < LAB_M[1]:
        listed = ", ".join(f"{d:g}" for d in sorted({s.diameter_mm for s in placed if s.diameter_mm}))
        notes.warnings.append(
            f"{text}, by diameters of {listed} mm: expected {LAB_M[0]:g} to {LAB_M[1]:g} m. Check that diameter_mm is "
            "in millimetres (1 cm = 10 mm, 1 inch = 25.4 mm), and the camera's focal length."
        )


def _span(metres: Array) -> str:
    low, high = f"{metres.min():.2f}", f"{metres.max():.2f}"
    return low if low == high else f"{low}-{high}"


def _reference(camera: Camera, spheres: list[Sphere]) -> Array:
    """Return the mean centre of the balls whose distance is known, else the origin."""
    known = [s.center_mm(camera) for s in spheres if s.diameter_mm and not camera.is_orthographic]
    return np.mean(known, axis=0) if known else np.zeros(3)


def _flag_same(lights: Lights, notes: Notes) -> None:
    """Flag frames whose light is that of an earlier one: they add no information, and often the flash was not moved."""
    directions, positions = lights.directions, lights.positions_mm
    for i in range(len(lights)):
        for j in range(i):
            same = angular_error_deg(directions[i], directions[j]) < SAME_DEG
            if same and positions is not None:
                same = np.linalg.norm(positions[i] - positions[j]) < SAME_PLACE * np.linalg.norm(positions[i])
            if same:
                notes.flags[i].append(f"same light as {lights.names[j]}")
                break

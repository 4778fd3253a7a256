"""What the white balls say: intensities, and whether they agree with the lights' places."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Notes, leave_out
from calibrate.lights.directions import SURROUNDINGS_DEG
from calibrate.photometry.matte_shading import MatteSurface
from calibrate.photometry.photometer import PARTLY, Photometry, covariance_of, measure, without_lamp
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
MISFIRE = 0.05  # a flash under this share of the median did not fire
SHADOWED = 0.6  # share of its usual brightness, by the other balls, under which a ball is in shadow
AGREE = 0.003  # relative, to which two healthy balls agree on a flash beyond what each one's residual shows
OFTEN = 4.0  # times the median's one frame's misfit that is worth a word
APART_DEG, NEAR_APART_DEG = 6.0, 3 * SURROUNDINGS_DEG
"""From here shading and highlights contradict each other: distant lights are seen elsewhere by each ball, near ones
not beyond what the surroundings bend; a diameter 20 % off gives 5."""
RESIDUAL, NEAR_RESIDUAL = 0.08, 0.02
"""Relative misfit of n.l from which a ball is not matte, or distant lights are too near; near ones leave 0.6 %."""
DOUBTFUL, EXPLAINED = 0.008, 0.6
"""Relative misfit of n.l from which one wrong statement is sought, and the share of it that one leaves at most."""
DIAMETERS = 0.8, 0.9, 1.1, 1.25  # factors of the white ball's diameter that are tried,
GAMMA = 2.2  # and the curve that sRGB is alike to: Lambert's law is linear, of v^g only one g fits a ball
MUCH_AMBIENT, LEFT_AMBIENT = 0.25, 0.05
"""Share of the median flash from which light without flash is either a bright room's, or no light but an encoding: by
sRGB taken for linear it is 0.5 to 0.7. The same where an ambient frame was taken off: sound sessions leave 0.01."""
SPOILT_DEG = 20.0  # how much farther than usual chrome and shading must point apart in one frame for it to be named


def intensities_from_white(
    frames: Frames,
    surfaces: list[MatteSurface],
    lights: Lights,
    notes: Notes,
    *,
    covariance: Array | None = None,
    apart_deg: float = 0.0,
    fired: NDArray[np.bool_] | None = None,
) -> Lights:
    """Return the lights with intensities, their sigma, and the ambient light, as pixel values on the first white ball.

    `covariance` (F, 3, 3): see `measure`; by the lights' sigmas where it is not known. `apart_deg` is what
    `compare_with_chrome` found. `fired` (F,): whether a chrome ball shows the flash: all white balls that are dark then
    stand in shadow, and the intensity's sigma is infinite.
    """
    read, covariance = [], covariance_of(lights) if covariance is None else covariance
    for number, surface in enumerate(surfaces):
        name = "the white ball" if len(surfaces) == 1 else f"white ball {number + 1}"
        light = measure(surface, lights, covariance)
        # Only the first ball was compared with the chrome.
        doubt, light = _doubt(surface, light, lights, covariance, name, 0.0 if number else apart_deg)
        notes.warnings.extend([*doubt, *_much_ambient(light, name, subtracted=frames.ambient is not None)])
        if light.evidence:
            notes.evidence.append(light.evidence if len(surfaces) == 1 else f"{number + 1}: {light.evidence}")
        read.append(light)
    known = np.stack([np.isfinite(light.intensities).all(1) for light in read])
    if not known.any(0).all():
        bad = ~known.any(0)
        names, clipped = [frames.names[f] for f in np.flatnonzero(bad)], max(light.clipped[bad].max() for light in read)
        raise CalibrationError(
            f"{', '.join(names)}: the white ball cannot be read ({clipped:.0%} of it is clipped). Expose less, or "
            f"turn the flash so that it lights the ball; or leave out: {leave_out(names)}."
        )
    brightness = np.stack([light.intensities.mean(1) for light in read])
    level = brightness / np.nanmedian(brightness, axis=1, keepdims=True)
    brightest = np.nanmax(level, axis=0)
    unlit = brightest < MISFIRE
    hidden = np.zeros_like(unlit) if fired is None else unlit & fired
    dark = np.flatnonzero(unlit & ~hidden)
    if len(dark):
        raise no_flash([frames.names[f] for f in dark], brightest[dark])
    shadowed = np.nan_to_num(level, nan=np.inf) < SHADOWED * brightest
    for number, light in enumerate(read):
        usual = np.nanmedian(light.misfit)
        odd = np.nan_to_num(light.misfit) > max(PARTLY, OFTEN * usual)
        for f in np.flatnonzero((odd | shadowed[number]) & ~hidden):
            told = "the intensity is the others'" if shadowed[number, f] else "or glared at?"
            notes.warnings.append(
                f"{frames.names[f]}: white ball {number + 1} stands in another's shadow, wholly or in part: it misses "
                f"n.l by {light.misfit[f]:.0%} of the flash (median frame {usual:.1%}); {told}"
            )
    intensities, sigma = _together(read, shadowed)
    intensities[hidden], sigma[hidden] = brightest[hidden, None] * np.median(intensities[~hidden], axis=0), np.inf
    ambient = read[0].ambient
    return replace(lights, intensities=intensities, intensity_sigma=sigma, ambient=ambient, white_value=np.ones(3))


def no_flash(names: Sequence[str], share: Array) -> CalibrationError:
    """Return what is said of frames whose white balls have so small a share of the median frame's brightness.

    A light of no strength would have a vote on every pixel, and divide it by nothing.
    """
    told = ", ".join(f"{name} ({max(one, 0):.1%})" for name, one in zip(names, share, strict=True))
    return CalibrationError(
        f"{told}: the flash did not fire, or the white ball stood in shadow (in brackets: its brightness, of the "
        "median frame's). Reshoot, or list the frame under frames.skip."
    )


def _doubt(
    surface: MatteSurface, read: Photometry, lights: Lights, covariance: Array, name: str, apart_deg: float
) -> tuple[list[str], Photometry]:
    """Say which wrong statement explains a misfit, or only that there is one; return the measurement to take.

    A ball of another diameter is at another distance on the same rays, where near lights come from elsewhere: an error
    of a tenth costs up to 9 % in the intensities, and hides in a misfit of 1 %.
    """
    misses = f"{name} misses n.l by {read.residual:.1%} of the flash"
    is_near = lights.positions_mm is not None
    if read.rms > DOUBTFUL:
        coded = {power: measure(_decoded(surface, power), lights) for power in (GAMMA, 1 / GAMMA)}
        other = {factor: measure(_scaled(surface, factor), lights) for factor in DIAMETERS if is_near}
        trials = coded | other
        best = min(trials, key=lambda one: trials[one].residual)
        left = f"{trials[best].residual:.1%}"
        if (lamp := without_lamp(surface, lights)) is not None:
            first, without = lamp[0], measure(lamp[1], lights, covariance)
            # It has four numbers to fit with: what explains as much with one is likelier.
            if without.rms < min(EXPLAINED * read.rms, trials[best].rms):
                return [
                    f"{lights.names[first]}: from here on {name} is lit by more than the flash, or by less: it misses "
                    f"n.l by {read.rms:.1%} of the flash, but by {without.rms:.1%} without a light that changed here: "
                    f"a lamp was switched after {lights.names[first - 1]}. The intensities are without it, but it "
                    "lights the object all the same. Darken the room and reshoot, or list the frames before or after "
                    "it under frames.skip."
                ], without
        is_explained = read.residual > DOUBTFUL and trials[best].residual < EXPLAINED * read.residual
        if is_explained and best in coded:
            right = "true" if best < 1 else "false (sRGB) or gamma = 2.2, or give the RAW files"
            return [
                f"frames.linear: {misses}, but by {left} if the values are raised to {best:.2g}: the files are coded "
                f"otherwise than frames says. Set frames.linear = {right}."
            ], read
        if is_explained:
            size = 2 * surface.radius
            return [
                f"{name} contradicts the lights' positions: {misses}, unless it is about {size * best:.1f} mm across, "
                f"not {size:.1f} (then {left}). The intensities are as if it were. Check diameter_mm of every ball, "
                "and the camera's focal length."
            ], measure(_scaled(surface, best), lights, covariance)
    contradicts = read.residual > NEAR_RESIDUAL or (apart_deg > NEAR_APART_DEG and read.residual > DOUBTFUL)
    if contradicts if is_near else read.residual > RESIDUAL:
        return [
            f"{name} contradicts the lights: its shading points {apart_deg:.1f} degrees beside them (median), and "
            f"{misses}. Does a lamp, or a wall that gives the flash's light back, light it too, is it glossy or dirty, "
            "another thing that was taken for a ball, or are the frames not linear? Then check diameter_mm of every "
            "ball, and the camera's focal length."
        ], read
    return [], read


def _decoded(surface: MatteSurface, power: float) -> MatteSurface:
    """Return the surface with its values raised to a power: the room's light was taken off what the files hold."""
    both, room = (np.maximum(v, 0) ** np.float32(power) for v in (surface.values + surface.ambient, surface.ambient))
    return replace(surface, values=both - room)


def _scaled(surface: MatteSurface, factor: float) -> MatteSurface:
    """Return the surface of a ball whose diameter is so many times as large: at another distance on the same rays."""
    points, center = factor * surface.points, factor * surface.center
    return replace(surface, points=points, center=center, radius=factor * surface.radius)


def _much_ambient(light: Photometry, name: str, *, subtracted: bool) -> list[str]:
    """Name an ambient light that may be none: an offset is what is most alike to a gamma curve."""
    strengths = light.intensities[np.isfinite(light.intensities).all(1)]
    share = float(light.ambient.mean() / np.median(strengths.mean(1))) if len(strengths) else 0.0
    if share > MUCH_AMBIENT:
        return [
            f"{name} shows {share:.0%} of the median flash in all frames alike (expected under {MUCH_AMBIENT:.0%}): a "
            "bright room, a black level that was not subtracted, or frames that are not linear. If they are "
            "sRGB-encoded, set frames.linear = false; else darken the room, or shoot an ambient frame (frames.ambient)."
        ]
    if subtracted and share > LEFT_AMBIENT:
        return [
            f"frames.ambient: with the ambient frame taken off, {name} still shows {share:.0%} of the median flash in "
            f"all frames alike (expected under {LEFT_AMBIENT:.0%}): the ambient frame is darker than the room was, at "
            "another exposure or before a lamp was lit, or a wall gives the flash's light back. Shoot it again with "
            "the flash frames' settings, and cover what is near."
        ]
    return []


def _together(read: list[Photometry], shadowed: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Join what balls of unknown grays measured; return intensities (F, 3) as on the first, and sigma (F,).

    log E_sf = log e_f + g_s, weighted; only what varies between frames is another ball's to say. A ball in shadow
    (S, F) is left out there.
    """
    energy, sigma = (np.stack(parts) for parts in zip(*((one.intensities, one.sigma) for one in read), strict=True))
    # Each ball's surroundings err in a way of their own, which its residual does not show.
    weight = np.where(np.isfinite(sigma) & ~shadowed, 1 / (sigma**2 + AGREE**2), 0)
    log = np.where((weight > 0)[..., None], np.log(np.maximum(energy, 1e-9)), 0)
    gray, total = np.zeros((len(read), 3)), np.maximum(weight.sum(0), 1e-12)[:, None]
    for _ in range(20 if len(read) > 1 else 0):
        mean = np.sum(weight[..., None] * (log - gray[:, None]), 0) / total
        gray = np.sum(weight[..., None] * (log - mean), 1) / np.maximum(weight.sum(1), 1e-12)[:, None]
        gray -= gray[0]
    mean = np.sum(weight[..., None] * (log - gray[:, None]), 0) / total
    return np.exp(mean), 1 / np.sqrt(total[:, 0])


def compare_with_chrome(camera: Camera, lights: Lights, sphere: Sphere, shaded: Array, notes: Notes) -> float:
    """Return, and say, how far the white ball's shading and the chrome balls' lights agree, degrees (median)."""
    toward, positions = lights.directions, lights.positions_mm
    if positions is not None and sphere.diameter_mm:
        toward = unit(positions - sphere.center_mm(camera))
    each = angular_error_deg(shaded, toward)
    angle = float(np.nanmedian(each))
    for f in np.flatnonzero(np.nan_to_num(each) > angle + SPOILT_DEG) if angle < SPOILT_DEG else ():
        notes.warnings.append(
            f"{lights.names[f]}: the light by the chrome balls' highlights and the white ball's shading point "
            f"{each[f]:.0f} degrees apart (median frame {angle:.1f}): a reflection taken for the flash, or the "
            "white ball in shadow? Look at the frame; reshoot it, or list it under frames.skip."
        )
    notes.measured["white_ball_deg"] = angle
    notes.evidence.append(f"the white ball's shading agrees with the chrome to {angle:.1f} degrees (median)")
    if positions is None and angle > APART_DEG:
        notes.warnings.append(
            f"the white ball's shading and the chrome balls' highlights point {angle:.0f} degrees apart (median): is "
            "the white ball matte, are the frames linear, and has each ball its diameter_mm? Near flashes are seen "
            "elsewhere by each ball."
        )
    return angle

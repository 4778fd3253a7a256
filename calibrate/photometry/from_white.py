"""What the white balls say: intensities, and directions where chrome has none."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from calibrate.calibration import Aim, Notes, leave_out
from calibrate.photometry.intensity import PARTLY, Photometry, measure
from calibrate.photometry.matte_shading import Surface
from calibrate.photometry.patches import Meter
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.normals import angular_error_deg, unit
from scene.spheres import Sphere

Array = NDArray[np.float64]
MISFIRE = 0.05  # a flash under this share of the median did not fire
SHADOWED = 0.6  # share of its usual brightness, by the other balls, under which a ball is in shadow
AGREE = 0.003  # relative, to which two healthy balls agree on a flash beyond what each one's residual shows
OFTEN = 4.0  # times the median's one frame's misfit that is worth a word
APART_DEG = 6.0
"""From here shading and highlights contradict each other: distant lights are seen elsewhere by each ball."""
RESIDUAL = 0.08  # relative misfit of n.l from which a ball is not matte, or distant lights are too near
NEAR_APART_DEG, NEAR_RESIDUAL = 3.0, 0.02
"""The same where the lights' positions are known, and only the balls can be wrong: healthy is 1 degree and 0.6 %; a
diameter 20 % off gives 5 degrees and 4 %, 10 % off 2.5 to 4.5 degrees and 2 to 3 %."""

DOUBTFUL, EXPLAINED = 0.004, 0.006
"""Relative misfit of n.l from which another diameter of the white ball is tried, and up to which all is explained: if
the shading alone then points elsewhere, light that is in all frames bends it. A wrong diameter leaves 0.1 % when it
is put right; sRGB taken for linear also likes another diameter, but leaves 0.7 %."""
ALONE, NOTABLE = 0.5, 0.03
"""Share of the misfit that it must leave at most, and how far, relative, it must lie off, to be believed."""
TRIED, BOUND, FINE = 0.5, 0.45, 0.005  # logarithms of the diameters that are tried; believed at most; and resolution
LESS = 0.97  # share of the misfit that `NOTABLE` more or less must leave at most for others to be tried
MUCH_AMBIENT = 0.25
"""Share of the median flash from which light without flash is either a bright room's, or no light but an encoding: by
sRGB taken for linear it is 0.5 to 0.7."""
CODED, CODED_BETTER, CODED_LEFT = 0.01, 0.6, 0.01
"""Relative misfit of n.l from which another coding of the values is tried; the share of it, and the misfit, that it may
leave at most. A wrong diameter is a little like a curve, too."""
GAMMA = 2.2  # that sRGB is alike to
LEFT_AMBIENT = 0.05  # the same where an ambient frame was taken off: sound sessions leave under 0.01
SPOILT_DEG = 20.0  # how much farther than usual chrome and shading must point apart in one frame for it to be named


def intensities_from_white(
    frames: Frames, surfaces: list[Surface], meter: Meter, notes: Notes, *, apart_deg: float = 0.0
) -> tuple[Array, Array, Array]:
    """Return intensities (F, 3), relative sigma (F,) and ambient (3,), as pixel values on the first white ball.

    `apart_deg` is what `compare_with_chrome` found.
    """
    read = []
    for number, surface in enumerate(surfaces):
        name = "the white ball" if len(surfaces) == 1 else f"white ball {number + 1}"
        light = measure(surface, meter)
        other = _other_diameter(surface, light, meter)
        coding = _wrong_coding(surface, light, meter, name, other[1])
        if coding:
            notes.warnings.append(coding)
        elif meter.positions is not None:
            # Only the first ball was compared with the chrome.
            light = _elsewhere(surface, light, meter, other, 0.0 if number else apart_deg, name, notes)
        elif light.residual > RESIDUAL:
            notes.warnings.append(
                f"{name} misses n.l by {light.residual:.0%} of the flash: glossy, dirty, or frames not linear?"
            )
        if light.evidence:
            notes.evidence.append(light.evidence if len(surfaces) == 1 else f"{number + 1}: {light.evidence}")
        _name_much_ambient(light, name, notes, subtracted=frames.ambient is not None)
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
    level = np.nanmax(brightness / np.nanmedian(brightness, axis=1, keepdims=True), axis=0)
    dark = np.flatnonzero(level < MISFIRE)
    if len(dark):
        # A light of no strength would have a vote on every pixel, and divide it by nothing.
        listed = ", ".join(f"{frames.names[f]} ({max(level[f], 0):.1%})" for f in dark)
        raise CalibrationError(
            f"{listed}: the flash did not fire, or the white ball stood in shadow (in brackets: its brightness, of the "
            "median frame's). Reshoot, or list the frame under frames.skip."
        )
    mean, sigma = _together(frames, read, notes)
    _name_shadows(frames, read, notes)
    return mean, sigma, read[0].ambient


def _wrong_coding(surface: Surface, read: Photometry, meter: Meter, name: str, rival: float) -> str | None:
    """Say how the frames' values are coded, if a curve explains the ball's shading and they were taken otherwise.

    `rival` is the misfit that another diameter leaves: the curve must leave less.

    Notes
    -----
    Lambert's law is linear in the light: of v^g only one g fits a ball of known normals. Tried are the 2.2 that sRGB
    is alike to, and its inverse.
    """
    residual = read.residual
    if residual < CODED:
        return None
    trials = []
    for power in (GAMMA, 1 / GAMMA):
        # The room's light was taken off what the files hold: the curve is of both together.
        room = surface.ambient
        both, room = (np.maximum(v, 0) ** np.float32(power) for v in (surface.values + room, room))
        trials.append(measure(replace(surface, values=both - room), meter, misfit_alone=True).residual)
    if min(trials) > min(CODED_BETTER * residual, CODED_LEFT, rival):
        return None
    power, fault = "2.2", ("gamma-encoded. Set frames.linear = false (sRGB) or gamma = 2.2, or give the RAW files.")
    if trials[1] <= trials[0]:
        power, fault = "1/2.2", "linear, and were decoded as if they were not. Set frames.linear = true."
    return (
        f"frames.linear: {name} misses n.l by {residual:.1%} of the flash with the values as they were taken, but by "
        f"{min(trials):.1%} if they are raised to {power}: the files are {fault}"
    )


def _scaled(surface: Surface, log: float) -> Surface:
    """Return the surface of a ball whose diameter is exp(log) times as large: at another distance on the same rays."""
    points, center, radius = (np.exp(log) * part for part in (surface.points, surface.center, surface.radius))
    return replace(surface, points=points, center=center, radius=float(radius))


def _other_diameter(surface: Surface, read: Photometry, meter: Meter) -> tuple[float, float]:
    """Return the logarithm by which the diameter that the shading wants differs, and the misfit that is left then.

    0 and infinity where lights are distant, nothing is in doubt, or a little more or less explains no more.
    """
    if meter.positions is None or read.residual < DOUBTFUL:
        return 0.0, np.inf

    def residual(log: float) -> float:
        return measure(_scaled(surface, log), meter, misfit_alone=True).residual

    if min(residual(-NOTABLE), residual(NOTABLE)) > LESS * read.residual:
        return 0.0, np.inf
    found: Any = minimize_scalar(residual, bounds=(-TRIED, TRIED), method="bounded", options={"xatol": FINE})
    return float(found.x), float(found.fun)


def _elsewhere(
    surface: Surface,
    read: Photometry,
    meter: Meter,
    other: tuple[float, float],
    apart_deg: float,
    name: str,
    notes: Notes,
) -> Photometry:
    """Return the measurement as if the ball had the other diameter, if only that explains it.

    Notes
    -----
    A ball of another diameter is at another distance on the same rays, where near lights come from elsewhere: an
    error of a tenth costs up to 9 % in the intensities, and hides in a misfit of 1 %.
    """
    residual, (log, least) = read.residual, other
    if least < min(ALONE * residual, EXPLAINED) and NOTABLE < abs(log) < BOUND:
        notes.warnings.append(
            f"{name} contradicts the lights' positions: its shading misses n.l by {residual:.1%} of the flash, unless "
            f"it is {2 * surface.radius * np.exp(log):.1f} mm across, not {2 * surface.radius:.1f} (then {least:.1%}). "
            "The intensities are as if it were. Check diameter_mm of every ball, and the camera's focal length."
        )
        return measure(_scaled(surface, log), meter)
    if residual > NEAR_RESIDUAL or (apart_deg > NEAR_APART_DEG and residual > EXPLAINED):
        notes.warnings.append(
            f"{name} contradicts the lights' positions: its shading points {apart_deg:.1f} degrees beside them "
            f"(median; expected under {NEAR_APART_DEG:g}) and misses n.l by {residual:.1%} of the flash (expected "
            f"under {NEAR_RESIDUAL:.0%}), whatever its diameter. Is it glossy or dirty, another thing that was taken "
            "for a ball, or are the frames not linear? Then check diameter_mm of every ball, and the camera's focal "
            "length."
        )
    return read


def _name_much_ambient(light: Photometry, name: str, notes: Notes, *, subtracted: bool) -> None:
    """Name an ambient light that may be none: an offset is what is most alike to a gamma curve."""
    strengths = light.intensities[np.isfinite(light.intensities).all(1)]
    share = float(light.ambient.mean() / np.median(strengths.mean(1))) if len(strengths) else 0.0
    if subtracted and LEFT_AMBIENT < share <= MUCH_AMBIENT:
        notes.warnings.append(
            f"frames.ambient: with the ambient frame taken off, {name} still shows {share:.0%} of the median flash in "
            f"all frames alike (expected under {LEFT_AMBIENT:.0%}): the ambient frame is darker than the room was, at "
            "another exposure or before a lamp was lit. Shoot it again with the flash frames' settings."
        )
    if share > MUCH_AMBIENT:
        notes.warnings.append(
            f"{name} shows {share:.0%} of the median flash in all frames alike (expected under {MUCH_AMBIENT:.0%}): a "
            "bright room, a black level that was not subtracted, or frames that are not linear. If they are "
            "sRGB-encoded, set frames.linear = false; else darken the room, or shoot an ambient frame (frames.ambient)."
        )


def _together(frames: Frames, read: list[Photometry], notes: Notes) -> tuple[Array, Array]:
    """Join what balls of unknown grays measured; return intensities (F, 3) as on the first, and sigma (F,).

    Notes
    -----
    log E_sf = log e_f + g_s, weighted; only what varies between frames is another ball's to say. A ball that is much
    darker than usual where another is not is in shadow, and is left out there.
    """
    energy = np.stack([light.intensities for light in read])
    sigma = np.stack([light.sigma for light in read])
    level = energy.mean(-1) / np.nanmedian(energy.mean(-1), axis=1)[:, None]
    shadowed = np.nan_to_num(level, nan=np.inf) < SHADOWED * np.nanmax(level, axis=0)
    for s, f in zip(*np.nonzero(shadowed), strict=True):
        notes.warnings.append(f"{frames.names[f]}: white ball {s + 1} stands in shadow; the intensity is the others'.")
    # Each ball's surroundings err in a way of their own, which its residual does not show.
    weight = np.where(np.isfinite(sigma) & ~shadowed, 1 / (sigma**2 + AGREE**2), 0)
    log = np.where((weight > 0)[..., None], np.log(np.maximum(energy, 1e-9)), 0)
    gray = np.zeros((len(read), 3))
    for _ in range(20 if len(read) > 1 else 0):
        mean = np.sum(weight[..., None] * (log - gray[:, None]), 0) / weight.sum(0)[:, None]
        gray = np.sum(weight[..., None] * (log - mean), 1) / np.maximum(weight.sum(1), 1e-12)[:, None]
        gray -= gray[0]
    mean = np.sum(weight[..., None] * (log - gray[:, None]), 0) / weight.sum(0)[:, None]
    return np.exp(mean), 1 / np.sqrt(weight.sum(0))


def _name_shadows(frames: Frames, read: list[Photometry], notes: Notes) -> None:
    """Name the frames in which a ball looks unlike in the others."""
    for number, light in enumerate(read):
        usual = np.nanmedian(light.misfit)
        for f in np.flatnonzero(np.nan_to_num(light.misfit) > max(PARTLY, OFTEN * usual)):
            notes.warnings.append(
                f"{frames.names[f]}: the white ball {number + 1} misses n.l by {light.misfit[f]:.0%} of the flash "
                f"(median frame {usual:.1%}): partly in another's shadow, or glared at?"
            )


def compare_with_chrome(names: tuple[str, ...], aim: Aim, sphere: Sphere, shaded: Array, notes: Notes) -> float:
    """Return, and say, how far the white ball's shading and the chrome balls' lights agree, degrees (median)."""
    toward, positions = aim.directions, aim.positions_mm
    if positions is not None and sphere.diameter_mm:
        toward = unit(positions - sphere.center_mm(aim.camera))
    each = angular_error_deg(shaded, toward)
    angle = float(np.nanmedian(each))
    if angle < SPOILT_DEG:
        for f in np.flatnonzero(np.nan_to_num(each) > angle + SPOILT_DEG):
            notes.warnings.append(
                f"{names[f]}: the light by the chrome balls' highlights and the white ball's shading point "
                f"{each[f]:.0f} degrees apart (median frame {angle:.1f}): a reflection taken for the flash, or the "
                "white ball in shadow? Look at the frame; reshoot it, or list it under frames.skip."
            )
    notes.evidence.append(f"the white ball's shading agrees with the chrome to {angle:.1f} degrees (median)")
    if positions is None and angle > APART_DEG:
        notes.warnings.append(
            f"the white ball's shading and the chrome balls' highlights point {angle:.0f} degrees apart (median): is "
            "the white ball matte, are the frames linear, and has each ball its diameter_mm? Near flashes are seen "
            "elsewhere by each ball."
        )
    return angle

"""What the chrome balls say together: one highlight a frame on each, and the lights that explain them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import ANOTHER_BRIGHTER, CrossValidation, Notes, leave_out
from calibrate.detection.balls import Ball
from calibrate.lights.adjustment import ObservedSpots
from calibrate.lights.agreement import agreed_spots
from calibrate.lights.cross_validation import cross_validate
from calibrate.lights.directions import Shading, mirrored_rays
from calibrate.lights.light_model import choose_model
from calibrate.lights.positions import LightFit
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.normals import angular_error_deg
from scene.spheres import Sphere

Array = NDArray[np.float64]
ROUND = 2e-4
"""Share of its radius to which a ball is round and the lens straight across it: 0.01 px of 67, 0.08 px of 400. Ball
bearings of 80 mm are round to 3 (grade 100) to 25 micrometres (grade 1000) of their diameter."""
SAMPLED_PX2 = 4.5
"""A flash is as many pixels wide on a ball as the ball's radius is: its place errs by this over that. Medians of 80
balls of 15 to 84 px by two generators of others, which sample each pixel and then blur: 4.9 and 4.0."""
STRAY_DEG = 45.0
"""How much farther than usual a highlight must point beside the white ball's shading to be another thing's: flashes a
metre away are up to 30 degrees elsewhere for a ball 500 mm beside the white one."""
CONTRADICTION_DEG = 2.0  # how far the lights of two balls must point apart in one frame for it to be named
WIDER = 2.0  # times its stated doubt by which balls, each alone, may differ before somebody is told
ODD = 0.6
"""Of the usual height and size: a point that is less than so much of both is a reflection of the flash in something
else. A flash that is farther away is smaller, and as bright."""


def lights_from_chrome(
    names: tuple[str, ...], camera: Camera, balls: list[Ball], shading: Shading, reference: Array, notes: Notes
) -> tuple[LightFit, Array, CrossValidation | None]:
    """Fit the lights to the highlights and the white balls' shading.

    Returns the fit, the chosen highlights, and whether each ball alone differs by what is stated.

    Raises
    ------
    CalibrationError
        A frame's flash is seen on no ball, or none on chrome.
    """
    spheres = [ball.sphere for ball in balls]
    spots = agreed_spots(camera, balls, shading)
    chosen, sigma, extents, glare, strength, outshone = (np.stack(part) for part in zip(*spots, strict=True))
    for s, f in zip(*np.nonzero(outshone), strict=True):
        notes.flags[f].append(f"chrome ball {s + 1} {ANOTHER_BRIGHTER}")
    radius = np.array([[sphere.radius_px] for sphere in spheres])
    sigma, extents = np.hypot(sigma, SAMPLED_PX2 / radius), np.nan_to_num(extents)
    usual = np.array([np.median(row[row > 0]) if row.any() else 0.0 for row in extents])[:, None]
    odd = (strength < ODD) & (extents < ODD * usual)
    sigma = np.where(odd, radius, sigma)
    sound = np.concatenate([np.isfinite(chosen[..., 0]) & ~odd, shading.clear])
    _name_odd(names, odd, sound, notes)
    for s, f in zip(*np.nonzero(glare), strict=True):
        notes.flags[f].append(f"glare beside the highlight on chrome ball {s + 1}: the middle of its core is taken")
    _leave_out_strays(camera, spheres, chosen, shading.rough, notes)
    seen = np.asarray(np.isfinite(chosen[..., 0]).any(0))
    if not seen.any():
        raise CalibrationError("spheres: no highlight of the flash was found on any chrome ball, in any frame.")
    _name_unseen(names, seen, shading, notes)
    covariances = [ball.covariance + (ROUND * ball.sphere.radius_px) ** 2 * np.eye(3) for ball in balls]
    seen = ObservedSpots(camera, spheres, covariances, chosen, sigma, reference, shading=shading)
    fit = choose_model(seen, notes)
    apart = cross_validate(seen, fit)
    if apart is not None and apart.ratio > WIDER:
        notes.warnings.append(
            f"each chrome ball alone places the lights {apart.difference_deg:.2g} degrees (rms) from where the others "
            f"do; their stated doubts allow {apart.stated_deg:.2g}: take the lights' sigma {apart.ratio:.1f} times as "
            "large. Is an outline wrong? Look at the circles in the report."
        )
    if len(balls) == 1 and not camera.is_orthographic and not spheres[0].apart and fit.positions_mm is None:
        notes.warnings.append(
            "one chrome ball: the directions hold where it mirrors each flash. An object 100 mm beside it, under "
            "flashes a metre away, sees them 6 degrees elsewhere. Put a second chrome ball on its other side, and "
            "state diameter_mm."
        )
    for s, f in zip(*np.nonzero(np.isfinite(chosen[..., 0]) & ~fit.used), strict=True):
        notes.flags[f].append(f"highlight on chrome ball {s + 1} disagrees and is left out")
    return _with_contradictions(fit, chosen, np.array(names), notes), chosen, apart


def _name_odd(names: tuple[str, ...], odd: NDArray[np.bool_], sound: NDArray[np.bool_], notes: Notes) -> None:
    """Flag points (S, F) that are small and dark for a flash, and warn where no other ball, chrome or white, shows it.

    `sound` (S + W, F): which balls show it.
    """
    for s, f in zip(*np.nonzero(odd), strict=True):
        notes.flags[f].append(f"the highlight on chrome ball {s + 1} is small and dark: another reflection?")
    alone = odd.any(0) & ~sound.any(0)
    if alone.any():
        listed = ", ".join(names[f] for f in np.flatnonzero(alone))
        notes.warnings.append(
            f"{listed}: the highlight on the chrome ball is less than {ODD:g} as large and as bright as in the "
            "other frames. The ball may not see the flash, and show another reflection of it: the direction is not "
            "known. Look at the photograph; list it under frames.skip if so."
        )


def _name_unseen(names: tuple[str, ...], seen: NDArray[np.bool_], shading: Shading, notes: Notes) -> None:
    """Name the frames whose light no chrome ball shows; what no white ball shows either is an error."""
    known = seen | shading.clear.any(0)
    if not known.all():
        dark = [names[f] for f in np.flatnonzero(~known)]
        raise CalibrationError(
            f"{', '.join(dark)}: no chrome ball shows the flash, and no white ball tells its direction. Did it fire, "
            f"or did something hide it from the balls? Reshoot, or leave out: {leave_out(dark)}."
        )
    lost = np.flatnonzero(~seen)
    for f in lost:
        notes.flags[f].append("no highlight seen: direction from the white ball's shading")
    if len(lost):
        listed = ", ".join(names[f] for f in lost)
        notes.warnings.append(
            f"{listed}: no chrome ball shows the flash; the direction is from the white ball's shading."
        )


def _leave_out_strays(camera: Camera, spheres: list[Sphere], chosen: Array, shaded: Array, notes: Notes) -> None:
    """Set to NaN what lies beside its ball, and what the white balls' clear shading contradicts."""
    toward = np.stack([mirrored_rays(camera, s, at)[1] for s, at in zip(spheres, chosen, strict=True)])
    chosen[~np.isfinite(toward[..., 0])] = np.nan
    off = angular_error_deg(toward, shaded)
    if not np.isfinite(off).any():
        return
    stray = np.nan_to_num(off) > np.nanmedian(off) + STRAY_DEG
    for s, f in zip(*np.nonzero(stray), strict=True):
        chosen[s, f] = np.nan
        notes.flags[f].append(
            f"highlight on chrome ball {s + 1} is {off[s, f]:.0f} degrees beside the white ball's shading and left out"
        )


def _with_contradictions(fit: LightFit, chosen: Array, names: NDArray[np.str_], notes: Notes) -> LightFit:
    """Widen, and name, the lights of frames in which two balls contradict each other: nobody knows which is right."""
    left_out = np.isfinite(chosen[..., 0]) & ~fit.used
    doubt = np.zeros(len(names))
    for s, f in zip(*np.nonzero(left_out & (fit.used.sum(0) == 1)), strict=True):
        points, toward = mirrored_rays(fit.camera, fit.spheres[s], chosen[s])
        light = fit.directions[f] if fit.positions_mm is None else fit.positions_mm[f] - points[f]
        doubt[f] = float(angular_error_deg(toward[f], light / np.linalg.norm(light)))
    doubt[~(doubt > CONTRADICTION_DEG)] = 0
    bad = np.flatnonzero(doubt)
    if not len(bad):
        return fit
    listed = ", ".join(f"{names[f]} ({doubt[f]:.0f} degrees)" for f in bad)
    notes.warnings.append(
        f"{listed}: two chrome balls show the flash in directions so far apart, and nobody knows which is right: one "
        "is left out, and sigma is half of that. A ball in shadow, a dirty one, or a wrong diameter_mm? Look at the "
        "frames; reshoot them, or list them under frames.skip."
    )
    covariance = fit.position_covariance_mm2
    if covariance is not None:
        across = np.eye(3) - fit.directions[:, :, None] * fit.directions[:, None, :]
        covariance = covariance + ((fit.distance_mm * np.deg2rad(doubt / 2)) ** 2)[:, None, None] * across
    sigma = np.hypot(fit.direction_sigma_deg, doubt / 2)
    return replace(fit, direction_sigma_deg=sigma, position_covariance_mm2=covariance)

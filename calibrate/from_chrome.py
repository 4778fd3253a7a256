"""What the chrome balls say together: one highlight a frame on each, and the lights that explain them."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from calibrate.adjustment import LightFit, ray_meeting
from calibrate.balls import Ball
from calibrate.calibration import Aim, Notes
from calibrate.directions import mean_directions, mirrored_rays
from calibrate.highlight import Spots, find_spots
from calibrate.positions import fit_lights
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.normals import angular_error_deg
from scene.spheres import Sphere

Array = NDArray[np.float64]
NEAR_BIC = 10.0
"""How much better near lights must explain the highlights before ranges are claimed."""
DISAGREE = 9.0
"""chi2 per degree of freedom from which the balls contradict each other: misses of three sigmas."""


def lights_from_chrome(
    camera: Camera,
    balls: list[Ball],
    reference: Array,
    notes: Notes,
) -> tuple[LightFit, NDArray[np.bool_], Array]:
    """Fit the lights to the highlights; return the fit, the frames that it holds, and the chosen highlights."""
    spheres = [ball.sphere for ball in balls]
    spots = [find_spots(ball.frames, camera, ball.coarse, ball.sphere) for ball in balls]
    measurable = not camera.is_orthographic and len(balls) >= 2 and all(s.diameter_mm for s in spheres)
    chosen, sigma = _agreeing(camera, spheres, spots, measurable, notes.flags)
    seen = np.asarray(np.isfinite(chosen[..., 0]).any(0))
    if not seen.any():
        raise CalibrationError("spheres: no highlight of the flash was found on any chrome ball, in any frame.")
    covariances = [ball.covariance for ball in balls]

    def fit_as(near: bool, covariances: list[Array]) -> LightFit:
        return fit_lights(camera, spheres, covariances, chosen[:, seen], sigma[:, seen], reference, near=near)

    fit = fit_as(False, covariances)
    if measurable:
        near = fit_as(True, covariances)
        scale = max(1.0, near.reduced)
        gain = (fit.chi2_all - near.chi2_all) / scale - (near.unknowns - fit.unknowns) * np.log(near.observations)
        assert near.positions_mm is not None
        distance = np.linalg.norm(near.positions_mm - reference, axis=1) / 1000
        if gain > NEAR_BIC:
            fit = near
            notes.evidence.append(
                f"near lights: {distance.min():.2f} to {distance.max():.2f} m from the balls (dBIC {gain:.0f} against "
                "distant)"
            )
        else:
            notes.evidence.append(f"distant lights: ranges would not explain the highlights better (dBIC {gain:.0f})")
    elif len(balls) == 1:
        notes.evidence.append("distant lights: one chrome ball gives directions only")
        if not balls[0].sphere.apart:
            notes.warnings.append(
                "one chrome ball: the directions hold where it stands. An object 100 mm beside it, under flashes a "
                "metre away, sees them 6 degrees elsewhere. Put a second chrome ball on its other side, and state "
                "diameter_mm."
            )
    else:
        notes.evidence.append(
            "distant lights: ranges need "
            + ("a perspective camera" if camera.is_orthographic else "the balls' diameters")
        )
    if fit.positions_mm is None and fit.reduced > DISAGREE:
        # The model is wrong, not the outlines: the balls must not be bent to it.
        fit = fit_as(False, [1e-6 * np.eye(3)] * len(balls))
    rms = float(np.sqrt(np.nanmean(fit.residual_px**2)))
    moved = max(float(np.hypot(*(a.center_px - b.center_px))) for a, b in zip(fit.spheres, spheres, strict=True))
    notes.evidence.append(f"highlights fit to {rms:.2f} px rms; the balls moved by at most {moved:.2f} px for it")
    if fit.reduced > DISAGREE:
        hint = (
            "check their diameters and the camera's focal length"
            if fit.positions_mm is not None
            else "near lights? Give diameter_mm and a camera"
        )
        notes.warnings.append(
            f"the chrome balls disagree on the lights: highlights miss by {rms:.1f} px rms, "
            f"{np.sqrt(fit.reduced):.1f} times what was expected; {hint}. The stated sigma is widened accordingly."
        )
    for s, f in zip(*np.nonzero(np.isfinite(chosen[:, seen, 0]) & ~fit.used), strict=True):
        notes.flags[int(np.flatnonzero(seen)[f])].append(f"highlight on chrome ball {s + 1} disagrees and is left out")
    return fit, seen, chosen


def _agreeing(
    camera: Camera, spheres: list[Sphere], spots: list[Spots], measurable: bool, flags: list[list[str]]
) -> tuple[Array, Array]:
    """Choose one bright point per ball and frame: the brightest, unless others agree between balls much better."""
    pixels = np.stack([s.pixels[:, 0] for s in spots])
    sigma = np.stack([s.sigma_px[:, 0] for s in spots])
    if len(spheres) < 2:
        return pixels, sigma
    rays = [mirrored_rays(camera, sphere, s.pixels) for sphere, s in zip(spheres, spots, strict=True)]

    def miss_deg(f: int, pick: tuple[int, ...]) -> float:
        points = np.stack([rays[s][0][f, k] for s, k in enumerate(pick)])
        directions = np.stack([rays[s][1][f, k] for s, k in enumerate(pick)])
        good = np.isfinite(directions[:, 0])
        if good.sum() < 2:
            return 0.0
        points, directions = points[good], directions[good]
        target = np.broadcast_to(mean_directions(directions[:, None])[0], directions.shape)
        if measurable:
            meeting = ray_meeting(points, directions)
            toward = meeting - points
            if np.isfinite(meeting).all() and np.sum(toward * directions) > 0:
                target = toward / np.linalg.norm(toward, axis=1, keepdims=True)
        return float(angular_error_deg(directions, target).max())

    first = (0,) * len(spheres)
    usual = np.median([miss_deg(f, first) for f in range(pixels.shape[1])])
    for f in range(pixels.shape[1]):
        plain = miss_deg(f, first)
        if plain < max(2.0, 4 * usual):
            continue
        options = [range(max(1, int(np.isfinite(s.pixels[f, :3, 0]).sum()))) for s in spots[:4]]
        options += [range(1)] * (len(spots) - 4)
        pick = min(product(*options), key=lambda p: miss_deg(f, p) + 0.5 * sum(p))
        if miss_deg(f, pick) < 0.4 * plain:
            for s, k in enumerate(pick):
                pixels[s, f], sigma[s, f] = spots[s].pixels[f, k], spots[s].sigma_px[f, k]
                if k:
                    flags[f].append(f"a brighter point on chrome ball {s + 1} is not the flash")
    return pixels, sigma


def spread_over_frames(
    frames: Frames,
    fit: LightFit,
    seen: NDArray[np.bool_],
    shaded: list[tuple[Array, Array]],
    reference: Array,
    notes: Notes,
) -> Aim:
    """Spread the fit over all frames; what no chrome ball saw comes from the white ball's shading."""
    count = len(frames)
    directions, sigma = np.full((count, 3), np.nan), np.full(count, np.nan)
    range_sigma = np.full(count, np.nan)
    positions = None if fit.positions_mm is None else np.full((count, 3), np.nan)
    directions[seen], sigma[seen], range_sigma[seen] = fit.directions, fit.direction_sigma_deg, fit.range_sigma
    if positions is not None and fit.positions_mm is not None:
        positions[seen] = fit.positions_mm
    lost = np.flatnonzero(~seen)
    for f in lost:
        if not shaded or not np.isfinite(shaded[0][0][f, 0]):
            raise CalibrationError(
                f"{frames.names[f]}: no chrome ball shows the flash, and no white ball tells its direction. Did it "
                "fire? Reshoot, or list the frame under frames.skip."
            )
        directions[f] = shaded[0][0][f]
        sigma[f] = max(2.0, shaded[0][1][f])
        if positions is not None and fit.positions_mm is not None:
            distance = np.median(np.linalg.norm(fit.positions_mm - reference, axis=1))
            positions[f] = reference + distance * directions[f]
            range_sigma[f] = 0.3
        notes.flags[f].append("no highlight seen: direction from the white ball's shading")
    if len(lost):
        names = ", ".join(frames.names[f] for f in lost)
        notes.warnings.append(
            f"{names}: no chrome ball shows the flash; the direction is from the white ball's shading."
        )
    return Aim(directions, sigma, positions, range_sigma)

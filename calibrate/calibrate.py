"""From photographs with calibration balls to lights."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calibrate.balls import Ball, find_balls
from calibrate.detect import Rejected
from calibrate.directions import angle_deg, mean_directions, mirrored_rays
from calibrate.highlight import Spots, find_spots
from calibrate.intensity import measure, propagate, read_skin, shading_directions
from calibrate.positions import LightFit, fit_lights, ray_meeting
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.frames import Frames
from scene.lights import Lights
from scene.spheres import Sphere, SphereRequest

Array = NDArray[np.float64]
NEAR_BIC = 10.0
"""How much better near lights must explain the highlights before ranges are claimed."""
MISFIRE = 0.05
"""A flash under this share of the median did not fire."""


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
        Used as they are; balls, where asked for, are then found for their masks and as a check.
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
    skins = [read_skin(balls[i].frames, camera, balls[i].sphere) for i in white]
    shaded = [shading_directions(skin) for skin in skins]
    spheres = [ball.sphere for ball in balls]
    if chrome:
        fit, seen, chosen = _from_chrome(camera, [balls[i] for i in chrome], reference, evidence, warnings, flags)
        for row, i in enumerate(chrome):
            spheres[i] = fit.spheres[row]
            shown[i, seen] = np.where(fit.used[row][:, None], chosen[row, seen], np.nan)
        directions, positions, sigma, range_sigma = _all_frames(frames, fit, seen, shaded, reference, flags, warnings)
        if shaded:
            _compare(camera, spheres[white[0]], shaded[0][0], directions, positions, evidence, warnings)
    elif shaded and np.isfinite(shaded[0][0]).all():
        directions, sigma = shaded[0]
        positions, range_sigma = None, np.full(len(frames), np.nan)
        evidence.append("distant lights, from the white ball's shading: no chrome ball")
    else:
        raise CalibrationError(
            "spheres: the white ball shows too little lit, unclipped skin to tell the lights from. Add a chrome ball, or "
            "expose so that the white ball stays below white."
        )
    intensities, intensity_sigma, ambient = np.ones((len(frames), 3)), np.full(len(frames), np.nan), None
    white_value = None
    if skins:
        intensities, intensity_sigma, ambient = _from_white(
            frames, skins, directions, positions, reference, sigma, range_sigma, flags, evidence, warnings
        )
        white_value = np.ones(3)
    else:
        warnings.append(
            "no white ball: all flashes are taken as equally bright. A flash that varies by 5 % bends normals by 2 degrees."
        )
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
    evidence = [f"{len(lights)} known lights ({lights.model}), used as they are"]
    if not requests:
        return Calibration([], lights, np.full((0, len(frames), 2), np.nan), evidence=tuple(evidence))
    try:
        balls, rejected, notes = find_balls(frames, camera, requests, progress=progress)
    except CalibrationError as error:
        return Calibration(
            [], lights, np.full((0, len(frames), 2), np.nan), evidence=tuple(evidence), warnings=(str(error),)
        )
    shown = np.full((len(balls), len(frames), 2), np.nan)
    for i, ball in enumerate(balls):
        if ball.sphere.kind == "chrome":
            shown[i] = find_spots(ball.frames, camera, ball.coarse, ball.sphere).pixels[:, 0]
            points, seen = mirrored_rays(camera, ball.sphere, shown[i])
            target = lights.directions
            if lights.positions_mm is not None and ball.sphere.diameter_mm:
                target = lights.positions_mm - points
                target = target / np.linalg.norm(target, axis=1, keepdims=True)
            evidence.append(
                f"chrome ball {i + 1} sees the known lights {np.nanmedian(angle_deg(seen, target)):.2f} degrees off (median)"
            )
    return Calibration([b.sphere for b in balls], lights, shown, rejected, tuple(evidence), notes)


def _reference(camera: Camera, spheres: list[Sphere]) -> Array:
    """Return the mean centre of the balls whose distance is known, else the origin."""
    known = [s.center_mm(camera) for s in spheres if s.diameter_mm and not camera.is_orthographic]
    return np.mean(known, axis=0) if known else np.zeros(3)


def _from_chrome(
    camera: Camera,
    balls: list[Ball],
    reference: Array,
    evidence: list[str],
    warnings: list[str],
    flags: list[list[str]],
) -> tuple[LightFit, NDArray[np.bool_], Array]:
    """Fit the lights to the highlights; return the fit, the frames that it holds, and the chosen highlights."""
    spheres = [ball.sphere for ball in balls]
    spots = [find_spots(ball.frames, camera, ball.coarse, ball.sphere) for ball in balls]
    measurable = not camera.is_orthographic and len(balls) >= 2 and all(s.diameter_mm for s in spheres)
    chosen, sigma = _agreeing(camera, spheres, spots, measurable, flags)
    seen = np.isfinite(chosen[..., 0]).any(0)
    if not seen.any():
        raise CalibrationError("spheres: no highlight of the flash was found on any chrome ball, in any frame.")
    covariances = [ball.covariance for ball in balls]

    def fit_as(near: bool) -> LightFit:
        return fit_lights(camera, spheres, covariances, chosen[:, seen], sigma[:, seen], reference, near=near)

    fit = fit_as(False)
    if measurable:
        near = fit_as(True)
        scale = max(1.0, near.reduced)
        gain = (fit.chi2_all - near.chi2_all) / scale - (near.unknowns - fit.unknowns) * np.log(near.observations)
        assert near.positions_mm is not None
        distance = np.linalg.norm(near.positions_mm - reference, axis=1) / 1000
        if gain > NEAR_BIC:
            fit = near
            evidence.append(
                f"near lights: {distance.min():.2f} to {distance.max():.2f} m from the balls (dBIC {gain:.0f} against distant)"
            )
        else:
            evidence.append(f"distant lights: ranges would not explain the highlights better (dBIC {gain:.0f})")
    elif len(balls) == 1:
        evidence.append("distant lights: one chrome ball gives directions only")
    else:
        evidence.append(
            "distant lights: ranges need "
            + ("a perspective camera" if camera.is_orthographic else "the balls' diameters")
        )
    rms = float(np.sqrt(np.nanmean(fit.residual_px**2)))
    moved = max(float(np.hypot(*(a.center_px - b.center_px))) for a, b in zip(fit.spheres, spheres, strict=True))
    evidence.append(f"highlights fit to {rms:.2f} px rms; the balls moved by at most {moved:.2f} px for it")
    if fit.reduced > 9:
        hint = (
            "check their diameters and the camera's focal length"
            if fit.positions_mm is not None
            else "near lights? Give diameter_mm and a camera"
        )
        warnings.append(
            f"the chrome balls disagree on the lights: highlights miss by {rms:.1f} px rms, {np.sqrt(fit.reduced):.1f} times "
            f"what was expected; {hint}. The stated sigma is widened accordingly."
        )
    for s, f in zip(*np.nonzero(np.isfinite(chosen[:, seen, 0]) & ~fit.used), strict=True):
        flags[int(np.flatnonzero(seen)[f])].append(f"highlight on chrome ball {s + 1} disagrees and is left out")
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
        return float(angle_deg(directions, target).max())

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


def _all_frames(
    frames: Frames,
    fit: LightFit,
    seen: NDArray[np.bool_],
    shaded: list[tuple[Array, Array]],
    reference: Array,
    flags: list[list[str]],
    warnings: list[str],
) -> tuple[Array, Array | None, Array, Array]:
    """Spread the fit over all frames; what no chrome ball saw comes from the white ball's shading."""
    count = len(frames)
    directions, sigma = np.full((count, 3), np.nan), np.full(count, np.nan)
    range_sigma = np.full(count, np.nan)
    positions = None if fit.positions_mm is None else np.full((count, 3), np.nan)
    directions[seen], sigma[seen], range_sigma[seen] = fit.directions, fit.direction_sigma_deg, fit.range_sigma
    if positions is not None:
        positions[seen] = fit.positions_mm
    lost = np.flatnonzero(~seen)
    for f in lost:
        if not shaded or not np.isfinite(shaded[0][0][f, 0]):
            raise CalibrationError(
                f"{frames.names[f]}: no chrome ball shows the flash, and no white ball tells its direction. Did it fire? "
                "Reshoot, or list the frame under frames.skip."
            )
        directions[f] = shaded[0][0][f]
        sigma[f] = max(2.0, shaded[0][1][f])
        if positions is not None:
            distance = np.median(np.linalg.norm(fit.positions_mm - reference, axis=1))
            positions[f] = reference + distance * directions[f]
            range_sigma[f] = 0.3
        flags[f].append("no highlight seen: direction from the white ball's shading")
    if len(lost):
        names = ", ".join(frames.names[f] for f in lost)
        warnings.append(f"{names}: no chrome ball shows the flash; the direction is from the white ball's shading.")
    return directions, positions, sigma, range_sigma


def _compare(
    camera: Camera,
    sphere: Sphere,
    shaded: Array,
    directions: Array,
    positions: Array | None,
    evidence: list[str],
    warnings: list[str],
) -> None:
    """Say how far the white ball's shading and the chrome balls' lights agree."""
    toward = directions
    if positions is not None and sphere.diameter_mm:
        toward = positions - sphere.center_mm(camera)
        toward = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    angle = float(np.nanmedian(angle_deg(shaded, toward)))
    evidence.append(f"the white ball's shading agrees with the chrome to {angle:.1f} degrees (median)")
    if angle > 6:
        warnings.append(
            f"the white ball's shading and the chrome balls' highlights point {angle:.0f} degrees apart (median): is the "
            "white ball matte, and are the frames linear?"
        )


def _from_white(
    frames: Frames,
    skins: list,
    directions: Array,
    positions: Array | None,
    reference: Array,
    sigma_deg: Array,
    range_sigma: Array,
    flags: list[list[str]],
    evidence: list[str],
    warnings: list[str],
) -> tuple[Array, Array, Array]:
    """Return intensities (F, 3), their relative sigma (F,) and the ambient (3,), in pixel value on the first white ball."""
    intensities, sigma, ambient = [], [], []
    for skin in skins:
        light = measure(skin, directions, positions, reference)
        bad = ~np.isfinite(light.intensities).all(1)
        if bad.any():
            names = ", ".join(np.array(frames.names)[bad][:3])
            raise CalibrationError(
                f"{names}: the white ball cannot be read ({light.clipped[bad].max():.0%} of it is clipped). Expose less, "
                "or turn the flash so that it lights the ball."
            )
        evidence.append(light.evidence)
        relative = propagate(skin, directions, positions, reference, sigma_deg, range_sigma)
        intensities.append(light.intensities)
        sigma.append(np.hypot(light.sigma, relative))
        ambient.append(light.ambient)
        if light.residual > 0.08:
            warnings.append(
                f"the white ball follows n.l only to {light.residual:.0%} of the flash: glossy, dirty, or frames not linear?"
            )
    # Other white balls may be of another gray: only what varies between frames is theirs to say.
    scale = [i.mean(0) / intensities[0].mean(0) for i in intensities]
    weight = [1 / np.maximum(s, 1e-4) ** 2 for s in sigma]
    total = np.sum(weight, axis=0)
    mean = sum(w[:, None] * i / k for w, i, k in zip(weight, intensities, scale, strict=True)) / total[:, None]
    level = mean.mean(1) / np.median(mean.mean(1))
    for f in np.flatnonzero(level < MISFIRE):
        flags[f].append(f"misfire: {level[f]:.1%} of the median flash")
        warnings.append(
            f"{frames.names[f]}: the flash did not fire (white ball at {level[f]:.1%} of the median). Reshoot, or list it "
            "under frames.skip."
        )
    return np.maximum(mean, 1e-9), 1 / np.sqrt(total), ambient[0]


def _flag_same(
    names: tuple[str, ...], directions: Array, positions: Array | None, flags: list[list[str]], warnings: list[str]
) -> None:
    """Name frames whose lights are the same: they add no information, and often a flash that was not moved."""
    for i in range(len(names)):
        for j in range(i):
            same = angle_deg(directions[i], directions[j]) < 0.2
            if same and positions is not None:
                same = np.linalg.norm(positions[i] - positions[j]) < 0.02 * np.linalg.norm(positions[i])
            if same:
                flags[i].append(f"same light as {names[j]}")
                warnings.append(f"{names[j]} and {names[i]} have the same light.")

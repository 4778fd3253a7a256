"""Distant or near lights."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Notes
from calibrate.lights.adjustment import Observed
from calibrate.lights.positions import INLIER_SIGMAS, LightFit, fit_lights
from scene.normals import unit

Array = NDArray[np.float64]
NEAR_BIC = 10.0  # how much better near lights must explain the highlights before ranges are claimed
SUSPICIOUS = 2.5  # times the stated sigmas by which highlights and outlines may miss before it is said
DOUBT = 0.5  # relative sigma of a diameter that nobody stated
DISAGREE_DEG = 0.5


def choose_model(seen: Observed, notes: Notes) -> LightFit:
    """Return the smallest model that explains the highlights; say why in `notes`.

    By BIC: near lights have one unknown more each. Diameters that nobody stated are unknown too, but for the first if
    there is none: that leaves the scale open, and so the directions at the balls' middle are all that is claimed.
    """
    camera, spheres = seen.camera, seen.spheres
    has_scale = any(s.diameter_mm for s in spheres)
    if not has_scale and seen.shading is not None:
        # Nothing says where the white balls stand: they tell the lights that no chrome ball shows.
        shown = np.asarray(np.isfinite(seen.highlights[..., 0]).any(0))
        seen = replace(seen, shading=seen.shading.only(~shown))
    distant = fit_lights(seen, near=False)
    scaled = _with_diameters(seen)
    whites = 0 if seen.shading is None else seen.shading.placed
    if camera.is_orthographic or (len(spheres) < 2 and not has_scale):
        why = "ranges need a perspective camera" if camera.is_orthographic else "one chrome ball gives directions only"
        notes.evidence.append(f"distant lights: {why}")
        return _judged(distant, notes)
    if len(spheres) + whites < 2:
        notes.evidence.append(
            "one ball gives directions only; they are what they were if the flashes are as far as the camera, "
            f"{np.linalg.norm(seen.reference) / 1000:.2f} m, to a factor of 2"
        )
        return _judged(_without_ranges(fit_lights(scaled, near=True)), notes)
    if not has_scale:
        scaled = replace(scaled, reference=np.mean([s.center_mm(camera) for s in scaled.spheres], axis=0))
    near = fit_lights(scaled, near=True)
    gain = (distant.chi2_all - near.chi2_all) / near.scale**2
    gain -= (near.unknowns - distant.unknowns) * np.log(near.observations)
    if not gain > NEAR_BIC and len(spheres) < 2:
        # Shading is too rough to tell near lights from distant ones: what is not known of the range is in sigma.
        notes.evidence.append(f"directions only: the white balls' shading does not tell the ranges (dBIC {gain:.0f})")
        return _judged(_without_ranges(near), notes)
    if not gain > NEAR_BIC:
        notes.evidence.append(f"distant lights: ranges would not explain the highlights better (dBIC {gain:.0f})")
        return _judged(distant, notes)
    nearest, farthest = near.distance_mm.min(), near.distance_mm.max()
    if has_scale:
        notes.evidence.append(
            f"near lights: {nearest / 1000:.2f} to {farthest / 1000:.2f} m from the balls (dBIC {gain:.0f} against "
            "distant)"
        )
        for i in (i for i, sphere in enumerate(spheres) if sphere.diameter_sigma):
            notes.evidence.append(
                f"chrome ball {i + 1} is {2 * near.spheres[i].radius_mm:.1f} mm across, by the highlights"
            )
        return _judged(near, notes)
    notes.evidence.append(
        f"near lights, {nearest / 2:.0f} to {farthest / 2:.0f} times the first ball's diameter away (dBIC "
        f"{gain:.0f} against distant), but no diameter_mm says how far that is"
    )
    notes.warnings.append(
        "the flashes are near, and no chrome ball has a diameter_mm: their directions hold at the balls' middle, "
        "elsewhere they are degrees off. State diameter_mm."
    )
    return _judged(_without_scale(near, seen.reference), notes)


def _without_scale(near: LightFit, reference: Array) -> LightFit:
    """Return the directions at the balls' middle, and no lengths. Where it is, the fit knows better than its start."""
    toward = near.positions_mm - np.mean([s.center_mm(near.camera) for s in near.spheres], axis=0)
    spheres = [replace(s, diameter_mm=None) for s in near.spheres]
    return replace(_without_ranges(near), spheres=spheres, reference=reference, directions=unit(toward))


def _without_ranges(near: LightFit) -> LightFit:
    """Return the directions at the reference point alone, with what an unknown range adds to their sigmas."""
    unknown = np.full(len(near.directions), np.nan)
    return replace(near, positions_mm=None, position_covariance_mm2=None, range_sigma=unknown)


def _with_diameters(seen: Observed) -> Observed:
    """Return the same with the diameters' relative sigmas. Where none is known: as if all were equally far."""
    if any(s.diameter_mm for s in seen.spheres):
        return replace(seen, diameter_sigma=np.array([s.diameter_sigma for s in seen.spheres]))
    scale = 2.0 / seen.spheres[0].radius_px
    spheres = [replace(s, diameter_mm=scale * s.radius_px) for s in seen.spheres]
    return replace(seen, spheres=spheres, diameter_sigma=np.array([0.0, *[DOUBT] * (len(spheres) - 1)]))


def _judged(fit: LightFit, notes: Notes) -> LightFit:
    """Say how well the highlights fit; widen the sigmas of lights on which the balls contradict each other."""
    rms = float(np.sqrt(np.nanmean(fit.residual_px**2)))
    radius = np.array([s.radius_px for s in fit.spheres])[:, None]
    # A mirror turns twice as far as its normal.
    miss_deg = float(np.rad2deg(np.sqrt(np.nanmean((2 * fit.residual_px / radius) ** 2))))
    notes.evidence.append(f"highlights fit to {rms:.2f} px rms, {fit.scale:.1f} times what was stated of them")
    # One wrong outline among many good highlights hides in the mean.
    outline = float(np.sqrt(fit.outline_chi2.max() / 3))
    if not (fit.misfit > SUSPICIOUS and miss_deg > DISAGREE_DEG) and outline < INLIER_SIGMAS:
        return fit
    hint = "check diameter_mm of every ball, and the camera's focal length"
    if fit.positions_mm is None and not all(s.diameter_mm for s in fit.spheres):
        hint = "near lights? Give diameter_mm and a camera"
    # The highlights' own scatter is in the sigmas already.
    times = max(fit.misfit / fit.scale, outline, 1.0)
    notes.warnings.append(
        f"the chrome balls contradict each other: highlights miss by {rms:.1f} px rms, highlights and outlines by "
        f"{max(fit.misfit, outline):.1f} times what was expected; {hint}. The stated sigmas are wider accordingly."
    )
    covariance = fit.position_covariance_mm2
    return replace(
        fit,
        direction_sigma_deg=times * fit.direction_sigma_deg,
        range_sigma=times * fit.range_sigma,
        position_covariance_mm2=None if covariance is None else times**2 * covariance,
    )

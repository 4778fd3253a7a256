"""Distant or near lights, and whose fault it is when the balls contradict each other."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Notes
from calibrate.lights.adjustment import ALONE, ObservedSpots
from calibrate.lights.positions import LightFit, fit_lights
from calibrate.silhouette.outline import difference
from scene.normals import angular_error_deg, unit

Array = NDArray[np.float64]
NEAR_BIC = 10.0
"""How much better near lights must explain the highlights before ranges are claimed, and distant ones before the lights
are called distant: a flash held by hand is near."""
CULPRIT_BIC = 16.0  # the same before one of some ten numbers, which users rarely state wrongly, is blamed
SUSPICIOUS = 2.0  # times the stated sigmas by which highlights and outlines may miss unasked; sound ones: 1.6 at most
EXPLAINS = 0.5  # share of the misfit that one suspect must explain, alone, to be named
AS_GOOD = 0.1  # of what it explains, by which other suspects may explain less and be named, too
NOTABLE = 0.02  # relative change from which a diameter or a focal length is called wrong
MANY = 0.25  # share of the highlights left out from which it is no longer the highlights' fault
DOUBT = 0.5  # relative sigma of a diameter that nobody stated
DISAGREE_DEG = 2.0
"""By how much highlights miss (rms) where a ball or the camera is wrong; on sound sessions by others 1.3 at most."""


def choose_model(seen: ObservedSpots, notes: Notes) -> LightFit:
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
        return _judged(distant, seen, notes)
    if len(spheres) + whites < 2:
        notes.evidence.append(
            "one ball gives directions only; they are what they were if the flashes are as far as the camera, "
            f"{np.linalg.norm(seen.reference) / 1000:.2f} m, to a factor of 2"
        )
        return _judged(_without_ranges(fit_lights(scaled, near=True)), seen, notes)
    if not has_scale:
        scaled = replace(scaled, reference=np.mean([s.center_mm(camera) for s in scaled.spheres], axis=0))
    near = fit_lights(scaled, near=True)
    better = distant.chi2_at(near.scale) - near.chi2_at(near.scale)
    gain = better - (near.unknowns - distant.unknowns) * np.log(near.observations)
    if not gain > NEAR_BIC:
        if better < -NEAR_BIC and len(spheres) > 1:
            notes.evidence.append(f"distant lights: near ones explain the highlights worse (chi2 by {-better:.0f})")
            return _judged(distant, seen, notes)
        # A distant light would turn the balls' parallax into an error of a doubtful outline, or of the shading.
        notes.evidence.append(f"directions only: nothing tells the ranges, and sigma holds any (dBIC {gain:.0f})")
        return _judged(_without_ranges(near), seen, notes)
    # One wrong outline among many good highlights hides in the mean.
    missed = near.misfit > SUSPICIOUS or near.outline_chi2.max() > ALONE
    if has_scale and len(spheres) > 1 and (missed or _left_out(near, seen.highlights) > MANY):
        near = _with_culprit(near, scaled, notes)
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
        return _judged(near, seen, notes)
    notes.evidence.append(
        f"near lights, {nearest / 2:.0f} to {farthest / 2:.0f} times the first ball's diameter away (dBIC "
        f"{gain:.0f} against distant), but no diameter_mm says how far that is"
    )
    notes.warnings.append(
        "the flashes are near, and no chrome ball has a diameter_mm: their directions hold at the balls' middle, "
        "elsewhere they are degrees off. State diameter_mm."
    )
    return _judged(_without_scale(near, seen.reference), seen, notes)


def _without_scale(near: LightFit, reference: Array) -> LightFit:
    """Return the directions at the balls' middle, and no lengths. Where it is, the fit knows better than its start."""
    toward = near.positions_mm - np.mean([s.center_mm(near.camera) for s in near.spheres], axis=0)
    spheres = [replace(s, diameter_mm=None) for s in near.spheres]
    return replace(_without_ranges(near), spheres=spheres, reference=reference, directions=unit(toward))


def _without_ranges(near: LightFit) -> LightFit:
    """Return the directions at the reference point alone, with what an unknown range adds to their sigmas."""
    return replace(near, positions_mm=None, position_covariance_mm2=None)


def _with_diameters(seen: ObservedSpots) -> ObservedSpots:
    """Return the same with the diameters' relative sigmas. Where none is known: as if all were equally far."""
    if any(s.diameter_mm for s in seen.spheres):
        return replace(seen, diameter_sigma=np.array([s.diameter_sigma for s in seen.spheres]))
    scale = 2.0 / seen.spheres[0].radius_px
    spheres = [replace(s, diameter_mm=scale * s.radius_px) for s in seen.spheres]
    return replace(seen, spheres=spheres, diameter_sigma=np.array([0.0, *[DOUBT] * (len(spheres) - 1)]))


class _Suspect(NamedTuple):
    """The fit in which a ball, or the focal length, is free, how far it went, relative, and what that says."""

    fit: LightFit
    change: float
    text: str


def _suspects(seen: ObservedSpots) -> Iterator[_Suspect]:
    """Free one ball's diameter after the other, then the focal length; outlines count less by themselves."""
    assert seen.diameter_sigma is not None
    for i, sphere in enumerate(seen.spheres):
        doubted = seen.diameter_sigma.copy()
        doubted[i] = DOUBT
        one = fit_lights(replace(seen, diameter_sigma=doubted), near=True)
        found = 2 * one.spheres[i].radius_mm
        text = f"chrome ball {i + 1} is {found:.1f} mm across, not {sphere.diameter_mm:g}"
        yield _Suspect(one, abs(np.log(found / (2 * sphere.radius_mm))), text)
    camera = seen.camera
    if not camera.focal_sigma:
        one = fit_lights(replace(seen, camera=replace(camera, focal_sigma=DOUBT)), near=True)
        text = f"the camera's focal length is {one.camera.fx:.0f} px, not {camera.fx:.0f}"
        yield _Suspect(one, abs(np.log(one.camera.fx / camera.fx)), text)


def _with_culprit(near: LightFit, seen: ObservedSpots, notes: Notes) -> LightFit:
    """Return the fit in which one diameter or the focal length is free, if that alone explains the rest.

    Three balls show which it is; two, only that they contradict each other: the sigmas are then as wide as the
    suspects are apart. Highlights of which all are blurred alike miss by more than was stated, too: with their common
    scale unknown, n observations to spare prefer the suspect by n log(chi^2 / chi^2 with it), which must be much.
    """
    suspects = sorted((s for s in _suspects(seen) if s.change > NOTABLE), key=lambda s: s.fit.chi2_all)
    if not suspects or suspects[0].fit.chi2_all > EXPLAINS * near.chi2_all:
        return near
    best = suspects[0].fit
    if near.freedom * np.log(near.chi2_all / best.chi2_all) < CULPRIT_BIC:
        return near
    slack = AS_GOOD * (near.chi2_all - best.chi2_all) + NEAR_BIC * best.scale**2
    equal = [s for s in suspects if s.fit.chi2_all - best.chi2_all < slack]
    guess = ", which is a guess: check diameter_mm of every ball, and the camera." if len(equal) > 1 else "."
    notes.warnings.append(
        f"the chrome balls contradict each other: highlights and outlines miss by {near.miss:.1f} times what was "
        f"expected, unless {' or '.join(s.text for s in equal)}. The lights are as if {suspects[0].text}{guess}"
    )
    turn, stretch, covariance = best.direction_sigma_deg, best.range_sigma, np.asarray(best.position_covariance_mm2)
    for other in (s.fit for s in equal[1:]):
        turn = np.hypot(turn, angular_error_deg(best.directions, other.directions) / 2)
        stretch = np.hypot(stretch, np.log(other.distance_mm / best.distance_mm) / 2)
        half = (np.asarray(other.positions_mm) - np.asarray(best.positions_mm)) / 2
        covariance = covariance + half[:, :, None] * half[:, None, :]
    return replace(best, direction_sigma_deg=turn, range_sigma=stretch, position_covariance_mm2=covariance)


def _left_out(fit: LightFit, highlights: Array) -> float:
    """Return the share of highlights that the fit does not believe, among those that it could check."""
    seen = np.isfinite(highlights[..., 0])
    shared = seen & (seen.sum(0) > 1)
    return float((shared & ~fit.used).sum() / max(shared.sum(), 1))


def _judged(fit: LightFit, seen: ObservedSpots, notes: Notes) -> LightFit:
    """Say how well the highlights fit, and which outlines they contradict."""
    for i in np.flatnonzero(fit.outline_chi2 > ALONE):
        off, times = np.abs(difference(fit.spheres[i], seen.spheres[i])).max(), np.sqrt(fit.outline_chi2[i] / 3)
        notes.warnings.append(
            f"chrome ball {i + 1}'s outline is {off:.1f} px off by the highlights, {times:.1f} times what was "
            "expected of it: it counts less. Look at its circle in the report, or check its diameter_mm."
        )
    rms = float(np.sqrt(np.nanmean(fit.residual_px**2)))
    radius = np.array([s.radius_px for s in fit.spheres])[:, None]
    # A mirror turns twice as far as its normal.
    miss_deg = float(np.rad2deg(np.sqrt(np.nanmean((2 * fit.residual_px / radius) ** 2))))
    notes.evidence.append(f"highlights fit to {rms:.2f} px rms, {fit.scale:.1f} times what was stated of them")
    if fit.misfit > SUSPICIOUS and miss_deg > DISAGREE_DEG:
        hint = (
            "check their diameters and the camera's focal length"
            if fit.positions_mm is not None or all(s.diameter_mm for s in fit.spheres)
            else "near lights? Give diameter_mm and a camera"
        )
        notes.warnings.append(
            f"the chrome balls disagree on the lights: highlights miss by {rms:.1f} px rms, "
            f"{fit.scale:.1f} times what was expected; {hint}. The stated sigma is widened accordingly."
        )
    return fit

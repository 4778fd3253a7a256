"""Distant or near lights, and whose fault it is when the balls contradict each other."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibrate.calibration import Notes
from calibrate.lights.light_fit import LightFit
from calibrate.lights.positions import fit_lights
from scene.camera import Camera
from scene.normals import angular_error_deg
from scene.spheres import Sphere

Array = NDArray[np.float64]
NEAR_BIC = 10.0
"""How much better near lights must explain the highlights before ranges are claimed."""
SUSPICIOUS = 2.5
"""Times the stated sigmas by which highlights and outlines may miss before somebody is asked why."""
EXPLAINS = 0.5
"""Share of the misfit that one suspect must explain, alone, to be named."""
NOTABLE = 0.02
"""Relative change from which a diameter or a focal length is called wrong."""
MANY = 0.25
"""Share of the highlights left out from which it is no longer the highlights' fault."""
DOUBT = 0.5
"""Relative sigma of a diameter that nobody stated."""
DISAGREE_DEG = 0.5


def choose_model(
    camera: Camera,
    spheres: list[Sphere],
    covariances: list[Array],
    highlights: Array,
    sigma_px: Array,
    reference: Array,
    notes: Notes,
    *,
    extents_px: Array | None = None,
) -> LightFit:
    """Return the smallest model that explains the highlights; say why in `notes`.

    Notes
    -----
    By BIC: near lights have one unknown more each. Diameters that nobody stated are unknown too, but for the first if
    there is none: that leaves the scale open, and so the directions at the balls' middle are all that is claimed.
    """

    def fit(near: bool = True, camera: Camera = camera, spheres=spheres, covariances=covariances, **more) -> LightFit:
        return fit_lights(
            camera,
            spheres,
            covariances,
            highlights,
            sigma_px,
            more.pop("at", reference),
            near=near,
            extents_px=extents_px,
            **more,
        )

    distant = fit(False)
    if camera.is_orthographic or len(spheres) < 2:
        why = "one chrome ball gives directions only" if len(spheres) < 2 else "ranges need a perspective camera"
        notes.evidence.append(f"distant lights: {why}")
        return _judged(distant, notes)
    scaled, doubt = _with_diameters(spheres)
    told = any(s.diameter_mm for s in spheres)
    middle = reference if told else np.mean([s.center_mm(camera) for s in scaled], axis=0)
    near = fit(True, spheres=scaled, diameter_sigma=doubt, at=middle)
    gain = (distant.chi2_all - near.chi2_all) / near.scale**2
    gain -= (near.unknowns - distant.unknowns) * np.log(near.observations)
    if not gain > NEAR_BIC:
        notes.evidence.append(f"distant lights: ranges would not explain the highlights better (dBIC {gain:.0f})")
        return _judged(distant, notes)
    if told and (near.misfit > SUSPICIOUS or _left_out(near, highlights) > MANY):
        near = _with_culprit(near, camera, scaled, covariances, doubt, fit, notes)
    assert near.positions_mm is not None
    distance = np.linalg.norm(near.positions_mm - near.reference, axis=1)
    if told:
        notes.evidence.append(
            f"near lights: {distance.min() / 1000:.2f} to {distance.max() / 1000:.2f} m from the balls "
            f"(dBIC {gain:.0f} against distant)"
        )
        for i in np.flatnonzero(doubt):
            notes.evidence.append(
                f"chrome ball {i + 1} is {2 * near.spheres[i].radius_mm:.1f} mm across, by the highlights"
            )
        return _judged(near, notes)
    notes.evidence.append(
        f"near lights, {distance.min() / 2:.0f} to {distance.max() / 2:.0f} times the first ball's diameter away (dBIC "
        f"{gain:.0f} against distant), but no diameter_mm says how far that is"
    )
    notes.warnings.append(
        "the flashes are near, and no chrome ball has a diameter_mm: their directions hold at the balls' middle, "
        "elsewhere they are degrees off. State diameter_mm."
    )
    # Where that middle is, the fit knows better than its start.
    toward = near.positions_mm - np.mean([s.center_mm(near.camera) for s in near.spheres], axis=0)
    unscaled = [replace(s, diameter_mm=None) for s in near.spheres]
    unknown = np.full(len(distance), np.nan)
    near = replace(near, spheres=unscaled, positions_mm=None, position_covariance_mm2=None, range_sigma=unknown)
    directions = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    return _judged(replace(near, directions=directions, reference=reference), notes)


def _with_diameters(spheres: list[Sphere]) -> tuple[list[Sphere], Array]:
    """Return balls that all have a diameter, and its relative sigma (S,): as if all stood equally far."""
    stated = [s.diameter_mm / s.radius_px for s in spheres if s.diameter_mm]
    scale = float(np.median(stated)) if stated else 2.0 / spheres[0].radius_px
    doubt = np.array([0.0 if s.diameter_mm else DOUBT for s in spheres])
    if not stated:
        doubt[0] = 0.0
    return [s if s.diameter_mm else replace(s, diameter_mm=scale * s.radius_px) for s in spheres], doubt


def _with_culprit(
    near: LightFit,
    camera: Camera,
    spheres: list[Sphere],
    covariances: list[Array],
    doubt: Array,
    fit: Callable[..., LightFit],
    notes: Notes,
) -> LightFit:
    """Return the fit in which one diameter, one outline or the focal length is free, if that alone explains the rest.

    Three balls tell who it is; of two, only that they contradict each other.
    """
    suspects: list[tuple[float, float, str, LightFit]] = []
    for i, sphere in enumerate(spheres):
        doubted = doubt.copy()
        doubted[i] = DOUBT
        one = fit(True, spheres=spheres, diameter_sigma=doubted)
        found = 2 * one.spheres[i].radius_mm
        text = f"chrome ball {i + 1} is {found:.1f} mm across, not {sphere.diameter_mm:g}"
        suspects.append((one.chi2_all, abs(np.log(found / (2 * sphere.radius_mm))), text, one))
        loose = list(covariances)
        loose[i] = np.eye(3) * (0.1 * sphere.radius_px) ** 2
        one = fit(True, spheres=spheres, covariances=loose, diameter_sigma=doubt)
        moved = float(np.hypot(*(one.spheres[i].center_px - sphere.center_px)))
        moved = max(moved, abs(one.spheres[i].radius_px - sphere.radius_px))
        text = f"chrome ball {i + 1}'s outline is {moved:.1f} px off"
        suspects.append((one.chi2_all, moved, text, one))
    if not camera.focal_sigma:
        one = fit(True, camera=replace(camera, focal_sigma=DOUBT), spheres=spheres, diameter_sigma=doubt)
        text = f"the camera's focal length is {one.camera.fx:.0f} px, not {camera.fx:.0f}"
        suspects.append((one.chi2_all, abs(np.log(one.camera.fx / camera.fx)), text, one))
    suspects = sorted((s for s in suspects if s[1] > NOTABLE), key=lambda s: s[0])
    if not suspects or suspects[0][0] > EXPLAINS * near.chi2_all:
        return near
    best = suspects[0]
    unit = best[3].scale ** 2
    equal = [s for s in suspects if s[0] - best[0] < 0.1 * (near.chi2_all - best[0]) + NEAR_BIC * unit]
    said = " or ".join(s[2] for s in equal)
    chosen = _unsure(best[3], [s[3] for s in equal[1:]])
    notes.warnings.append(
        f"the chrome balls contradict each other: highlights and outlines miss by {near.misfit:.1f} times what was "
        f"expected, unless {said}. The lights are as if {best[2]}"
        + (", which is a guess: check diameter_mm of every ball, and the camera." if len(equal) > 1 else ".")
    )
    return chosen


def _unsure(fit: LightFit, others: list[LightFit]) -> LightFit:
    """Widen the lights' sigmas by how far the other fits, as good as this one, have them elsewhere."""
    turn, stretch = fit.direction_sigma_deg, fit.range_sigma
    covariance = fit.position_covariance_mm2
    assert fit.positions_mm is not None
    assert covariance is not None
    for other in others:
        assert other.positions_mm is not None
        turn = np.hypot(turn, angular_error_deg(fit.directions, other.directions) / 2)
        here = np.linalg.norm(fit.positions_mm - fit.reference, axis=1)
        there = np.linalg.norm(other.positions_mm - other.reference, axis=1)
        stretch = np.hypot(stretch, np.log(there / here) / 2)
        half = (other.positions_mm - fit.positions_mm) / 2
        covariance = covariance + half[:, :, None] * half[:, None, :]
    return replace(fit, direction_sigma_deg=turn, range_sigma=stretch, position_covariance_mm2=covariance)


def _left_out(fit: LightFit, highlights: Array) -> float:
    """Return the share of highlights that the fit does not believe, among those that it could check."""
    seen = np.isfinite(highlights[..., 0])
    shared = seen & (seen.sum(0) > 1)
    return float((shared & ~fit.used).sum() / max(shared.sum(), 1))


def _judged(fit: LightFit, notes: Notes) -> LightFit:
    """Say how well the highlights fit."""
    rms = float(np.sqrt(np.nanmean(fit.residual_px**2)))
    radius = np.array([s.radius_px for s in fit.spheres])[:, None]
    # A mirror turns twice as far as its normal.
    miss_deg = float(np.rad2deg(np.sqrt(np.nanmean((2 * fit.residual_px / radius) ** 2))))
    notes.evidence.append(f"highlights fit to {rms:.2f} px rms, {fit.scale:.1f} times what was stated of them")
    if fit.misfit > SUSPICIOUS and miss_deg > DISAGREE_DEG:
        hint = (
            "check their diameters and the camera's focal length"
            if fit.positions_mm is not None
            else "near lights? Give diameter_mm and a camera"
        )
        notes.warnings.append(
            f"the chrome balls disagree on the lights: highlights miss by {rms:.1f} px rms, "
            f"{fit.scale:.1f} times what was expected; {hint}. The stated sigma is widened accordingly."
        )
    return fit

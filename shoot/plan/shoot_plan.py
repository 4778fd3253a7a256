"""The plan: which flashes, in which order, and what they give."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.predicted_lights import PredictedLights, known_alike, predict_lights
from scene.camera import Camera
from scene.lights import Lights
from shoot.plan.plan_options import AS_USUAL, PlanOptions
from shoot.plan.set_up import ObjectPixels, ShownObject, lights_at, out_of_view, places_in_reach
from shoot.plan.under_way import UnderWay
from solve.design.next_flash import choose_flashes, exchange_flashes, known_before
from solve.design.normal_information import (
    information,
    lights_covariance,
    noise_covariance,
    pulls,
    sigma_of_normals,
)

Array = NDArray[np.float64]
RAYLEIGH_MEDIAN = float(np.sqrt(2 * np.log(2)))
"""Median of an angle whose two components have the standard deviation 1."""
TOLD_BY = 3
"""Flashes that tell a normal."""
FAR_MM = 1000.0
"""Where a light without a position is put."""


class Predicted(NamedTuple):
    """What a set of flashes gives, (P,) degrees along one tangent axis; 90 where fewer than three light a pixel."""

    sigma_deg: Array
    by_noise_deg: Array  # of the photographs alone
    by_lights_deg: Array  # by what the balls leave unknown of the lights alone

    @property
    def error_deg(self) -> float:
        """Median angle between the normals and the truth that is to be expected."""
        return float(RAYLEIGH_MEDIAN * np.median(self.sigma_deg))


def light_slopes(positions: Array, reference: Array, points: Array, b: Array) -> Array:
    """Return (F, P, 4) what a sample changes by with its light's x, y, z, per mm, and log intensity.

    Notes
    -----
    A sample over its intensity is b . v r^2 / d^3, v = q - x, r = |q - reference|.
    """
    away = positions[:, None] - points
    d = np.linalg.norm(away, axis=-1, keepdims=True)
    arm = positions - reference
    r = np.linalg.norm(arm, axis=1)[:, None, None]
    along = np.einsum("fpi,pi->fp", away, b)[..., None]
    moved = b * r**2 / d**3 + 2 * along * arm[:, None] / d**3 - 3 * along * r**2 * away / d**5
    return np.concatenate([moved, along * r**2 / d**3], -1)


def joint_covariance(lights: PredictedLights) -> Array:
    """Return (F, 4, F, 4) of positions, mm, and log intensities."""
    count = len(lights.position_covariance_mm2)
    out = np.zeros((count, 4, count, 4))
    out[:, :3, :, :3] = lights.position_covariance_mm2
    out[np.arange(count), 3, np.arange(count), 3] = lights.intensity_sigma**2
    return out


def predict(pixels: ObjectPixels, shown: ShownObject, slopes: Array, covariance: Array) -> Predicted:
    """Return the normals' sigma by least squares on the samples that are seen, each with the same weight.

    `slopes` (F, P, K), `covariance` (F, K, F, K): see `solve.design.normal_information.lights_covariance`.
    """
    pull = pulls(shown.vectors, shown.seen.astype(np.float64))
    told = np.isfinite(pull[0, :, 0]) & (shown.seen.sum(0) >= TOLD_BY)
    sigma = np.full((3, len(told)), 90.0)
    if told.any():
        by_noise = noise_covariance(pull[:, told], shown.noise[:, told])
        by_lights = lights_covariance(pull[:, told], slopes[:, told], covariance)
        for row, part in enumerate((by_noise + by_lights, by_noise, by_lights)):
            sigma[row, told] = sigma_of_normals(pixels.b[told], part)
    return Predicted(*sigma)


def plan_shoot(so_far: UnderWay, options: PlanOptions) -> tuple[Lights, list[Predicted | None]]:
    """Return the flashes that one after the other help most, and what they give.

    As many as wanted, one more than there are at least.

    Parameters
    ----------
    so_far : UnderWay
        The object, the balls, and the flashes that there are.
    options : PlanOptions
        How many flashes, and where they can be.

    Returns
    -------
    lights : Lights
        First the flashes that there are already, then those that help most; as well known as the balls tell them.
    predicted : list of Predicted or None
        After each of them, with those before; None before the third.

    Raises
    ------
    SceneError
        Too few places are in reach and out of the picture.
    """
    pixels, there, n = so_far.pixels, so_far.lights, len(so_far.lights)
    camera, middle = pixels.camera, pixels.middle_mm
    candidates = out_of_view(camera, places_in_reach(options, middle, pixels.size_mm))
    placed = middle + FAR_MM * there.directions if there.positions_mm is None else there.positions_mm
    shown = pixels.under(lights_at(candidates, middle))
    if so_far.shown is not None:
        shown = ShownObject._make(map(np.concatenate, zip(so_far.shown, shown, strict=True)))
    positions = np.concatenate([placed, candidates])

    def known_lights(flashes: NDArray) -> PredictedLights:
        if n and not so_far.has_known_balls:
            return known_alike(there, positions[flashes], middle)
        return predict_lights(camera, so_far.spheres, positions[flashes], middle)

    slopes = light_slopes(positions, middle, pixels.points, pixels.b)
    # To the samples' noise comes the error of each flash's own calibration.
    own = np.einsum("fkfl->fkl", joint_covariance(known_lights(np.arange(len(positions)))))
    noise = np.sqrt(shown.noise**2 + np.maximum(np.einsum("fpk,fkl,fpl->fp", slopes, own, slopes), 0))
    rest = shown._replace(noise=noise).only(np.arange(n, len(positions)))
    start = known_before(pixels.b, information(shown.vectors[:n], noise[:n], shown.seen[:n]) if n else None)
    chosen = choose_flashes(pixels.b, start, *rest, max(options.flashes - n, 1))
    order = np.concatenate([np.arange(n), n + exchange_flashes(pixels.b, start, *rest, chosen)])
    predicted: list[Predicted | None] = [None] * min(len(order), max(TOLD_BY, n) - 1)
    for used in range(len(predicted) + 1, len(order) + 1):
        some = order[:used]
        predicted.append(predict(pixels, shown.only(some), slopes[some], joint_covariance(known_lights(some))))
    lights = replace(lights_at(positions[order], middle), direction_sigma_deg=known_lights(order).direction_sigma_deg)
    return lights, predicted


def next_flash(so_far: UnderWay, camera: Camera, lights: Lights) -> tuple[dict[str, Any], Array]:
    """Return the flash that helps a shoot most, with the object's sigma by the flashes so far.

    Parameters
    ----------
    so_far : UnderWay
    camera : Camera
        In whose pixels the balls are.
    lights : Lights
        The flashes so far, from the point from which the next one is told too.

    Returns
    -------
    flash : dict
        A row of `Lights.facts`, and sigma_deg, the object's median with it.
    sigma_deg : (P,) float64
        Without it, of each pixel.

    Raises
    ------
    SceneError
        No place in reach is out of the picture.
    """
    so_far = so_far._replace(pixels=replace(so_far.pixels, camera=camera))
    planned, (*_, now, then) = plan_shoot(so_far, replace(so_far.within(AS_USUAL), flashes=0))
    assert now is not None
    assert then is not None
    is_near = lights.positions_mm is not None
    here = lights.reference_point_mm if is_near else so_far.pixels.middle_mm
    assert planned.positions_mm is not None
    row = lights_at(planned.positions_mm[-1:], here).facts()["frames"][0]
    told = {"zenith_deg": row["zenith_deg"], "azimuth_deg": row["azimuth_deg"]}
    distance = row["distance_mm"] if is_near else None
    return told | {"distance_mm": distance, "sigma_deg": float(np.median(then.sigma_deg))}, now.sigma_deg

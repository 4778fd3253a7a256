"""The plan: which flashes, in which order, and what they give."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.predicted_lights import predict_lights
from scene.camera import Camera
from scene.lights import Lights, known_median
from shoot.plan.plan_options import AS_USUAL, PlanOptions
from shoot.plan.set_up import ShownObject, lights_at, out_of_view, places_in_reach
from shoot.plan.under_way import UnderWay
from solve.design.next_flash import choose_flashes, exchange_flashes, known_before
from solve.design.normal_information import covariance_by_weights, information, sigma_of_normals

Array = NDArray[np.float64]
TOLD_BY = 3
"""Flashes that tell a normal."""


class Predicted(NamedTuple):
    """What a set of flashes gives, degrees along one tangent axis; 90 where fewer than three light a pixel."""

    by_noise_deg: Array  # (P,) by the photographs' noise and the flashes' intensities
    by_lights_deg: float  # by the lights' directions: balls and camera turn all alike, and the normals with them

    @property
    def sigma_deg(self) -> Array:
        """(P,) by both."""
        return np.minimum(np.hypot(self.by_noise_deg, self.by_lights_deg), 90.0)

    @property
    def error_deg(self) -> float | None:
        """Median angle between the normals and the truth that is to be expected; None where most are unknown."""
        # The median of an angle (Rayleigh's), whose two components have this sigma.
        error = float(np.sqrt(2 * np.log(2)) * np.median(self.sigma_deg))
        return error if error < 90 else None


def predict(b: Array, shown: ShownObject, direction_sigma_deg: Array, intensity_sigma: float) -> Predicted:
    """Return what flashes give by least squares on the samples that are seen, each with the same weight.

    `b` (P, 3): albedo x normal. `direction_sigma_deg` (F,), `intensity_sigma`, relative: of the flashes.
    """
    noise = np.hypot(shown.noise, intensity_sigma * np.einsum("fpi,pi->fp", shown.vectors, b))
    covariance = covariance_by_weights(shown.vectors, shown.seen, noise)
    told = np.isfinite(covariance[:, 0, 0]) & (shown.seen.sum(0) >= TOLD_BY)
    sigma = np.where(told, sigma_of_normals(b, covariance), 90.0)
    return Predicted(sigma, known_median(direction_sigma_deg) or 0.0)


def plan_shoot(so_far: UnderWay, options: PlanOptions) -> tuple[Lights, list[Predicted]]:
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
    predicted : list of Predicted
        By all flashes that there are; then after each of the others, with those before.

    Raises
    ------
    SceneError
        Too few places are in reach and out of the picture.
    """
    pixels, there, n = so_far.pixels, so_far.lights, len(so_far.lights)
    camera, middle = pixels.camera, pixels.middle_mm
    candidates = out_of_view(camera, places_in_reach(options, middle, pixels.size_mm))
    placed = middle + 1000.0 * there.directions if there.positions_mm is None else there.positions_mm
    shown = pixels.under(lights_at(candidates, middle))
    if so_far.shown is not None:
        shown = ShownObject._make(map(np.concatenate, zip(so_far.shown, shown, strict=True)))
    positions = np.concatenate([placed, candidates])
    rest = shown.only(np.arange(n, len(positions)))
    told = information(*shown.only(np.arange(n)))
    chosen = choose_flashes(pixels.b, known_before(pixels.b, told), *rest, max(options.flashes - n, 1))
    order = np.concatenate([np.arange(n), n + exchange_flashes(pixels.b, told, *rest, chosen)])
    if n and not so_far.has_known_balls:
        # No ball tells of flashes to come: they are as well known as those before.
        turn, intensity = known_median(there.direction_sigma_deg), known_median(there.intensity_sigma)
        sigma = np.full(len(order), np.nan if turn is None else turn)
    else:
        known = predict_lights(camera, so_far.spheres, positions[order], middle)
        sigma, intensity = known.direction_sigma_deg, known.intensity_sigma
    parts = (shown.only(order[:used]) for used in range(max(n, 1), len(order) + 1))
    predicted = [predict(pixels.b, part, sigma, intensity or 0.0) for part in parts]
    return replace(lights_at(positions[order], middle), direction_sigma_deg=sigma), predicted


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
    planned, (now, then) = plan_shoot(so_far, replace(so_far.within(AS_USUAL), flashes=0))
    is_near = lights.positions_mm is not None
    here = lights.reference_point_mm if is_near else so_far.pixels.middle_mm
    row = planned.seen_from(here).facts()["frames"][-1]
    told = {"zenith_deg": row["zenith_deg"], "azimuth_deg": row["azimuth_deg"]}
    distance = row["distance_mm"] if is_near else None
    return told | {"distance_mm": distance, "sigma_deg": float(np.median(then.sigma_deg))}, now.sigma_deg

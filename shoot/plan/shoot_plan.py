"""The plan: which flashes, in which order, what they give, and when more no longer help."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrate.lights.predicted_lights import PredictedLights, known_alike
from scene.camera import Camera
from scene.lights import Lights
from scene.spheres import Sphere
from shoot.plan.ball_places import light_sigmas
from shoot.plan.flash_places import out_of_view, places_in_reach
from shoot.plan.flash_samples import ObjectPixels, Shown, lights_at
from shoot.plan.plan_options import AS_USUAL, PlanOptions
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
NO_LONGER = 0.01
"""Share of the error by which one more flash must lower it, mean over the next three, to be worth it."""
FEWEST = 3
LOOK_AHEAD = 8
"""Flashes beyond those wanted, to say whether they would help."""
FAR_MM = 1000.0
"""Where a light without a position is put."""


@dataclass(frozen=True)
class Predicted:
    """What a set of flashes gives.

    Parameters
    ----------
    sigma_deg : (P,) float64
        Of each pixel's normal, one tangent axis; 90 where fewer than three flashes light it.
    noise_deg, lights_deg : float
        Median over pixels: by the photographs' noise alone, by the calibration of the lights alone.
    """

    sigma_deg: Array
    noise_deg: float
    lights_deg: float

    @property
    def error_deg(self) -> float:
        """Median angle between the normals and the truth that is to be expected."""
        return float(RAYLEIGH_MEDIAN * np.median(self.sigma_deg))

    def summary(self) -> dict[str, Any]:
        """Return the numbers by their names in plan.json."""
        told = self.sigma_deg < 90
        low, middle, high = np.quantile(self.sigma_deg, [0.1, 0.5, 0.9])
        return {
            "sigma_median_deg": float(middle),
            "sigma_p10_deg": float(low),
            "sigma_p90_deg": float(high),
            "error_median_deg": self.error_deg,
            "by_noise_deg": self.noise_deg,
            "by_lights_deg": self.lights_deg,
            "told_share": float(told.mean()),
        }


@dataclass(frozen=True, eq=False)
class ShootPlan:
    """Flashes in the order in which they help most.

    Parameters
    ----------
    positions_mm : (N, 3) float64
        Camera frame: first the flashes that there are already, then those that help most; more than are wanted.
    predicted : list of N Predicted or None
        After each of them, with those before; None before the third.
    count, there : int
        How many flashes are wanted in all, and there already.
    lights : PredictedLights
        Of the first `count` flashes.
    stop_after : int or None
        How many are enough for the wanted accuracy; None: not reached, or none was wanted.
    helps_until : int
        From which number on a further flash lowers the error by under 1 %.
    """

    pixels: ObjectPixels
    spheres: list[Sphere]
    options: PlanOptions
    positions_mm: Array
    predicted: list[Predicted | None]
    count: int
    there: int
    lights: PredictedLights
    stop_after: int | None
    helps_until: int

    @property
    def flashes(self) -> int:
        """How many flashes the plan ends with: as many as wanted, fewer where fewer are enough."""
        return self.count if self.stop_after is None else max(min(self.count, self.stop_after), self.there)

    @property
    def result(self) -> Predicted | None:
        """What they give."""
        return self.predicted[self.flashes - 1]


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


def predict(pixels: ObjectPixels, shown: Shown, slopes: Array, covariance: Array) -> Predicted:
    """Return the normals' sigma by least squares on the samples that are seen, each with the same weight.

    `slopes` (F, P, K), `covariance` (F, K, F, K): see `solve.design.normal_information.lights_covariance`.
    """
    pull = pulls(shown.vectors, shown.seen.astype(np.float64))
    told = np.isfinite(pull[0, :, 0]) & (shown.seen.sum(0) >= FEWEST)
    noise, by_lights = np.full((2, len(told)), 90.0)
    sigma = np.full(len(told), 90.0)
    if told.any():
        b, pull = pixels.b[told], pull[:, told]
        by_noise = noise_covariance(pull, shown.noise[:, told])
        by_light = lights_covariance(pull, slopes[:, told], covariance)
        noise[told], by_lights[told] = sigma_of_normals(b, by_noise), sigma_of_normals(b, by_light)
        sigma[told] = sigma_of_normals(b, by_noise + by_light)
    return Predicted(sigma, float(np.median(noise)), float(np.median(by_lights)))


def own_noise(shown: Shown, slopes: Array, covariance: Array) -> Array:
    """Return (F, P) the samples' noise with the error of each flash's own calibration."""
    own = np.einsum("fkfl->fkl", covariance)
    return np.sqrt(shown.noise**2 + np.maximum(np.einsum("fpk,fkl,fpl->fp", slopes, own, slopes), 0))


def enough(errors: Sequence[float], accuracy_deg: float | None, first: int) -> tuple[int | None, int]:
    """Return after how many flashes the error (one a number of flashes from `first` on) is reached; and where it rests.

    At rest: three more flashes lower it by less than `NO_LONGER` each.
    """
    reached = next((first + n for n, error in enumerate(errors) if accuracy_deg and error <= accuracy_deg), None)
    for n in range(len(errors) - 3):
        if errors[n + 3] > errors[n] * (1 - NO_LONGER) ** 3:
            return reached, first + n
    return reached, first + len(errors) - 1


def plan_shoot(
    pixels: ObjectPixels,
    spheres: Sequence[Sphere],
    options: PlanOptions,
    *,
    so_far: UnderWay | None = None,
    look_ahead: int = LOOK_AHEAD,
) -> ShootPlan:
    """Return the flashes that one after the other help most, and what they give.

    Parameters
    ----------
    pixels : ObjectPixels
    spheres : sequence of Sphere
        Where the balls stand.
    options : PlanOptions
        How many flashes, where they can be, and the accuracy that is wanted.
    so_far : UnderWay, optional
        The shoot whose pixels and balls these are: flashes that there are already.
    look_ahead : int
        Flashes beyond those wanted, to say whether they would help.
    """
    middle, size = pixels.set_up.middle_mm, pixels.set_up.size_mm
    candidates, count = out_of_view(pixels.set_up.camera, places_in_reach(options, middle, size)), options.flashes
    shown, positions, n = pixels.under(lights_at(candidates, middle)), candidates, 0
    if so_far is not None:
        there = _placed(so_far.lights, middle)
        shown, positions, n = so_far.shown.followed_by(shown), np.concatenate([there, candidates]), len(there)

    def known_lights(flashes: NDArray) -> PredictedLights:
        if so_far is not None and not so_far.has_known_balls:
            return known_alike(so_far.lights, positions[flashes], middle)
        return light_sigmas(pixels.set_up, spheres, positions[flashes])

    slopes = light_slopes(positions, middle, pixels.points, pixels.b)
    noise = own_noise(shown, slopes, joint_covariance(known_lights(np.arange(len(positions)))))
    told = information(shown.vectors[:n], noise[:n], shown.seen[:n]) if n else None
    rest = shown.only(np.arange(n, len(positions)))
    start = known_before(pixels.b, told)
    rest = rest._replace(noise=noise[n:])
    chosen = choose_flashes(pixels.b, start, *rest, count - n)
    chosen = exchange_flashes(pixels.b, start, *rest, chosen)
    # Beyond the count, to say whether more are worth it.
    left = np.setdiff1d(np.arange(len(candidates)), chosen)
    told = information(*shown._replace(noise=noise).only(np.concatenate([np.arange(n), n + chosen])))
    then = known_before(pixels.b, told)
    more = choose_flashes(pixels.b, then, *rest.only(left), look_ahead)
    order = np.concatenate([np.arange(n), n + chosen, n + left[more]])
    predicted: list[Predicted | None] = []
    for used in range(1, len(order) + 1):
        some = order[:used]
        if used < max(FEWEST, n):
            predicted.append(None)
            continue
        predicted.append(predict(pixels, shown.only(some), slopes[some], joint_covariance(known_lights(some))))
    errors = [one.error_deg for one in predicted if one is not None]
    reached, rests = enough(errors, options.accuracy_deg, len(predicted) - len(errors) + 1)
    last = order[: max(count, n)]
    return ShootPlan(
        pixels, list(spheres), options, positions[order], predicted, len(last), n,
        known_lights(last), reached, rests,
    )  # fmt: skip


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
        zenith_deg, azimuth_deg, distance_mm, as `Lights.facts` tells them, and sigma_deg, the object's median with it.
    sigma_deg : (P,) float64
        Without it, of each pixel.

    Raises
    ------
    SceneError
        No place in reach is out of the picture.
    """
    pixels = replace(so_far.pixels, set_up=replace(so_far.pixels.set_up, camera=camera))
    options = replace(so_far.within(AS_USUAL), flashes=len(so_far.lights) + 1)
    plan = plan_shoot(pixels, so_far.spheres, options, so_far=so_far, look_ahead=0)
    now, then = plan.predicted[-2:]
    assert now is not None
    assert then is not None
    is_near = lights.positions_mm is not None
    here = lights.reference_point_mm if is_near else pixels.set_up.middle_mm
    away = plan.positions_mm[-1] - here
    x, y, z = away
    flash = {
        "zenith_deg": float(np.degrees(np.arctan2(np.hypot(x, y), z))),
        "azimuth_deg": float(np.degrees(np.arctan2(y, x)) % 360),
        "distance_mm": float(np.linalg.norm(away)) if is_near else None,
        "sigma_deg": float(np.median(then.sigma_deg)),
    }
    return flash, now.sigma_deg


def _placed(lights: Lights, middle: Array) -> Array:
    """Return the positions (F, 3) of lights; distant ones are put `FAR_MM` away."""
    return middle + FAR_MM * lights.directions if lights.positions_mm is None else lights.positions_mm

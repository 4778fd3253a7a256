"""What sessions of one set-up say of its lamps: which frame shows which, and whose camera stood elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibrate.known_lights.lamp_changes import FALSE, squares
from calibrate.known_lights.read_known import AS_THEY_ARE
from scene.camera import Camera
from scene.errors import CalibrationError
from scene.lights import Lights
from scene.reading import json_of, numbers, reading
from scene.store import Store

Array = NDArray[np.float64]
Order = NDArray[np.intp]
MISSING = -1  # in the place of a light's number
BY_PLACE = 0.5  # share of the distances between lamps that another order must leave at most, to be believed
RANGE_SIGMA = 0.1  # relative sigma of the range of near lights whose covariance is not known
CAP = 25.0  # square of the sigmas from which on a lamp that is elsewhere says no more
ELSEWHERE = 50.0  # square of the sigmas by which the median lamp of another set-up is elsewhere
TURNS = 20  # of the iteration to the camera's turn


def are_sure(sigma: Array) -> NDArray[np.bool_]:
    """Return which sigmas tell something: above 0, and known."""
    return (sigma > 0) & (sigma < np.inf)


@dataclass(frozen=True)
class MeasuredLights:
    """What one session says of the lamps; `covariance_mm2` (N, 3, 3): of near lights' positions, if that is known."""

    name: str
    lights: Lights
    camera: Camera
    covariance_mm2: Array | None = None

    @classmethod
    def read(cls, folder: str | Path) -> "MeasuredLights":
        """Read an output folder; CalibrationError: it has no lights of its own, or does not say how sure they are."""
        store = Store(Path(folder))
        if not store.path("lights.json").is_file() or not store.path("calibration.json").is_file():
            raise CalibrationError(
                f"{folder}: has no lights. Run `rgbn calibrate SESSION` or `rgbn process SESSION`, and give the folder "
                "that it writes."
            )
        path, do = store.path("calibration.json"), f"Remove it, and run `rgbn calibrate {folder}`: it is made anew."
        lights, told, covariance = store.load_lights(), json_of(path, error=CalibrationError, do=do), None
        with reading(path, "is damaged", CalibrationError, do=do):
            is_known = any(AS_THEY_ARE in text for text in told["evidence"])
            if told["position_covariance_mm2"] is not None and lights.positions_mm is not None:
                covariance = numbers(told["position_covariance_mm2"], len(lights), 3, 3)
        if is_known or not are_sure(lights.direction_sigma_deg).all():
            why = "were read from a file, not measured" if is_known else "are unknown, or of unknown sigma"
            raise CalibrationError(f"{folder}: its lights {why}. Leave this folder out.")
        return cls(str(folder), lights, store.load_camera(), covariance)

    @property
    def vectors(self) -> Array:
        """(N, 3) positions of near lights, mm; unit directions of distant ones."""
        return self.lights.directions if self.lights.positions_mm is None else self.lights.positions_mm

    @property
    def covariance(self) -> Array:
        """(N, 3, 3) of `vectors`; where it is not known, by the sigma of the directions."""
        turn = np.deg2rad(self.lights.direction_sigma_deg)[:, None, None] ** 2
        if self.lights.positions_mm is None:
            return turn * np.eye(3)
        if self.covariance_mm2 is not None:
            return self.covariance_mm2
        away = self.lights.positions_mm - self.lights.reference_point_mm
        along = away[:, :, None] * away[:, None, :]
        return turn * (np.sum(away**2, 1)[:, None, None] * np.eye(3) - along) + RANGE_SIGMA**2 * along


def of_one_set_up(
    sessions: Sequence[MeasuredLights], warnings: list[str]
) -> tuple[list[MeasuredLights], MeasuredLights]:
    """Leave out, and name, sessions of another camera or another place of it; return the rest, and whose the lamps are.

    The lamps are those of the session with the most frames; of several, of the one that lies nearest to the others.
    Raises CalibrationError: fewer than two are left.
    """
    if len(sessions) < 2:
        raise CalibrationError(f"rig: found {len(sessions)} session, expected two or more, of one set-up.")
    usual = sorted(sessions, key=lambda one: one.camera.fx / one.camera.width)[len(sessions) // 2].camera
    odd = {one.name: one.camera.difference(usual) for one in sessions}
    if any(one.lights.positions_mm is not None for one in sessions):
        odd |= {one.name: "its lights have no positions" for one in sessions if one.lights.positions_mm is None}
    alike = [one for one in sessions if not odd[one.name]]
    most = max((len(one.lights) for one in alike), default=0)
    full = [one for one in alike if len(one.lights) == most] or sessions[:1]

    def away(one: MeasuredLights) -> float:
        apart = [squares(other.vectors - one.vectors, other.covariance + one.covariance) for other in full]
        return round(float(np.minimum(apart, CAP).sum()), 6)

    base = min(full, key=away)
    odd |= {one.name: elsewhere(base, one, len(alike)) for one in alike if one is not base}
    said = [f"{name}: {why}; left out." for name, why in odd.items() if why]
    kept = [one for one in sessions if not odd[one.name]]
    if len(kept) < 2:
        raise CalibrationError(" ".join([f"rig: {len(kept)} of {len(sessions)} sessions agree, two must.", *said]))
    warnings.extend(said)
    return kept, base


def order_of(base: MeasuredLights, seen: MeasuredLights) -> Order:
    """Return which light (N,) of a session is which of N lamps: by order, unless places tell another.

    Of fewer lights than lamps places alone tell: the least sum of distances over sigmas.
    """
    from scipy.optimize import linear_sum_assignment

    offset = seen.vectors[None] - base.vectors[:, None]
    cost = np.sqrt(squares(offset, seen.covariance[None] + base.covariance[:, None]))
    order, here = np.full(len(cost), MISSING), np.arange(len(cost))
    lamps, lights = linear_sum_assignment(cost)
    order[lamps] = lights
    other = order != here
    is_told = MISSING in order or cost[here, order][other].sum() < BY_PLACE * cost[here, here][other].sum()
    return order if is_told else here


def elsewhere(base: MeasuredLights, seen: MeasuredLights, trials: int) -> str:
    """Return in words how all lights of one of `trials` sessions are elsewhere than the lamps; empty: not all are.

    A turn about the camera's centre is fitted. A lamp counts the less the farther it stays away: one that was moved by
    itself turns no camera.
    """
    from scipy.spatial.transform import Rotation
    from scipy.stats import chi2

    limit = float(chi2.isf(FALSE / trials, 3)) / 3
    order = order_of(base, seen)
    there = order != MISSING
    start, end = base.vectors[there], seen.vectors[order[there]]
    covariance = base.covariance[there] + seen.covariance[order[there]]
    square = still = squares(end - start, covariance)
    turn = Rotation.identity()
    for _ in range(TURNS):
        weights = 1 / (np.trace(covariance, axis1=1, axis2=2) * (1 + square / 9) ** 2)
        turn = Rotation.align_vectors(end, start, weights=weights)[0]
        square = squares(end - turn.apply(start), covariance)
    gain = float(np.minimum(still, CAP).sum() - np.minimum(square, CAP).sum()) / 3
    # Balls' outlines that err turn distant lights all alike; near ones they move and stretch.
    common = float(len(order)) if seen.lights.positions_mm is None else 1.0
    if np.median(square) > ELSEWHERE:
        return "all its lights are elsewhere, not by a turn of the camera: another set-up, or a wrong diameter_mm?"
    degrees = float(np.rad2deg(turn.magnitude()))
    return f"the camera was turned by {degrees:.2f} degrees, against {base.name}" if gain > common * limit else ""

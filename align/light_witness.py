"""The registered scan as a witness of the lights: what its own shading says of each light's direction and intensity.

Under the right light a matte scan shades as the photograph does. What is left over is explained by changed lights, as
where nothing but the scan tells them (`align.light_probe`); the pose is held.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.light_probe.joint_equations import JointEquations, changed
from align.pose.full_resolution import FinalEvidence, ObservedObject
from align.pose.motion import looking_along, robust_sigma
from align.pose.photographed import Photographs
from align.pose.scan_view import View
from scene.lights import Lights

Array = NDArray[np.float64]
PIXELS = 4000  # that are asked
ROUNDS = 8  # which pixels are lit hangs on the lights' directions: they are chosen again
STEP = 0.25  # the longest of a light, in radians and as a logarithm
DOUBT_DEG = 1.0  # sigma of the scan's normals: what all frames say of one is no light's fault
LOOSE = 100.0  # times its sigma, by which a light may be off that the scan contradicts
LEAST_DEG, LEAST_SHARE = 1.0, 0.05  # a turn, and a relative change of intensity, worth a word
SIGMAS = 3.0  # of light and witness together, beyond which a light is off
EXPLAINS = 0.2  # share of its frame's misfit, on sectors left out, that a change must explain


class Witness(NamedTuple):
    """What the scan says of N lights."""

    change: Array  # (N, 3), see `changed`: tangents of turns to two sides, and the intensity's logarithm
    covariance: Array  # (N, 3, 3)
    moved: NDArray[np.bool_]  # (N,) whether the change explains sectors that it was not fitted to

    @property
    def turn_deg(self) -> Array:
        """(N,): by how much the directions are off."""
        return np.rad2deg(np.arctan(np.hypot(*self.change.T[:2])))

    @property
    def brighter(self) -> Array:
        """(N,): by which the intensities are too low, relative."""
        return self.change[:, 2]

    def off(self, lights: Lights) -> NDArray[np.bool_]:
        """Return (N,), which lights the scan contradicts."""
        across, along = _sigmas(self.covariance)
        turn = np.hypot(np.rad2deg(across), np.nan_to_num(lights.direction_sigma_deg))
        share = np.hypot(along, np.nan_to_num(lights.intensity_sigma))
        off = self.turn_deg > np.maximum(LEAST_DEG, SIGMAS * turn)
        return self.moved & (off | (np.abs(self.brighter) > np.maximum(LEAST_SHARE, SIGMAS * share)))


def ask_scan(view: View, photographs: Photographs) -> Witness:
    """Return what the scan's shading at its pose says of the lights.

    Notes
    -----
    The intensities' common factor is the albedo's. The covariance is the jackknife's over sectors of the object, with
    what the changes scatter by beyond it: no object is matte.
    """
    lights = photographs.lights
    seen = ObservedObject.of(view.caster, photographs, None, count=PIXELS, cells=1, lights_known=False)
    first, doubt = FinalEvidence(seen, view.pose, 0.0), np.full(len(seen.samples.pixels), DOUBT_DEG)

    def equations(some: Lights) -> JointEquations:
        return JointEquations.about(first.under(some), doubt, near=False, pose_known=True)

    count, found = first.used.sum(1), lights
    if not count.any():
        return Witness(np.zeros((len(lights), 3)), np.tile(np.eye(3), (len(lights), 1, 1)), count > 0)
    for _ in range(ROUNDS):
        here = equations(found)
        step = here.lights_of(here.solve()[0])
        found = changed(found, step * min(1.0, STEP / max(float(np.abs(step).max()), 1e-12)), 1.0)
    here, change = equations(found), _between(lights, found)
    covariance = here.jackknife()
    gain = here.lights_held_out(_between(found, lights)).sum(0)
    # A sample that is explained misses by its own variance.
    moved = (count > 0) & (gain > EXPLAINS * (gain + count))
    witness = Witness(change, covariance, moved)
    return witness._replace(covariance=covariance + _of_the_model(witness, lights))


def refined(lights: Lights, witness: Witness) -> Lights:
    """Return the lights as they are by calibration and scan together, each as sure as it is.

    Only lights whose change explains sectors that it was not fitted to are moved. Where the scan contradicts the
    calibration it alone is believed; what is not known of a light is no bar.
    """
    moved, wide = witness.moved, np.where(witness.off(lights), LOOSE, 1.0)
    turn = np.deg2rad(np.nan_to_num(lights.direction_sigma_deg, nan=180.0)) * wide
    share = np.nan_to_num(lights.intensity_sigma, nan=1.0) * wide
    known = np.stack([turn, turn, share], -1)[..., None] ** 2 * np.eye(3) + 1e-12 * np.eye(3)
    gain = known @ np.linalg.inv(known + witness.covariance) * moved[:, None, None]
    across, along = _sigmas(known - gain @ known)
    told = [["moved by the scan's shading"] if one else [] for one in moved]
    better = changed(lights, np.einsum("nij,nj->ni", gain, witness.change), 1.0)
    return replace(
        better,
        direction_sigma_deg=np.where(moved, np.rad2deg(across), lights.direction_sigma_deg),
        intensity_sigma=np.where(moved, along, lights.intensity_sigma),
        flags=tuple((*flag, *more) for flag, more in zip(lights.flags, told, strict=True)),
    ).normalised()


def said(lights: Lights, witness: Witness) -> list[str]:
    """Return the warning that names the lights that the scan contradicts."""
    off = np.flatnonzero(witness.off(lights))
    if not len(off):
        return []
    turn, brighter = witness.turn_deg, witness.brighter
    listed = ", ".join(f"{lights.names[n]} (by {turn[n]:.1f} degrees, {brighter[n]:+.0%} intensity)" for n in off)
    return [
        f"the scan's own shading says that lights are off: {listed}. Look at their highlights; reshoot, list them "
        "under frames.skip, or let the scan correct them with --refine-lights."
    ]


def _between(one: Lights, two: Lights) -> Array:
    """Return the step (N, 3) from one set of lights to another."""
    ahead = two.directions / np.sum(one.directions * two.directions, 1, keepdims=True)
    turns = np.einsum("nak,nk->na", looking_along(one.directions)[:, :2], ahead)
    brighter = np.log(two.intensities / one.intensities).mean(1)
    return np.column_stack([turns, brighter - np.median(brighter)])


def _of_the_model(found: Witness, lights: Lights) -> Array:
    """Return (3, 3), what the changes scatter by beyond what is known of light and witness."""
    across, along = _sigmas(found.covariance)
    turn = np.median(np.deg2rad(found.turn_deg)) / np.sqrt(2 * np.log(2))
    share = robust_sigma(found.brighter)
    known = np.deg2rad(np.nan_to_num(lights.direction_sigma_deg)), np.nan_to_num(lights.intensity_sigma)
    turn_left = max(turn**2 - np.median(across**2 + known[0] ** 2), 0.0)
    share_left = max(share**2 - np.median(along**2 + known[1] ** 2), 0.0)
    return np.diag([turn_left, turn_left, share_left])


def _sigmas(covariance: Array) -> tuple[Array, Array]:
    """Return the standard deviations (N,) across, one axis, and along the lights."""
    square = np.maximum(np.einsum("nii->ni", covariance), 0)
    return np.sqrt(square[:, :2].mean(1)), np.sqrt(square[:, 2])

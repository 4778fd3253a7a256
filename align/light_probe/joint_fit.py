"""The lights that explain the photographs of a scan best, followed from a first guess.

With the pose, where nothing else tells either (`settled`); or at a pose that is held, as a witness of lights that were
calibrated (`ask_scan`): under the right light a matte scan shades as the photograph does.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.light_probe.joint_equations import JointEquations, changed, nearness_of
from align.pose.full_resolution import NEAREST_PX, SETTLED_PX, UNMODELLED, FinalEvidence, ObservedObject
from align.pose.motion import apart_px, looking_along, nudge, robust_sigma
from align.pose.outline_edges import EdgePictures
from align.pose.photographed import Photographs
from align.pose.scan_view import View
from scene.errors import AlignError
from scene.lights import Lights
from scene.normals import angular_error_deg
from scene.pose import Pose
from scene.rays import RayCaster

Array = NDArray[np.float64]
FEWEST_PIXELS = 200
ROUNDS = 30
SETTLED_DEG = 0.01
STEP_PX, STEP = 4.0, 0.25
"""The longest step of the pose; of a light, in radians and as a logarithm."""
REACH_PX = 6.0
SURE = 2.0
"""Standard errors by which near lights must predict the sectors left out better."""
KNOWN = 0.25
"""Relative sigma of their distance from which lights are taken as distant."""
UNKNOWN_DEG = 10.0
"""Sigma of a normal that the scan has not."""

PIXELS = 4000  # that are asked
WITNESS_ROUNDS = 8  # which pixels are lit hangs on the lights' directions: they are chosen again
DOUBT_DEG = 1.0  # sigma of the scan's normals: what all frames say of one is no light's fault
LOOSE = 100.0  # times its sigma, by which a light may be off that the scan contradicts
LEAST_DEG, LEAST_SHARE = 1.0, 0.05  # a turn, and a relative change of intensity, worth a word
SIGMAS = 3.0  # of light and witness together, beyond which a light is off
EXPLAINS = 0.2  # share of its frame's misfit, on sectors left out, that a change must explain


class Joint(NamedTuple):
    """Where pose and lights have settled."""

    evidence: FinalEvidence
    """At the pose, under the lights (`evidence.seen.lights`)."""
    equations: JointEquations
    near: bool

    @property
    def is_near(self) -> bool:
        """Whether near lights predict sectors of the object, left out of the fit, better than distant ones.

        And whether it is known how near: what gloss does to shading looks like lights at some distance, too.
        """
        gain = self.equations.held_out(nearness_of(self.evidence.seen.lights))
        is_better = gain.mean() > SURE * gain.std(ddof=1) / np.sqrt(len(gain))
        return bool(is_better and np.median(self.deviations()[2]) < KNOWN)

    def deviations(self) -> tuple[Array, Array, Array]:
        """Return the standard deviations (N,) of directions, degrees, one axis; of intensities and distances, relative.

        The jackknife's, the pose free with the lights. What all sectors share is allowed for as in the pose's
        covariance. The distances' are NaN of distant lights.
        """
        variance = UNMODELLED * np.einsum("nkk->nk", self.equations.jackknife())
        unknown = np.full(len(variance), np.nan)
        far = np.sqrt(variance[:, 3]) / nearness_of(self.evidence.seen.lights) if self.near else unknown
        return np.degrees(np.sqrt(variance[:, :2].mean(1))), np.sqrt(variance[:, 2]), far

    def covariance(self) -> Array:
        """Return the pose's covariance (6, 6) for `nudge`, the lights being unknown with it."""
        scales = self.evidence.steps(1.0)
        return UNMODELLED * self.equations.solve()[1] * scales * scales[:, None]


def begin(caster: RayCaster, photographs: Photographs, pose: Pose, *, count: int, cells: int) -> FinalEvidence:
    """Return the evidence of about `count` pixels at a pose; the outline is searched on `cells` across the scan."""
    seen = ObservedObject.of(
        caster, photographs, EdgePictures.of(photographs), count=count, cells=cells, lights_known=False
    )
    return FinalEvidence(seen, pose, REACH_PX)


def settled(here: FinalEvidence, sigma_deg: Array, *, near: bool, rounds: int = ROUNDS) -> Joint:
    """Return where pose and lights come to rest; `sigma_deg` (V,) is that of the scan's normals at its vertices.

    What is lit and in cast shadow, the outline's edges and the samples' scales are taken anew each round.
    """
    mesh, camera = here.seen.caster.mesh, here.seen.camera

    def equations_at(here: FinalEvidence) -> JointEquations:
        lit = here.used.any(0).sum()
        if lit < FEWEST_PIXELS:
            raise AlignError(
                f"scan: no lights explain the photographs by it: {lit} pixels are left that it says are lit (expected "
                f"at least {FEWEST_PIXELS}). It is too flat to tell the lights, or another object's. Put balls beside "
                "the object, or give lights.file."
            )
        return JointEquations.about(here, _doubt(here, sigma_deg), near=near)

    for index in range(rounds):
        equations = equations_at(here)
        every = equations.solve()[0]
        step, twist = equations.lights_of(every), every[:6]
        step *= min(1.0, STEP / max(float(np.abs(step[:, :3]).max()), 1e-12))
        twist *= min(1.0, STEP_PX / max(float(np.abs(twist).max()), 1e-12))
        pose = nudge(here.pose, twist * here.steps(1.0), here.pose.apply(mesh.center_mm))
        before = here.seen.lights
        lights = _about(_coloured(here, changed(before, step, mesh.radius_mm)), pose.apply(mesh.center_mm))
        moved = apart_px(mesh, camera, here.pose, pose)
        turned = float(angular_error_deg(lights.directions, before.directions).max())
        here = here.under(lights).renewed(pose, reach_px=max(NEAREST_PX, REACH_PX / 2 ** (index + 1)))
        if moved < SETTLED_PX and turned < SETTLED_DEG:
            break
    return Joint(here, equations_at(here), near)


def _doubt(here: FinalEvidence, sigma_deg: Array) -> Array:
    """Return the sigma (P,) of the scan's normals at the samples, degrees."""
    seen = here.seen
    hits = View(seen.caster, seen.camera, here.pose).hits(seen.samples.pixels)
    return np.nan_to_num(hits.interpolate(seen.caster.mesh, sigma_deg[:, None])[:, 0], nan=UNKNOWN_DEG)


def _about(lights: Lights, point: Array) -> Lights:
    """Return the lights with what was found of them, from the object, put about where the object is now."""
    shift = point - lights.reference_point_mm
    positions = None if lights.positions_mm is None else lights.positions_mm + shift
    return replace(lights, positions_mm=positions, reference_point_mm=point)


def _coloured(here: FinalEvidence, lights: Lights) -> Lights:
    """Return the lights each with its colour: what its frame shows beside the pixels' own colours, in the median."""
    known = here.seen.lights.intensities
    some = here.used.any(0)
    shown = np.log(np.maximum(here.seen.samples.colours[:, some] / known[:, None], 1e-6))
    shown = np.where(here.used[:, some, None], shown - shown.mean(2, keepdims=True), np.nan)
    beside = np.ma.masked_invalid(shown - np.nanmean(shown, 0))
    tint = np.ma.median(beside, axis=1).filled(0.0)
    return replace(lights, intensities=lights.intensities * np.exp(tint)).normalised()


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
    for _ in range(WITNESS_ROUNDS):
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

"""The lights that explain the photographs of a scan best, followed with its pose from a first guess."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from align.light_probe.joint_equations import JointEquations, changed, nearness_of
from align.pose.full_resolution import NEAREST_PX, SETTLED_PX, UNMODELLED, FinalEvidence, ObservedObject
from align.pose.motion import apart_px, nudge
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
KNOWN = 0.25
"""Relative sigma of their distance from which lights are taken as distant."""
UNKNOWN_DEG = 10.0
"""Sigma of a normal that the scan has not."""


class Joint(NamedTuple):
    """Where pose and lights have settled."""

    evidence: FinalEvidence
    """At the pose, under the lights (`evidence.seen.lights`)."""
    equations: JointEquations
    near: bool

    @property
    def is_near(self) -> bool:
        """Whether it is known how near the lights are, and with that that they are near."""
        return bool(np.median(self.deviations()[2]) < KNOWN)

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

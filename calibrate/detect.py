"""Every ball in the frames, without clicks: standing circles, told apart by how their insides behave."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.candidates import find_circles, static_edges
from calibrate.circles import LEAST_SCORE, alike, outermost, overlap, rank
from calibrate.coarse import Coarse
from calibrate.kind import Behaviour, observe
from calibrate.outline import refine_on_edges
from calibrate.silhouette import OutlineFit, fit_outline
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

SURE_SCORE = 0.6
"""What nobody asked for must show this much of its outline."""


@dataclass(frozen=True)
class Rejected:
    """A circle that is not taken for a ball, or not for the one asked for; `reason` says why."""

    center_px: NDArray[np.float64]
    radius_px: float
    score: float
    reason: str


@dataclass(frozen=True)
class Found:
    """A ball: its outline in full-size pixels, and how its inside behaves."""

    fit: OutlineFit
    behaviour: Behaviour

    @property
    def sphere(self) -> Sphere:
        return self.fit.sphere


def detect(
    frames: Frames,
    camera: Camera,
    coarse: Coarse,
    *,
    wanted: dict[Kind, int] | None = None,
    taken: tuple[Sphere, ...] = (),
) -> tuple[list[Found], tuple[Rejected, ...]]:
    """Find the balls.

    Parameters
    ----------
    frames : Frames
    camera : Camera
    coarse : Coarse
        The same frames, shrunk.
    wanted : dict or None
        How many of each kind were asked for; None: whatever there is.
    taken : tuple of Sphere
        Balls that are known already; circles on them are left alone.

    Returns
    -------
    found : list of Found
        The surest first. Never more of a kind than were wanted.
    rejected : tuple of Rejected
        Circles that looked like balls and are none, with the reason.
    """
    votes = static_edges(coarse.images)
    edges = np.stack([votes.real, votes.imag], -1)
    suspects, rejected = _suspects(coarse, edges, [coarse.from_full(s) for s in taken])
    if wanted is not None:
        suspects, surplus = _choose(suspects, wanted)
    else:
        suspects, surplus = _sure(suspects)
    rejected += surplus
    found = []
    for sphere, behaviour in suspects:
        full = replace(
            sphere, center_px=coarse.to_full(sphere.center_px), radius_px=float(sphere.radius_px * coarse.factor)
        )
        fit = fit_outline(frames, camera, full, search_px=1.4 * coarse.factor + 0.6)
        if fit is None:
            rejected.append((sphere, "its outline cannot be followed at full size"))
        else:
            found.append(Found(fit, behaviour))
    out = [
        Rejected(coarse.to_full(s.center_px), s.radius_px * coarse.factor, s.score, reason) for s, reason in rejected
    ]
    return found, tuple(sorted(out, key=lambda r: -r.score))


Suspect = tuple[Sphere, Behaviour]
Reasons = list[tuple[Sphere, str]]


def _suspects(coarse: Coarse, edges: NDArray[np.float32], taken: list[Sphere]) -> tuple[list[Suspect], Reasons]:
    """Return the circles that behave like balls, one per place, and those that do not."""
    refined = []
    for circle in find_circles(coarse.images):
        start = Sphere("chrome", np.array([circle.u, circle.v]), circle.radius)
        sphere = refine_on_edges(edges, coarse.camera, start)
        if sphere.score >= LEAST_SCORE and not any(overlap(sphere, other) for other in taken):
            refined.append(sphere)
    refined.sort(key=rank, reverse=True)
    suspects: list[Suspect] = []
    rejected: Reasons = []
    for sphere in refined:
        if any(overlap(sphere, other) for other, _ in suspects):
            continue
        behaviour = observe(coarse, sphere)
        if behaviour is None:
            continue
        if behaviour.kind == "chrome":
            sphere, behaviour = outermost(coarse, edges, sphere, behaviour)
            if any(overlap(sphere, other) for other, _ in suspects):
                continue
        if behaviour.kind is None:
            if not any(overlap(sphere, other) for other, _ in rejected):
                rejected.append((sphere, behaviour.reason))
            continue
        suspects.append((replace(sphere, kind=behaviour.kind), behaviour))
    inside = [s for s, _ in suspects]
    return suspects, [(s, r) for s, r in rejected if not any(overlap(s, other) for other in inside)]


def _choose(suspects: list[Suspect], wanted: dict[Kind, int]) -> tuple[list[Suspect], Reasons]:
    """Take as many of each kind as were asked for: those that show most outline and agree on the lights."""
    left: Reasons = []
    pool = []
    for suspect in suspects:
        if wanted.get(suspect[0].kind, 0):
            pool.append(suspect)
        else:
            left.append((suspect[0], f"behaves like a {suspect[0].kind} ball, but none was asked for"))
    total = sum(wanted.values())

    def worth(suspect: Suspect) -> float:
        others = sorted((alike(suspect[1], other[1]) for other in pool if other is not suspect), reverse=True)
        agreement = np.mean(others[: max(1, total - 1)]) if others else 1.0
        return rank(suspect[0]) * (0.3 + max(0.0, float(agreement)))

    taken: list[Suspect] = []
    for suspect in sorted(pool, key=worth, reverse=True):
        kind = suspect[0].kind
        if sum(s[0].kind == kind for s in taken) < wanted[kind]:
            taken.append(suspect)
        else:
            left.append((suspect[0], f"behaves like a {kind} ball, but the {wanted[kind]} asked for fit better"))
    return taken, left


def _sure(suspects: list[Suspect]) -> tuple[list[Suspect], Reasons]:
    """Without requests: what shows most of its outline, behaves clearly, and agrees with the others."""
    taken: list[Suspect] = []
    left: Reasons = []
    for sphere, behaviour in suspects:
        if sphere.score < SURE_SCORE:
            left.append((sphere, f"only {sphere.score:.0%} of its outline stands still (expected {SURE_SCORE:.0%})"))
        elif sphere.kind == "white" and behaviour.lambert < 0.95:
            left.append((sphere, f"shading follows n.l only to {behaviour.lambert:.0%} (expected 95 % unasked)"))
        elif taken and max(alike(behaviour, other) for _, other in taken) < 0.8:
            left.append((sphere, "its highlights do not move as those of the other balls"))
        else:
            taken.append((sphere, behaviour))
    return taken, left

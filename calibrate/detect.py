"""Every ball in the frames, without clicks: standing circles, told apart by how their insides behave."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calibrate.candidates import find_circles, static_edges, without_albedo
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

SAME_LIGHTS = 0.7
"""Share of the frames in which two balls must see the lights alike."""


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
    suspects, rejected = _suspects(coarse, [coarse.from_full(s) for s in taken])
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


def _suspects(coarse: Coarse, taken: list[Sphere]) -> tuple[list[Suspect], Reasons]:
    """Return the circles that behave like balls, one per place, and those that do not."""
    refined = []
    maps = []
    for images in (coarse.images, without_albedo(coarse.images)):
        votes = static_edges(images)
        edges = np.stack([votes.real, votes.imag], -1)
        maps.append(edges)
        for circle in find_circles(images):
            start = Sphere("chrome", np.array([circle.u, circle.v]), circle.radius)
            sphere = refine_on_edges(edges, coarse.camera, start)
            if sphere.score >= LEAST_SCORE and not any(overlap(sphere, other) for other in taken):
                refined.append(sphere)
    edges = maps[0]
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
        sphere, behaviour = suspect
        if wanted.get(sphere.kind, 0):
            pool.append(suspect)
        elif sphere.kind == "white" and behaviour.has_point and wanted.get("chrome", 0):
            pool.append((replace(sphere, kind="chrome"), behaviour))  # a glossy ball, asked for as a mirror
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
        else:
            taken.append((sphere, behaviour))
    agree = np.array([[alike(a, b) for _, b in taken] for _, a in taken])
    kept = list(range(len(taken)))
    while len(kept) > 1:
        # Who agrees with fewer than half of the others goes, the least agreeable first.
        votes = [sum(agree[i, k] >= SAME_LIGHTS for k in kept if k != i) / (len(kept) - 1) for i in kept]
        worst = min(range(len(kept)), key=lambda n: (votes[n], rank(taken[kept[n]][0])))
        if votes[worst] >= 0.5:
            break
        left.append((taken[kept[worst]][0], "its highlights do not move as those of the other balls"))
        del kept[worst]
    return [taken[i] for i in kept], left

"""Which of the circles that behave like balls are taken: those asked for, or those that are sure."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrate.detection.ball_kind import Behaviour, alike
from calibrate.detection.circles import rank
from calibrate.silhouette.outline import inside_picture
from scene.camera import Camera
from scene.spheres import Kind, Sphere

SURE_SCORE = 0.6  # what nobody asked for must show this much of its outline,
SURE_SHADING = 0.95  # follow n.l to this share of its variance if it is a matte ball,
SURE_FLATTER = 0.005  # and no flatter body's shading may explain so much more of it
SHADES = 0.975  # from here on its shading alone makes it a ball, whatever others say
SAME_LIGHTS = 0.7  # share of the frames in which two balls must see the lights alike
WHOLE = 0.95  # share of its outline in the picture under which a ball is cut by the border
LONE_WORTH = 0.3  # what a circle is worth that agrees with no other on the lights, of one that agrees with all: 1.3


@dataclass(frozen=True)
class Suspect:
    """A circle, coarse pixels, that behaves like a ball."""

    sphere: Sphere
    behaviour: Behaviour
    others: Sequence[Sphere] = ()  # circles that stand about as still and may be its outline, the likeliest first

    @property
    def hidden(self) -> bool:
        """Whether it shows too little of its outline to be taken without being asked for."""
        return self.sphere.score < SURE_SCORE


Reasons = list[tuple[Sphere, str]]


def asked_for(suspects: list[Suspect], wanted: dict[Kind, int]) -> tuple[list[Suspect], Reasons]:
    """Take as many of each kind as were asked for: those that show most outline and agree on the lights."""
    left: Reasons = []
    pool = []
    for suspect in suspects:
        sphere = suspect.sphere
        if wanted.get(sphere.kind, 0):
            pool.append(suspect)
        elif sphere.kind == "white" and suspect.behaviour.points.wander and wanted.get("chrome", 0):
            pool.append(replace(suspect, sphere=replace(sphere, kind="chrome")))  # glossy, and asked for as a mirror
        else:
            left.append((sphere, f"behaves like a {sphere.kind} ball, but none was asked for"))
    total = sum(wanted.values())

    def worth(suspect: Suspect) -> float:
        others = sorted((alike(suspect.behaviour, o.behaviour) for o in pool if o is not suspect), reverse=True)
        agreement = np.mean(others[: max(1, total - 1)]) if others else 1.0
        return rank(suspect.sphere) * (LONE_WORTH + max(0.0, float(agreement)))

    taken: list[Suspect] = []
    for suspect in sorted(pool, key=worth, reverse=True):
        kind = suspect.sphere.kind
        if sum(s.sphere.kind == kind for s in taken) < wanted[kind]:
            taken.append(suspect)
        else:
            left.append((suspect.sphere, f"behaves like a {kind} ball, but the {wanted[kind]} asked for fit better"))
    return taken, left


def sure_ones(suspects: list[Suspect], camera: Camera) -> tuple[list[Suspect], Reasons]:
    """Without requests: what shows most of its outline, behaves clearly, and agrees with the others."""
    reasons = [_unsure(suspect, camera) for suspect in suspects]
    left = [(one.sphere, reason) for one, reason in zip(suspects, reasons, strict=True) if reason]
    taken = [one for one, reason in zip(suspects, reasons, strict=True) if not reason]
    agree = np.array([[alike(a.behaviour, b.behaviour) for b in taken] for a in taken])
    kept = list(range(len(taken)))
    while len(kept) > 1:
        # Who agrees with fewer than half of the others goes, the least agreeable first.
        votes = [sum(agree[i, k] >= SAME_LIGHTS for k in kept if k != i) / (len(kept) - 1) for i in kept]
        # A matte ball is one by its own shading, a mirror is one by what the others say: of two that disagree it goes.
        votes = [max(vote, 1.0 * (taken[i].behaviour.lambert >= SHADES)) for vote, i in zip(votes, kept, strict=True)]
        worst = min(range(len(kept)), key=lambda n: (votes[n], rank(taken[kept[n]].sphere)))
        if votes[worst] >= 0.5:
            break
        left.append((taken[kept[worst]].sphere, "its highlights do not move as those of the other balls"))
        del kept[worst]
    return [taken[i] for i in kept], left


def _unsure(suspect: Suspect, camera: Camera) -> str | None:
    """Say why a suspect is not taken without being asked for."""
    sphere, seen = suspect.sphere, suspect.behaviour
    if sphere.kind == "white" and (seen.lambert < SURE_SHADING or seen.flatness > SURE_FLATTER):
        return f"shading follows n.l only to {seen.lambert:.0%}, a flatter body's {seen.flatness:+.1%}"
    if not suspect.hidden:
        return None
    share = float(np.mean(inside_picture(camera, sphere.outline(camera, 180))))
    if share < WHOLE:
        return f"it is cut by the border: {share:.0%} of its outline is in the picture"
    return f"only {sphere.score:.0%} of its outline stands still (expected {SURE_SCORE:.0%})"

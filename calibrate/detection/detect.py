"""Every ball in the frames, without clicks: standing circles, told apart by how their insides behave."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.ball_kind import FLATTER, Behaviour, Points, bright_points, changes, observe
from calibrate.detection.choice import Reasons, Suspect, asked_for, poor, sure_ones
from calibrate.detection.circles import by_points, overlap, rank, standing_circles
from calibrate.detection.coarse import Coarse
from calibrate.silhouette.ball_silhouette import OutlineFit, fit_outline
from calibrate.silhouette.mirror_outline import DOUBTED, LEAST_ENCLOSED, around, enclosing, outline_of, what_stands
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

THREADS = 2
"""Outlines that are fitted side by side."""
OTHERS = 3
"""Circles that are tried in a mirror's place where the likeliest does not show the table beside it."""


@dataclass(frozen=True)
class Rejected:
    """A circle that is not taken for a ball, or not for the one asked for; `reason` says why."""

    center_px: NDArray[np.float64]
    radius_px: float
    score: float
    reason: str


@dataclass(frozen=True)
class Found:
    """A ball: its outline in full-size pixels, how its inside behaves, and a circle that may be its outline instead."""

    fit: OutlineFit
    behaviour: Behaviour
    rival: Sphere | None = None

    @property
    def sphere(self) -> Sphere:
        return self.fit.sphere

    @property
    def warning(self) -> str | None:
        """What to tell of a mirror whose outline is not sure."""
        if self.rival is None:
            return None
        (u, v), radius, other = self.sphere.center_px, self.sphere.radius_px, self.rival.radius_px
        return (
            f"chrome ball at ({u:.0f}, {v:.0f}) px: taken with a radius of {radius:.0f} px, but a circle of "
            f"{other:.0f} px stands as still. Look at the picture; center_px and radius_px in session.toml decide."
        )


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
        suspects, surplus = asked_for(suspects, wanted)
    else:
        suspects, surplus = sure_ones(suspects, coarse.camera)
    rejected += surplus
    found = []
    places = [[coarse.sphere_to_full(s) for s in (suspect.sphere, *suspect.others)] for suspect in suspects]
    with ThreadPoolExecutor(THREADS) as threads:
        fits = list(threads.map(partial(_outline, frames, camera, search_px=1.4 * coarse.factor + 0.6), places))
    for suspect, circles, fit in zip(suspects, places, fits, strict=True):
        if fit is None:
            rejected.append((suspect.sphere, "its outline cannot be followed at full size"))
        else:
            open_ = suspect.doubtful and not fit.by_table
            found.append(Found(fit, suspect.behaviour, circles[1] if open_ else None))
    out = [
        Rejected(coarse.to_full(s.center_px), s.radius_px * coarse.factor, s.score, reason) for s, reason in rejected
    ]
    return found, tuple(sorted(out, key=lambda r: -r.score))


def _outline(frames: Frames, camera: Camera, circles: list[Sphere], *, search_px: float) -> OutlineFit | None:
    """Fit the likeliest circle, the first; but a mirror's is that in which it shows the table beside it."""
    first = None
    for number, circle in enumerate(circles[: 1 + OTHERS]):
        fit = fit_outline(frames, camera, circle, search_px=search_px)
        if fit is not None and fit.by_table:
            return fit
        if number == 0:
            first = fit
    return first


def _suspects(coarse: Coarse, taken: list[Sphere]) -> tuple[list[Suspect], Reasons]:
    """Return the circles that behave like balls, one per place, and those that do not."""
    change = changes(coarse.images)
    candidates: list[tuple[Sphere, Points]] = []
    for sphere in standing_circles(coarse):
        if not any(overlap(sphere, other) for other in taken):
            points = bright_points(change, sphere)
            candidates += [] if points is None else [(sphere, points)]
    suspects: list[Suspect] = []
    rejected: Reasons = []
    standing = what_stands(coarse)
    for group in by_points([c for c in candidates if c[1].wander]):
        circles, doubtful = outline_of(group, standing, coarse.camera)
        sphere, points = circles[0]
        if any(overlap(sphere, other.sphere) for other in suspects):
            continue
        share = enclosing(standing, coarse.camera, sphere)
        if sphere.score * share < DOUBTED:
            for wider in around(standing, coarse.camera, sphere):
                seen = bright_points(change, wider)
                better = enclosing(standing, coarse.camera, wider) > share + 0.03
                group += [(wider, seen)] if better and seen is not None and seen.wander else []
            circles, doubtful = outline_of(group, standing, coarse.camera)
            sphere, points = circles[0]
            share = enclosing(standing, coarse.camera, sphere)
        if any(overlap(sphere, other.sphere) for other in suspects):
            continue
        if share < LEAST_ENCLOSED:
            rejected.append((sphere, "nothing that a mirror would show stands along its inside"))
            continue
        behaviour = observe(coarse, sphere, points)
        if behaviour.kind == "chrome":
            others = tuple(replace(other, kind="chrome") for other, _ in circles[1:])
            suspects.append(Suspect(replace(sphere, kind="chrome"), behaviour, others, doubtful))
    flat: list[Suspect] = []
    for sphere, points in sorted(candidates, key=lambda c: -rank(c[0])):
        # A mirror that shows too little of its outline to be one leaves its place to what else stands there.
        if any(overlap(sphere, o.sphere) and not (o.sphere.kind == "chrome" and poor(o)) for o in suspects):
            continue
        behaviour = observe(coarse, sphere, points)
        if behaviour.flatness > FLATTER:
            flat.append(Suspect(sphere, behaviour))
        # Half beside its own outline a pebble may pass for a ball that shades less well.
        beside = any(overlap(sphere, f.sphere) and f.behaviour.lambert > behaviour.lambert for f in flat)
        if behaviour.kind == "white" and not beside:
            suspects.append(Suspect(replace(sphere, kind="white"), behaviour))
        elif not any(overlap(sphere, other) for other, _ in rejected):
            rejected.append((sphere, behaviour.reason))
    return suspects, [(s, r) for s, r in rejected if not any(overlap(s, other.sphere) for other in suspects)]

"""Every ball in the frames, without clicks: circles of static edges, judged by how their insides behave."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.ball_kind import FLATTER, Behaviour, Change, bright_points, changes, observe
from calibrate.detection.choice import Reasons, Suspect, asked_for, sure_ones
from calibrate.detection.circles import distinct, overlap, rank, static_circles
from calibrate.detection.coarse import Box, Coarse
from calibrate.detection.mirror_outline import (
    Candidate,
    by_mirrored_table,
    by_points,
    circles_about,
    static_slopes,
)
from calibrate.silhouette.ball_silhouette import OutlineFit, fit_outline
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

THREADS = 2  # outlines that are fitted side by side
SMALL_PX = 20.0  # radius under which the flash's image is so blurred that a mirror is asked on less evidence
LEAST_SUPPORT = 0.5  # share of a mirror's outline that must stand still where no table is seen in it
AS_STILL = 0.9  # of the same, from which on it is open which of two circles is the outline
OTHERS = 3  # circles that are tried in a mirror's place where the likeliest does not show the table beside it
HINT_SIDE, HINT_MARGIN_PX = 1.3, 4  # radii, and pixels, around a hint that are looked into; `HINT_LEAST_PX` at least
HINT_LEAST_PX = 24
MOST_HINTED = 3  # circles about a hint, of which two may be a mirror's outlines


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
        """The caution that belongs to a mirror whose outline is not sure."""
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
    """Find the balls: the surest first, never more of a kind than were wanted; and the circles that are none.

    `coarse` holds the same frames, shrunk. `wanted`: how many of each kind were asked for; None: whatever there is.
    Circles on the balls that are `taken` already are left alone.
    """
    suspects, rejected = _suspects(frames, camera, coarse, [coarse.from_full(s) for s in taken])
    suspects, surplus = sure_ones(suspects, coarse.camera) if wanted is None else asked_for(suspects, wanted)
    rejected += surplus
    found = []
    places = [[coarse.sphere_to_full(s) for s in (suspect.sphere, *suspect.others)] for suspect in suspects]
    with ThreadPoolExecutor(THREADS) as threads:
        fits = list(threads.map(partial(_outline, frames, camera, search_px=coarse.search_px), places))
    for suspect, circles, fit in zip(suspects, places, fits, strict=True):
        if fit is None:
            rejected.append((suspect.sphere, "its outline cannot be followed at full size"))
        else:
            rivals = [] if fit.by_table else circles[1:]
            found.append(Found(fit, suspect.behaviour, rivals[0] if rivals else None))
    full = ((coarse.sphere_to_full(sphere), reason) for sphere, reason in rejected)
    out = [Rejected(sphere.center_px, sphere.radius_px, sphere.score, reason) for sphere, reason in full]
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


def _suspects(frames: Frames, camera: Camera, coarse: Coarse, taken: list[Sphere]) -> tuple[list[Suspect], Reasons]:
    """Return the circles that behave like balls, one per place, and those that do not."""
    change = changes(coarse)
    candidates: list[Candidate] = []
    for sphere in static_circles(coarse):
        if not any(overlap(sphere, other) for other in taken):
            points = bright_points(change, sphere)
            candidates += [] if points is None else [(sphere, points)]
    mirrors = [c for c in candidates if c[1].wander or (c[1].may_wander and c[0].radius_px < SMALL_PX)]
    suspects, rejected = _mirrors(frames, camera, coarse, change, mirrors)
    flat: list[Suspect] = []
    for sphere, points in sorted(candidates, key=lambda c: -rank(c[0])):
        # A mirror that shows too little of its outline to be one leaves its place to what else is there.
        if any(overlap(sphere, o.sphere) and not (o.sphere.kind == "chrome" and o.hidden) for o in suspects):
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


def _mirrors(
    frames: Frames, camera: Camera, coarse: Coarse, change: list[Change], candidates: list[Candidate]
) -> tuple[list[Suspect], Reasons]:
    """Return the mirrors among circles that may show the light as a wandering point, and those that are none."""
    suspects: list[Suspect] = []
    rejected: Reasons = []
    static = static_slopes(coarse)
    for group in by_points(candidates):
        seed = group[0][0]
        if any(overlap(seed, other.sphere) for other in suspects):
            continue
        circles = circles_about(static, seed) or [seed]
        table = by_mirrored_table(frames, camera, [coarse.sphere_to_full(c) for c in circles], blur_px=coarse.factor)
        if table is not None:
            circles = [coarse.from_full(table)]
        for sphere in circles[: 1 + OTHERS]:
            if table is None and sphere.score < LEAST_SUPPORT:
                continue
            points = bright_points(change, sphere)
            if points is not None and (points.wander or (table is not None and points.may_wander)):
                break
        else:
            rejected.append((seed, "no circle about its bright points is a mirror's outline"))
            continue
        behaviour = observe(coarse, sphere, points, mirrors=table is not None)
        if behaviour.kind == "chrome":
            as_still = max(LEAST_SUPPORT, AS_STILL * sphere.score)
            others = [replace(c, kind="chrome") for c in circles if c is not sphere and c.score > as_still]
            suspects.append(Suspect(replace(sphere, kind="chrome"), behaviour, others))
    return suspects, rejected


def around_hint(coarse: Coarse, hint: Sphere, *, reach_px: float) -> list[Sphere]:
    """Return circles of static edges, full-size pixels, near a circle given by hand; the best supported first.

    Centre and radius may lie `reach_px`, full-size, from the hint's.
    """
    small, reach = coarse.from_full(hint), reach_px / coarse.factor
    side = HINT_SIDE * small.radius_px + 2 * reach + HINT_MARGIN_PX
    left, top = corner = np.maximum(np.floor(small.center_px - side), 0).astype(int)
    right, bottom = np.ceil(small.center_px + side).astype(int) + 1
    box = Box(slice(top, bottom), slice(left, right))
    if min(coarse.images[0][box].shape) < HINT_LEAST_PX:
        return []
    crop = coarse.crop(box)

    def near(sphere: Sphere) -> bool:
        off = np.hypot(*(sphere.center_px + corner - small.center_px))
        return bool(max(off, abs(sphere.radius_px - small.radius_px)) < reach)

    circles = [sphere for sphere in static_circles(crop) if near(sphere)]
    found = distinct(circles)[:MOST_HINTED]
    if hint.kind == "chrome":
        about = circles_about(static_slopes(crop), replace(small, center_px=small.center_px - corner))
        found = distinct([circle for circle in about if near(circle)][:2] + found[:1])
    return [coarse.sphere_to_full(replace(s, kind=hint.kind, center_px=s.center_px + corner)) for s in found]

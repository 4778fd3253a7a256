"""Circles of standing edges: which are one and the same, and which see the same lights."""

import numpy as np
from numpy.typing import NDArray

from calibrate.detection.ball_kind import Behaviour
from calibrate.detection.candidates import find_circles, static_edges, without_albedo
from calibrate.detection.coarse import Coarse
from calibrate.silhouette.mirror_outline import Candidate
from calibrate.silhouette.outline import refine_on_edges
from scene.spheres import Sphere

LEAST_SCORE = 0.5
"""A circle that less of its outline supports is not looked into."""

SAME_POINTS = 0.7
"""Share of the frames in which circles of one mirror show the light at one place."""
STRETCHES, BALLS_STRETCH = 0.6, 0.28
"""Logarithms of the scales that are tried, and of those that two balls under near lights show."""
CLEARLY = 0.6
"""Share of the best ball's residual under which a stretched track fits clearly better."""
ALIKE = 0.13
"""How far, in radii, a highlight may lie from where another ball has it: lights at unequal distances do that."""


def rank(sphere: Sphere) -> float:
    """A long outline is more evidence than a short one of the same share."""
    return sphere.score**2 * sphere.radius_px**0.25


def distinct(spheres: list[Sphere]) -> list[Sphere]:
    """Return the circles that differ by more than a pixel, the best supported first."""
    kept: list[Sphere] = []
    for s in sorted(spheres, key=rank, reverse=True):
        if all(np.hypot(*(s.center_px - k.center_px)) + abs(s.radius_px - k.radius_px) > 1 for k in kept):
            kept.append(s)
    return kept


def overlap(a: Sphere, b: Sphere) -> bool:
    """Whether two circles cover each other more than two balls that touch would."""
    return float(np.hypot(*(a.center_px - b.center_px))) < 0.85 * (a.radius_px + b.radius_px)


def standing_circles(coarse: Coarse) -> list[Sphere]:
    """Return the circles of standing edges, in the photographs and in the same without their albedo, coarse pixels."""
    found = []
    for images in (coarse.images, without_albedo(coarse.images)):
        votes = static_edges(images)
        edges = np.stack([votes.real, votes.imag], -1)
        for circle in find_circles(images, votes):
            start = Sphere("chrome", np.array([circle.u, circle.v]), circle.radius)
            sphere = refine_on_edges(edges, coarse.camera, start)
            if sphere.score >= LEAST_SCORE:
                found.append(sphere)
    return found


def by_points(candidates: list[Candidate]) -> list[list[Candidate]]:
    """Return groups of circles that show the light at the same places: one mirror, its outline and what it mirrors."""
    groups: list[list[Candidate]] = []
    places: list[NDArray[np.float64]] = []
    for sphere, points in sorted(candidates, key=lambda c: -rank(c[0])):
        here = sphere.center_px + sphere.radius_px * points.track
        for group, there in zip(groups, places, strict=True):
            if np.mean(np.hypot(*(here - there).T) < 2) >= SAME_POINTS:
                group.append((sphere, points))
                break
        else:
            groups.append([(sphere, points)])
            places.append(here)
    return groups


def alike(a: Behaviour, b: Behaviour) -> float:
    """Return the share of frames in which two balls see the lights alike, 0 to 1.

    Notes
    -----
    Where each frame's half-way normal lies on the one disc is predicted from where it lies on the other by a scale
    and a shift: near lights move the track by some tenths of the radius and scale it a little. A circle that is not
    the ball's outline, and a body that is no ball, stretch the track: a mirror half as high as it is wide by a half. So
    where only such a scale fits, none of the frames counts. A shadow on a ball spoils single frames.
    """
    first, second = _track(a), _track(b)
    best: dict[bool, tuple[float, float]] = {True: (np.inf, 0.0), False: (np.inf, 0.0)}
    for scale in np.exp(np.linspace(-STRETCHES, STRETCHES, 25)):
        shift = second - scale * first
        residual = np.hypot(*(shift - np.median(shift, axis=0)).T)
        near = bool(abs(np.log(scale)) <= BALLS_STRETCH)
        share = float(np.mean(residual < ALIKE * max(1.0, scale)))
        best[near] = (min(best[near][0], float(np.median(residual))), max(best[near][1], share))
    stretched = best[False][0] < CLEARLY * best[True][0] and best[False][1] >= best[True][1]
    return 0.0 if stretched else best[True][1]


def _track(behaviour: Behaviour) -> NDArray[np.float64]:
    """Return where the light's half-way normal lies on the unit disc, (F, 2), v down."""
    if behaviour.kind == "chrome":
        return behaviour.points.track
    half = behaviour.directions + [0.0, 0.0, 1.0]
    return half[:, :2] * [1, -1] / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)

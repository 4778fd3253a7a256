"""Every ball in the frames, without clicks: standing circles, told apart by how their insides behave."""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.candidates import find_circles, static_edges
from calibrate.coarse import Coarse
from calibrate.kind import Behaviour, observe
from calibrate.outline import refine_on_edges
from calibrate.silhouette import OutlineFit, fit_outline
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

LEAST_SCORE = 0.5
"""A circle that less of its outline supports is not looked into."""
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


def around_hint(coarse: Coarse, hint: Sphere, *, reach_px: float) -> list[Sphere]:
    """Return circles of standing edges, full-size pixels, near a circle given by hand; the best supported first.

    Parameters
    ----------
    coarse : Coarse
    hint : Sphere
        Full-size pixels.
    reach_px : float
        How far centre and radius may lie from the hint's, full-size pixels.
    """
    small, reach = coarse.from_full(hint), reach_px / coarse.factor
    side = 1.3 * small.radius_px + 2 * reach + 4
    left, top = np.maximum(np.floor(small.center_px - side), 0).astype(int)
    right, bottom = np.ceil(small.center_px + side).astype(int) + 1
    images = coarse.images[:, top:bottom, left:right]
    if min(images.shape[1:]) < 24:
        return []
    corner = np.array([left, top], np.float64)
    camera = replace(
        coarse.camera,
        width=images.shape[2],
        height=images.shape[1],
        cx=coarse.camera.cx - left,
        cy=coarse.camera.cy - top,
    )
    crop = Coarse(images, camera, coarse.factor)
    small = replace(small, center_px=small.center_px - corner)
    votes = static_edges(images)
    edges = np.stack([votes.real, votes.imag], -1)

    def near(sphere: Sphere) -> bool:
        off = np.hypot(*(sphere.center_px - small.center_px))
        return bool(max(off, abs(sphere.radius_px - small.radius_px)) < reach)

    starts = [replace(small, center_px=np.array([c.u, c.v]), radius_px=c.radius) for c in find_circles(images)]
    refined = [refine_on_edges(edges, camera, start) for start in starts if near(start)]
    found: list[Sphere] = []
    for sphere in _distinct([s for s in refined if s.score >= LEAST_SCORE])[:3]:
        if hint.kind == "chrome":
            behaviour = observe(crop, sphere)
            if behaviour is not None and behaviour.kind == "chrome":
                sphere, _ = _outermost(crop, edges, sphere, behaviour)
        if near(sphere):
            found.append(sphere)
    found = _distinct(found)
    return [
        replace(s, center_px=coarse.to_full(s.center_px + corner), radius_px=float(s.radius_px * coarse.factor))
        for s in found
    ]


Suspect = tuple[Sphere, Behaviour]
Reasons = list[tuple[Sphere, str]]


def _suspects(coarse: Coarse, edges: NDArray[np.float32], taken: list[Sphere]) -> tuple[list[Suspect], Reasons]:
    """Return the circles that behave like balls, one per place, and those that do not."""
    refined = []
    for circle in find_circles(coarse.images):
        start = Sphere("chrome", np.array([circle.u, circle.v]), circle.radius)
        sphere = refine_on_edges(edges, coarse.camera, start)
        if sphere.score >= LEAST_SCORE and not any(_overlap(sphere, other) for other in taken):
            refined.append(sphere)
    refined.sort(key=_rank, reverse=True)
    suspects: list[Suspect] = []
    rejected: Reasons = []
    for sphere in refined:
        if any(_overlap(sphere, other) for other, _ in suspects):
            continue
        behaviour = observe(coarse, sphere)
        if behaviour is None:
            continue
        if behaviour.kind == "chrome":
            sphere, behaviour = _outermost(coarse, edges, sphere, behaviour)
            if any(_overlap(sphere, other) for other, _ in suspects):
                continue
        if behaviour.kind is None:
            if not any(_overlap(sphere, other) for other, _ in rejected):
                rejected.append((sphere, behaviour.reason))
            continue
        suspects.append((replace(sphere, kind=behaviour.kind), behaviour))
    inside = [s for s, _ in suspects]
    return suspects, [(s, r) for s, r in rejected if not any(_overlap(s, other) for other in inside)]


def _rank(sphere: Sphere) -> float:
    """A long outline is more evidence than a short one of the same share."""
    return sphere.score**2 * sphere.radius_px**0.25


def _distinct(spheres: list[Sphere]) -> list[Sphere]:
    """Return the circles that differ by more than a pixel, the best supported first."""
    kept: list[Sphere] = []
    for s in sorted(spheres, key=_rank, reverse=True):
        if all(np.hypot(*(s.center_px - k.center_px)) + abs(s.radius_px - k.radius_px) > 1 for k in kept):
            kept.append(s)
    return kept


def _overlap(a: Sphere, b: Sphere) -> bool:
    """Whether two circles cover each other more than two balls that touch would."""
    return float(np.hypot(*(a.center_px - b.center_px))) < 0.85 * (a.radius_px + b.radius_px)


def _outermost(
    coarse: Coarse, edges: NDArray[np.float32], sphere: Sphere, behaviour: Behaviour
) -> tuple[Sphere, Behaviour]:
    """Return the outermost standing circle around a mirror's.

    A chrome ball shows the rim of the table as a dark disc with a sharper edge than its own outline, which
    differs from the table beside it only by the metal's reflectance. Whatever is mirrored lies inside.
    """
    enough = 0.85 * sphere.score
    for _ in range(6):
        best = None
        for start in _larger(edges, sphere):
            grown = refine_on_edges(edges, coarse.camera, start)
            gain = grown.radius_px - sphere.radius_px
            holds = np.hypot(*(grown.center_px - sphere.center_px)) < gain + 1.5
            if gain > 0.7 and holds and grown.score >= enough and (best is None or grown.score > best.score):
                best = grown
        if best is None:
            break
        seen = observe(coarse, best)
        if seen is None or seen.kind != "chrome":
            break
        sphere, behaviour, enough = best, seen, max(enough, 0.85 * best.score)
    return sphere, behaviour


def _larger(edges: NDArray[np.float32], sphere: Sphere, most: int = 8) -> list[Sphere]:
    """Return the circles around a circle that most evidence runs along, from a grid of radii and shifts."""
    gain = np.arange(0.04, 0.61, 0.03)[:, None] * sphere.radius_px
    angle = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    shift = np.vstack([[[0.0, 0.0]], *(k * np.stack([np.cos(angle), np.sin(angle)], -1) for k in (0.35, 0.7, 1.0))])
    centers = (sphere.center_px + gain[..., None] * shift).reshape(-1, 2)
    radii = np.broadcast_to(sphere.radius_px + gain, (len(gain), len(shift))).ravel()
    around = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    normals = np.stack([np.cos(around), np.sin(around)], -1)
    where = (centers[:, None] + radii[:, None, None] * normals).astype(np.float32)
    sampled = cv2.remap(edges, where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    evidence = sampled[..., 0] * np.cos(2 * around) + sampled[..., 1] * np.sin(2 * around)
    score = np.clip(evidence / 0.3, -0.3, 1).mean(1)
    chosen: list[int] = []
    for i in np.argsort(-score):
        apart = [np.hypot(*(centers[i] - centers[k])) + abs(radii[i] - radii[k]) for k in chosen]
        if not chosen or min(apart) > 0.08 * sphere.radius_px:
            chosen.append(int(i))
        if len(chosen) == most:
            break
    return [replace(sphere, center_px=centers[i], radius_px=float(radii[i])) for i in chosen]


def _alike(a: Behaviour, b: Behaviour) -> float:
    """Return how alike two balls see the lights move, -1 to 1: near lights shift and shrink the track, no more."""
    first, second = _track(a), _track(b)
    first, second = first - first.mean(0), second - second.mean(0)
    return float(np.sum(first * second) / max(np.linalg.norm(first) * np.linalg.norm(second), 1e-12))


def _track(behaviour: Behaviour) -> NDArray[np.float64]:
    """Return where the light's half-way normal lies on the unit disc, (F, 2), v down."""
    if behaviour.kind == "chrome":
        return behaviour.track
    half = behaviour.directions + [0.0, 0.0, 1.0]
    return half[:, :2] * [1, -1] / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)


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
        others = sorted((_alike(suspect[1], other[1]) for other in pool if other is not suspect), reverse=True)
        agreement = np.mean(others[: max(1, total - 1)]) if others else 1.0
        return _rank(suspect[0]) * (0.3 + max(0.0, float(agreement)))

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
        elif taken and max(_alike(behaviour, other) for _, other in taken) < 0.8:
            left.append((sphere, "its highlights do not move as those of the other balls"))
        else:
            taken.append((sphere, behaviour))
    return taken, left

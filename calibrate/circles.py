"""Circles of standing edges: which are one and the same, and which of a mirror's rings is its outline."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.coarse import Coarse
from calibrate.kind import Behaviour, observe
from calibrate.outline import refine_on_edges
from scene.spheres import Sphere

LEAST_SCORE = 0.5
"""A circle that less of its outline supports is not looked into."""

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


def outermost(
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


def alike(a: Behaviour, b: Behaviour) -> float:
    """Return the share of frames in which two balls see the lights alike, 0 to 1.

    Notes
    -----
    Where each frame's half-way normal lies on the one disc is predicted from where it lies on the other by a scale
    and a shift: near lights move the track by some tenths of the radius and scale it a little. A circle that is not
    the ball's outline, and a body that is no ball, stretch the track; a shadow on a ball spoils single frames.
    """
    first, second = _track(a), _track(b)
    share = 0.0
    for scale in np.arange(0.75, 1.34, 0.05):
        shift = second - scale * first
        residual = np.hypot(*(shift - np.median(shift, axis=0)).T)
        share = max(share, float(np.mean(residual < ALIKE * max(1.0, scale))))
    return share


def _track(behaviour: Behaviour) -> NDArray[np.float64]:
    """Return where the light's half-way normal lies on the unit disc, (F, 2), v down."""
    if behaviour.kind == "chrome":
        return behaviour.track
    half = behaviour.directions + [0.0, 0.0, 1.0]
    return half[:, :2] * [1, -1] / np.maximum(np.linalg.norm(half, axis=1, keepdims=True), 1e-9)

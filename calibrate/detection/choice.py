"""Which circles are taken for balls: the set that is likeliest, by what each shows and by how they agree on the lights.

The log-odds of a set are the sum of its circles' own, each linear in a few features of its kind, and of its pairs',
linear in how far both see the same lights; no two of a set may stand at one place. The weights are in
ball_weights.toml, which names the program that fitted them to scenes of two generators: logistic regression of whether
a circle is a ball, given the true other balls (pseudo-likelihood [Besag1975]).

A light that one ball shows lies on its mirrored ray, and the other sees that ray. The balls stand on one table, so
their distances from the camera are taken as one, and the only length that is unknown is the light's range along the
ray. What the other ball may show is an arc, some ten degrees long and, but for the errors of both, as thin as a line:
few things that are no balls keep to it in frame after frame.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from calibrate.detection.circles import overlap
from calibrate.detection.coarse import Coarse
from calibrate.detection.evidence import Change, Shaded, brightest
from calibrate.lights.directions import USUAL_FOCAL, arc_miss_deg, mirrored_rays
from calibrate.silhouette.mirrored_fit import MirroredTable
from calibrate.silhouette.mirrored_surroundings import sized
from scene.camera import Camera
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
Weights = Mapping[str, Mapping[str, Any]]
WEIGHTS = Path(__file__).with_name("ball_weights.toml")
FEATURES: dict[Kind, tuple[str, ...]] = {
    "chrome": ("one", "table", "explained", "support", "area", "shading", "inside", "radius"),
    "white": ("one", "shading", "flatter", "taller", "support", "radius"),
}
"""What is seen of a circle, in the order of the weights."""
EACH = 2  # circles of one kind that overlap and are considered
LIKELIEST, HOPELESS = 60, -6.0  # circles that are considered, and log-odds of their own under which none is
STARTS = 10  # circles from which the likeliest set is sought
MATTE_DEG, MIRROR_DEG, OUTLINE_PX = 4.0, 2.0, 0.5
"""Errors of a direction by shading, by a mirror, and of an outline, coarse px: that turns what a small mirror shows."""
FEWEST = 2  # frames in which both show a light


class Rays(NamedTuple):
    """Where a circle would see each frame's light if it were a ball whose distance is the camera's focal length."""

    center: Array  # (3,)
    directions: Array  # (F, K, 3) unit, K places where the light may be
    shown: NDArray[np.bool_]  # (F, K)
    sigma_deg: float


@dataclass(frozen=True)
class Suspect:
    """A circle, coarse pixels, that may be a ball of its kind."""

    sphere: Sphere
    like: Kind  # which kind's features it has: a glossy ball that is asked for as a mirror is like a white one
    features: Array  # those of `FEATURES`
    rays: Rays
    glossy: bool = False  # it shows the light as a wandering point
    table: MirroredTable | None = None  # that it mirrors

    @property
    def doubt(self) -> str:
        """What speaks against it, in words."""
        seen = dict(zip(FEATURES[self.like], self.features, strict=True))
        if self.like == "chrome":
            return "" if seen["table"] else "it does not mirror the table beside it"
        if seen["flatter"] > 0:
            return "it shades like a flatter body than a ball (a dome, a pebble)"
        shading = 1 - np.exp(-seen["shading"])
        return f"shading follows n.l to {shading:.1%}, and {self.sphere.score:.0%} of its outline stands still"


@dataclass(frozen=True)
class Judged:
    """A circle and its log-odds to be a ball, given the balls that are taken."""

    suspect: Suspect
    log_odds: float

    @property
    def probability(self) -> float:
        return float(expit(self.log_odds))


@cache
def fitted() -> Weights:
    """Return the weights of ball_weights.toml."""
    return tomllib.loads(WEIGHTS.read_text())


def own_log_odds(suspect: Suspect, weights: Weights | None = None) -> float:
    """Return the log-odds that a circle is a ball, by what it shows itself."""
    return float(suspect.features @ (weights or fitted())["ball"][suspect.like])


def considered(suspects: Sequence[Suspect]) -> list[Suspect]:
    """Return the suspects without those that are worse than `EACH` others at their place.

    What mirrors the table comes first.
    """
    quality = fitted()["circle"]
    kept: list[Suspect] = []
    for one in sorted(suspects, key=lambda s: (s.table is None, -float(s.features @ quality[s.like]))):
        same = sum(one.like == o.like and overlap(one.sphere, o.sphere) for o in kept)
        if same < EACH:
            kept.append(one)
    return kept


def choose(
    suspects: Sequence[Suspect], wanted: Mapping[Kind, int] | None, weights: Weights | None = None
) -> tuple[list[Judged], list[Judged]]:
    """Return the circles of the likeliest set, and all others.

    `wanted`: the numbers of each kind that were asked for, an upper limit and a reason to believe; None: whatever is
    likelier than not.
    """
    weights = weights or fitted()
    own = np.array([own_log_odds(s, weights) for s in suspects])
    order = [n for n in np.argsort(-own, kind="stable")[:LIKELIEST] if own[n] > HOPELESS]
    some = [suspects[n] for n in order]
    pairs, exclusive = _pairs(some, weights["pair"])
    free = own[order]
    asked = np.array([bool(wanted is None or wanted.get(s.sphere.kind)) for s in some], bool)
    score = free if wanted is None else np.where(asked, free + weights["ball"]["asked"], -np.inf)
    taken = _likeliest(score, pairs, exclusive, [s.sphere.kind for s in some], wanted)
    judged = [
        Judged(s, float(score[n] if n in taken else free[n]) + sum(pairs[n, m] for m in taken if not exclusive[n, m]))
        for n, s in enumerate(some)
    ]
    return [judged[n] for n in taken], [judged[n] for n in range(len(some)) if n not in taken]


def _pairs(suspects: Sequence[Suspect], weights: Mapping[str, Any]) -> tuple[Array, NDArray[np.bool_]]:
    """Return the pairs' log-odds (N, N), and which (N, N) exclude each other; so does each itself."""
    count = len(suspects)
    pairs, exclusive = np.zeros((count, count)), np.eye(count, dtype=bool)
    for n, a in enumerate(suspects):
        for m, b in enumerate(suspects[:n]):
            exclusive[n, m] = exclusive[m, n] = overlap(a.sphere, b.sphere)
            if not exclusive[n, m]:
                kinds = " and ".join(sorted((a.like, b.like)))
                pairs[n, m] = pairs[m, n] = float(agreement(a.rays, b.rays) @ weights[kinds])
    return pairs, exclusive


def _likeliest(
    score: Array, pairs: Array, exclusive: NDArray[np.bool_], kinds: list[Kind], wanted: Mapping[Kind, int] | None
) -> list[int]:
    """Return the set of highest log-odds, by steps that add, exchange or remove one circle, from several starts."""
    able = [int(n) for n in np.argsort(-score, kind="stable") if np.isfinite(score[n])]
    best: list[int] = []
    for start in ([], *([n] for n in able[:STARTS])):
        chosen, before = start, None
        while chosen != before:
            before, steps = chosen, [[m for m in chosen if m != n] for n in chosen]
            for n in (n for n in able if n not in chosen):
                free = [m for m in chosen if not exclusive[n, m]]
                same = [m for m in free if kinds[m] == kinds[n]]
                is_full = wanted is not None and len(same) >= wanted.get(kinds[n], 0)
                steps += [[*(m for m in free if m != out), n] for out in (same if is_full else [-1])]
            chosen = max([chosen, *steps], key=lambda one: _total(score, pairs, one))
        best = max(best, chosen, key=lambda one: _total(score, pairs, one))
    return best


def _total(score: Array, pairs: Array, chosen: list[int]) -> float:
    """Return a set's log-odds."""
    return float(score[chosen].sum() + pairs[np.ix_(chosen, chosen)].sum() / 2)


def _seen_by(camera: Camera) -> Camera:
    """Return the camera, or a usual one in place of an orthographic one that stands for an unknown one."""
    if not camera.is_orthographic or camera.source != "assumed":
        return camera
    focal = USUAL_FOCAL * camera.width
    return Camera(camera.width, camera.height, focal, focal, (camera.width - 1) / 2, (camera.height - 1) / 2)


def mirror_rays(coarse: Coarse, changes: list[Change], sphere: Sphere) -> Rays:
    """Return where a mirror, coarse pixels, would see the lights."""
    camera = _seen_by(coarse.camera)
    pixels, shown = brightest(changes, sphere)
    _, directions = mirrored_rays(camera, sized(sphere), pixels)
    shown &= np.isfinite(directions[..., 0])
    sigma = float(np.hypot(MIRROR_DEG, np.rad2deg(2 * OUTLINE_PX / sphere.radius_px)))
    return Rays(_center(camera, sphere), np.nan_to_num(directions), shown, sigma)


def matte_rays(coarse: Coarse, sphere: Sphere, seen: Shaded) -> Rays:
    """Return where a matte ball, coarse pixels, sees the lights by its shading."""
    center = _center(_seen_by(coarse.camera), sphere)
    return Rays(center, seen.directions[:, None], seen.lit[:, None], MATTE_DEG)


def _center(camera: Camera, sphere: Sphere) -> Array:
    """Return where the ball is; an orthographic camera is so far away that all are at one place."""
    return np.zeros(3) if camera.is_orthographic else sized(sphere).center_mm(camera)


def agreement(a: Rays, b: Rays) -> Array:
    """Return (2,), how far two balls see the same lights, and how far they do not.

    Notes
    -----
    With e = exp(-(miss / sigma)^2 / 2) a frame, these are sqrt(n) mean(e) and sqrt(n) mean(1 - e) over the n frames
    in which both show a light: frames err alike, so n frames count as sqrt(n). 0 where n is less than two.
    """
    both = a.shown.any(1) & b.shown.any(1)
    if both.sum() < FEWEST:
        return np.zeros(2)
    miss = arc_miss_deg(a.center, a.directions, b.center, b.directions)
    miss = np.where(a.shown[:, :, None] & b.shown[:, None], miss, np.inf).min((1, 2))[both]
    agree = float(np.mean(np.exp(-0.5 * (miss / np.hypot(a.sigma_deg, b.sigma_deg)) ** 2)))
    return np.sqrt(len(miss)) * np.array([agree, 1 - agree])

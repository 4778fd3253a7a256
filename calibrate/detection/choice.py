"""Which circles are taken for balls: the set that is likeliest, by what each shows and by how they agree on the lights.

The log-odds of a set are the sum of its circles' own, each linear in a few features of its kind, and of its pairs',
linear in how far both see the same lights; no two of a set may stand at one place. The weights are in
ball_weights.toml, which names the program that fitted them to scenes of two generators: logistic regression of whether
a circle is a ball, given the true other balls (pseudo-likelihood [Besag1975]).
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from calibrate.detection.agreement import Rays, agreement
from calibrate.detection.circles import overlap
from calibrate.silhouette.mirrored_table import MirroredTable
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


def considered(suspects: Sequence[Suspect]) -> list[Suspect]:
    """Return the suspects without those that are worse than `EACH` others at their place."""
    quality = fitted()["circle"]
    kept: list[Suspect] = []
    for one in sorted(suspects, key=lambda s: -float(s.features @ quality[s.like])):
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
    own = np.array([float(s.features @ weights["ball"][s.like]) for s in suspects])
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

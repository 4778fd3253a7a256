"""Which circles are taken for balls, by what each shows.

A circle's log-odds are linear in a few features of its kind; no two balls may stand at one place. The weights are in
ball_weights.toml, which names the program that fitted them to scenes of two generators by logistic regression: which of
the circles at one place is the outline, and whether that is a ball.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from calibrate.detection.circles import overlap
from calibrate.silhouette.mirrored_table import MirroredTable
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
WEIGHTS = Path(__file__).with_name("ball_weights.toml")
FEATURES: dict[Kind, tuple[str, ...]] = {
    "chrome": ("one", "table", "explained", "support", "area", "shading", "inside", "radius"),
    "white": ("one", "shading", "flatter", "taller", "support", "radius"),
}
"""What is seen of a circle, in the order of the weights."""


@dataclass(frozen=True)
class Suspect:
    """A circle, coarse pixels, that may be a ball of its kind."""

    sphere: Sphere
    like: Kind  # which kind's features it has: a glossy ball that is asked for as a mirror is like a white one
    features: Array  # those of `FEATURES`
    glossy: bool = False  # it shows the light as a wandering point
    others: Sequence[Sphere] = field(default=())  # circles that stand about as still and may be its outline, in order
    table: MirroredTable | None = None  # that it mirrors

    @property
    def log_odds(self) -> float:
        """Of being a ball."""
        return float(self.features @ weights()["ball"][self.like])

    @property
    def probability(self) -> float:
        return float(expit(self.log_odds))

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


@cache
def weights() -> Mapping[str, Mapping[str, Any]]:
    """Return the weights of ball_weights.toml."""
    return tomllib.loads(WEIGHTS.read_text())


def choose(suspects: Sequence[Suspect], wanted: Mapping[Kind, int] | None) -> tuple[list[Suspect], list[Suspect]]:
    """Return the circles that are likelier balls than not, and the likeliest others, each at a place of its own.

    `wanted`: the numbers of each kind that were asked for, an upper limit and a reason to believe; None: whatever is
    likelier than not.
    """
    outlines: list[Suspect] = []
    for one in sorted(suspects, key=lambda s: -float(s.features @ weights()["circle"][s.like])):
        if not any(one.like == other.like and overlap(one.sphere, other.sphere) for other in outlines):
            outlines.append(one)
    taken: list[Suspect] = []
    left: list[Suspect] = []
    for one in sorted(outlines, key=lambda s: -s.log_odds):
        kind = one.sphere.kind
        if any(overlap(one.sphere, other.sphere) for other in taken):
            continue
        asked = wanted is None or sum(other.sphere.kind == kind for other in taken) < wanted.get(kind, 0)
        needed = 0.0 if wanted is None else -weights()["ball"]["asked"]
        if asked and one.log_odds > needed:
            taken.append(one)
        elif not any(overlap(one.sphere, other.sphere) for other in left):
            left.append(one)
    return taken, [one for one in left if not any(overlap(one.sphere, other.sphere) for other in taken)]

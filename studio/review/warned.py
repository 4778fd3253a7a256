"""Warnings of the steps, with the frames and the ball that each is about, and the tab on which it stands."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from scene.spheres import Sphere

STEPS = {"Capture": "check", "Balls": "calibrate", "Lights": "calibrate", "Scan": "align", "Solve": "solve",
         "Twin": "twin", "Verdict": "compare"}  # fmt: skip
"""The tabs of a session, each with the step of `lab.plan` up to which its button runs."""


@dataclass(frozen=True)
class Warned:
    """A warning of a step.

    frames: That it names, in the order in which it names them.
    ball: That it names first.
    """

    step: str
    text: str
    frames: tuple[int, ...] = ()
    ball: int | None = None


def targets(texts: Sequence[tuple[str, str]], names: Sequence[str], spheres: Sequence[Sphere]) -> list[Warned]:
    """Return warnings, each with its step, and what they name.

    names: The frames'. spheres: In the order in which `spheres.json` has them, which is that of "ball 2" in a text.
    """
    return [Warned(step, text, _frames(text, names), _ball(text, spheres)) for step, text in texts]


def _frames(text: str, names: Sequence[str]) -> tuple[int, ...]:
    """Return the frames whose names stand in a text as whole words."""
    # flash_1 is not named by flash_12, nor by flash_1.5; flash_1.dng names it.
    found = [re.search(rf"(?<![\w.-]){re.escape(name)}(?!\w|-\w|\.\d)", text) for name in names]
    return tuple(index for _, index in sorted((match.start(), index) for index, match in enumerate(found) if match))


def _ball(text: str, spheres: Sequence[Sphere]) -> int | None:
    """Return the ball that a text names by its number or its place among its kind, or as the only one of it."""
    numbered = re.search(r"\b(chrome|white) ball (?:(\d+)|at \((-?\d+), (-?\d+)\) px)", text)
    named = numbered or re.search(r"\b(?:the|one) (chrome|white) ball\b()()()", text)
    if named is None:
        return None
    kind, number, u, v = named.groups()
    own = [index for index, sphere in enumerate(spheres) if sphere.kind == kind]
    if u:
        place = [float(u), float(v)]
        return next((i for i in own if abs(spheres[i].center_px - place).max() < spheres[i].radius_px), None)
    # Numbers count the balls of one kind.
    at = int(number) - 1 if number else 0
    return own[at] if 0 <= at < len(own) and (number or len(own) == 1) else None

"""The rows of a session's balls: chosen, measured, moved, added, removed."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from draw.readable import readable, share
from scene.spheres import KINDS, Kind
from studio.session.ball_edits import Balls, added, circle_of, moved, of_kind, resized
from studio.session.session_window import SessionWindow
from studio.widgets import Row, button, text

ALL = "(all)"
MILLIMETRES: dict[str, Any] = {"value": 0.0, "min": 0.0, "max": 10_000.0, "step": 0.01}


def _of_ball(value: Callable[[Any], Any]) -> Callable[[SessionWindow], dict[str, Any]]:
    """Return what shows a value of the chosen ball; without one the input is off."""

    def show(window: SessionWindow) -> dict[str, Any]:
        if window.ball is None:
            return {"disabled": True}
        return {"disabled": False, "value": value(window.outlines[window.ball])}

    return show


def _names(window: SessionWindow) -> dict[str, Any]:
    names = tuple(f"{index + 1}: {ball.kind}" for index, ball in enumerate(window.outlines))
    return {"options": (ALL, *names), "value": ALL if window.ball is None else names[window.ball]}


def _facts(window: SessionWindow) -> str:
    """What is known of the chosen ball, or of all, as Markdown."""
    review, index, balls = window.review, window.ball, window.outlines
    if index is None:
        if not balls:
            return review.missing.get("balls", "There is no ball here.")
        by_hand = [str(number) for number, ball in enumerate(balls, 1) if not window.is_found(ball)]
        told = f" Corrected by hand: {', '.join(by_hand)}." if by_hand else ""
        return f"{len(balls)} balls.{told}"
    lines = ["as found" if window.is_found(balls[index]) else "corrected by hand, not calibrated with yet"]
    if index < len(review.spheres) and len(balls) == len(review.spheres):
        sphere = review.spheres[index]
        lines[0] += f"; fitted: circle ± {readable(sphere.sigma_px)} px, outline seen {share(sphere.score)} %"
        if sphere.kind == "chrome" and (seen := review.highlights_px) is not None:
            count = int(np.isfinite(seen[index, :, 0]).sum())
            lines.append(f"highlight (yellow; of this frame: blue) in {count} of {seen.shape[1]} frames")
    return "\n".join(f"- {line}" for line in lines)


def _how(window: SessionWindow) -> str:
    if isinstance(window.on_photograph, partial) and window.on_photograph.func is _add:
        return f"**Click the middle of the {window.on_photograph.keywords['kind']} ball in the photograph.**"
    if window.ball is None:
        return "Choose a ball: a click on it in the photograph."
    return "Drag the orange knobs: the middle moves, the one on the rim resizes. Or by numbers:"


def _choose(window: SessionWindow, value: str) -> None:
    window.on_photograph = None
    window.choose_ball(None if value == ALL else int(value.split(":")[0]) - 1)


def _correct(edit: Callable[..., Balls], window: SessionWindow, value: Any) -> None:
    if window.ball is not None and window.plane is not None:
        window.correct(edit(window.outlines, window.ball, value, window.plane), f"ball {window.ball + 1}")


def _begin_adding(window: SessionWindow, kind: Kind) -> None:
    window.review.need("frames")
    window.on_photograph = partial(_add, window, kind=kind)
    window.choose_ball(None)


def _add(window: SessionWindow, pixel: tuple[float, float], *, kind: Kind) -> None:
    window.on_photograph = None
    if window.plane is not None:
        window.correct(added(window.outlines, kind, pixel, window.plane), f"add a {kind} ball")
        window.choose_ball(len(window.outlines) - 1)


def _remove(window: SessionWindow) -> None:
    if (index := window.ball) is not None:
        window.ball = None
        window.correct((*window.outlines[:index], *window.outlines[index + 1 :]), f"remove ball {index + 1}")


def _diameter(kind: str) -> Row:
    def show(window: SessionWindow) -> dict[str, Any]:
        known = [ball.diameter_mm or 0.0 for ball in window.picks.balls if ball.kind == kind]
        return {"value": known[0] if len(set(known)) == 1 else 0.0, "disabled": not known}

    return Row("number", f"{kind} balls, mm", show, lambda window, value: window.measure(kind, value),
               MILLIMETRES | {"hint": "Diameter; 0: not known"})  # fmt: skip


BALL_ROWS = (
    *map(_diameter, KINDS),
    Row("dropdown", "ball", _names, _choose, {"options": (ALL,), "hint": "Or click one in the photograph"}),
    text(_facts),
    Row("folder", "Correct the outline", rows=(
        text(_how),
        Row("vector2", "centre, px", _of_ball(lambda ball: tuple(round(value, 2) for value in ball.center_px)),
            partial(_correct, moved), {"initial_value": (0.0, 0.0), "step": 0.1}),
        Row("number", "radius, px", _of_ball(lambda ball: round(circle_of(ball)[1], 2)), partial(_correct, resized),
            {"initial_value": 1.0, "min": 0.1, "step": 0.1}),
        Row("dropdown", "kind", _of_ball(lambda ball: ball.kind), partial(_correct, of_kind),
            {"options": KINDS, "hint": "chrome: a mirror; white: any matte ball"}),
        Row("number", "diameter, mm", _of_ball(lambda ball: ball.diameter_mm or 0.0),
            lambda window, value: None if window.ball is None else window.measure(window.ball, value),
            MILLIMETRES | {"hint": "Where it is not that of the others of its kind; 0: not known"}),
        button("Remove this ball", _remove, lambda window: {"disabled": window.ball is None}, kind="danger"),
        *(button(f"Add a {kind} ball", partial(_begin_adding, kind=kind)) for kind in KINDS),
        button("Back to the balls as found", lambda window: window.correct(
            tuple(ball for ball in window.picks.found if ball.center_px), "balls as found")),
    )),
)  # fmt: skip
"""Which balls there are, how large, what is known of one or of all, and where its outline is."""

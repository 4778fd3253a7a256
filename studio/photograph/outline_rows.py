"""The rows in which balls are chosen, moved, resized, added and removed."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from scene.spheres import KINDS, Kind
from studio.photograph.photograph_window import PhotographWindow, added, circle_of, moved, of_kind, resized
from studio.widgets import Row, button, text

ALL = "(all)"


def outline_rows(facts: Callable[[Any], str], more: Sequence[Row] = ()) -> tuple[Row, ...]:
    """Return the rows: which ball, what is known of it or of all, and where its outline is; `more` stand below that."""
    center = of_ball(lambda ball: tuple(round(value, 2) for value in ball.center_px))
    return (
        Row("dropdown", "ball", _names, _choose, {"options": (ALL,), "hint": "Or click one in the photograph"}),
        text(facts),
        Row("folder", "Correct the outline", rows=(
            text(_how),
            Row("vector2", "centre, px", center, partial(_correct, moved), {"initial_value": (0.0, 0.0), "step": 0.1}),
            Row("number", "radius, px", of_ball(lambda ball: round(circle_of(ball)[1], 2)), partial(_correct, resized),
                {"initial_value": 1.0, "min": 0.1, "step": 0.1}),
            Row("dropdown", "kind", of_ball(lambda ball: ball.kind), partial(_correct, of_kind),
                {"options": KINDS, "hint": "chrome: a mirror; white: any matte ball"}),
            *more,
            button("Remove this ball", _remove, lambda window: {"disabled": window.ball is None}, kind="danger"),
            *(button(f"Add a {kind} ball", partial(_begin_adding, kind=kind)) for kind in KINDS),
            button("Back to the balls as found", lambda window: window.back_to_found()),
        )),
    )  # fmt: skip


def of_ball(value: Callable[[Any], Any]) -> Callable[[PhotographWindow], dict[str, Any]]:
    """Return what shows a value of the chosen ball; without one the input is off."""

    def show(window: PhotographWindow) -> dict[str, Any]:
        if window.ball is None:
            return {"disabled": True}
        return {"disabled": False, "value": value(window.outlines[window.ball])}

    return show


def _names(window: PhotographWindow) -> dict[str, Any]:
    names = tuple(f"{index + 1}: {ball.kind}" for index, ball in enumerate(window.outlines))
    return {"options": (ALL, *names), "value": ALL if window.ball is None else names[window.ball]}


def _how(window: PhotographWindow) -> str:
    if isinstance(window.on_photograph, partial) and window.on_photograph.func is _add:
        return f"**Click the middle of the {window.on_photograph.keywords['kind']} ball in the photograph.**"
    if window.ball is None:
        return "Choose a ball: a click on it in the photograph."
    return "Drag the orange knobs: the middle moves, the one on the rim resizes. Or by numbers:"


def _choose(window: PhotographWindow, value: str) -> None:
    window.on_photograph = None
    window.choose_ball(None if value == ALL else int(value.split(":")[0]) - 1)


def _correct(edit: Callable[..., Any], window: PhotographWindow, value: Any) -> None:
    if window.ball is not None and window.plane is not None:
        window.correct(edit(window.outlines, window.ball, value, window.plane), f"ball {window.ball + 1}")


def _begin_adding(window: PhotographWindow, kind: Kind) -> None:
    window.on_photograph = partial(_add, window, kind=kind)
    window.choose_ball(None)


def _add(window: PhotographWindow, pixel: tuple[float, float], *, kind: Kind) -> None:
    window.on_photograph = None
    if window.plane is not None:
        window.correct(added(window.outlines, kind, pixel, window.plane), f"add a {kind} ball")
        window.choose_ball(len(window.outlines) - 1)


def _remove(window: PhotographWindow) -> None:
    if (index := window.ball) is not None:
        window.ball = None
        window.correct((*window.outlines[:index], *window.outlines[index + 1 :]), f"remove ball {index + 1}")

"""Rows of a draft and of a session: which of several objects; its balls, chosen, measured, moved, added, removed."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from lab.session_place import MANIFEST
from scene.spheres import KINDS, Kind
from studio.session.photograph_window import Balls, PhotographWindow, added, circle_of, moved, of_kind, resized
from studio.widgets import Row, button, text

ALL = "(all)"
MILLIMETRES: dict[str, Any] = {"value": 0.0, "min": 0.0, "max": 10_000.0, "step": 0.01}


def _objects(window: PhotographWindow) -> dict[str, Path]:
    """Return the folders in which sessions are begun, and what is shown, by the names by which they are chosen."""
    folders = list(dict.fromkeys([*window.state.looks, window.place or window.folder]))
    top = os.path.commonpath([folder.parent for folder in folders])
    there = {True: " (has a session.toml)", False: ""}
    return {f"{folder.relative_to(top)}{there[(folder / MANIFEST).exists()]}": folder for folder in folders}


def _object(window: PhotographWindow) -> dict[str, Any]:
    names, here = _objects(window), window.place or window.folder
    chosen = next(name for name, folder in names.items() if folder == here)
    return {"visible": len(names) > 1, "options": tuple(names), "value": chosen}


OBJECT = Row("dropdown", "object", _object, lambda window, name: window.open(_objects(window)[name]),
             {"options": ("",), "visible": False, "hint": "Each gets a session of its own"})  # fmt: skip
"""Visible where sessions are begun in several folders, or another one is looked at."""


def _of_ball(value: Callable[[Any], Any]) -> Callable[[PhotographWindow], dict[str, Any]]:
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


def _correct(edit: Callable[..., Balls], window: PhotographWindow, value: Any) -> None:
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


def _diameter(kind: str) -> Row:
    def show(window: PhotographWindow) -> dict[str, Any]:
        known = [ball.diameter_mm or 0.0 for ball in window.balls if ball.kind == kind]
        return {"value": known[0] if len(set(known)) == 1 else 0.0, "disabled": not known}

    return Row("number", f"{kind} balls, mm", show, lambda window, value: window.measure(kind, value),
               MILLIMETRES | {"hint": "Diameter; 0: not known"})  # fmt: skip


BALL_ROWS = (
    *map(_diameter, KINDS),
    Row("dropdown", "ball", _names, _choose, {"options": (ALL,), "hint": "Or click one in the photograph"}),
    text(lambda window: window.ball_facts),
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
        button("Back to the balls as found", lambda window: window.back_to_found()),
    )),
)  # fmt: skip
"""Which balls there are, how large, what is known of one or of all, and where its outline is."""

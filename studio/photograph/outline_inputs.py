"""The part of a panel in which balls are chosen, moved, resized, added and removed."""

from collections.abc import Callable
from functools import partial
from typing import Any

from scene.spheres import KINDS, Kind
from studio.photograph.outlines import added, moved, of_kind, removed, resized
from studio.photograph.photograph_window import PhotographWindow

ALL = "(all)"


class OutlineInputs:
    """Which ball, and where its outline is.

    facts: Returns what is known of the chosen ball, or of all, as Markdown. found: Takes the balls back as they were
    found. more: Adds further inputs of the chosen ball.
    """

    def __init__(
        self, window: PhotographWindow, facts: Callable[[], str], found: Callable[[], Any],
        more: Callable[[], Any] = lambda: None,
    ) -> None:  # fmt: skip
        self._window, self._facts_of, gui = window, facts, window.client.gui
        self._ball = gui.add_dropdown("ball", (ALL,), hint="Or click one in the photograph")
        self._facts = gui.add_markdown("")
        with gui.add_folder("Correct the outline"):
            self._how = gui.add_markdown("")
            self._center = gui.add_vector2("centre, px", (0.0, 0.0), step=0.1)
            self._radius = gui.add_number("radius, px", 1.0, min=0.1, step=0.1)
            self._kind = gui.add_dropdown("kind", KINDS, hint="chrome: a mirror; white: any matte ball")
            more()
            self._remove = window.button("Remove this ball", self._take_out, kind="danger")
            for kind in KINDS:
                window.button(f"Add a {kind} ball", partial(self._begin_adding, kind))
            window.button("Back to the balls as found", found)
        window.on_input(self._ball, self._choose)
        window.on_input(self._center, lambda value: self._correct(moved, value))
        window.on_input(self._radius, lambda value: self._correct(resized, value))
        window.on_input(
            self._kind, lambda value: self._correct(lambda balls, i, kind, _: of_kind(balls, i, kind), value)
        )

    def refresh(self) -> None:
        """Follow the window."""
        window = self._window
        names = tuple(f"{index + 1}: {ball.kind}" for index, ball in enumerate(window.outlines))
        self._ball.options = (ALL, *names)
        self._ball.value = ALL if window.ball is None else names[window.ball]
        for handle in (self._center, self._radius, self._kind, self._remove):
            handle.disabled = window.ball is None
        self._facts.content = self._facts_of()
        self._how.content = self._how_text()
        if window.ball is not None:
            ball = window.outlines[window.ball]
            self._center.value = tuple(round(value, 2) for value in ball.center_px)
            self._radius.value, self._kind.value = round(ball.radius_px, 2), ball.kind

    def _how_text(self) -> str:
        waiting = self._adding
        if waiting is not None:
            return f"**Click the middle of the {waiting} ball in the photograph.**"
        if self._window.ball is None:
            return "Choose a ball: a click on it in the photograph."
        return "Drag the orange knobs: the middle moves, the one on the rim resizes. Or by numbers:"

    @property
    def _adding(self) -> Kind | None:
        """The kind of the ball whose middle is to be clicked."""
        use = self._window.on_photograph
        return use.args[0] if isinstance(use, partial) and use.func == self._add else None

    def _choose(self, value: str) -> None:
        self._window.on_photograph = None
        self._window.choose_ball(None if value == ALL else int(value.split(":")[0]) - 1)

    def _correct(self, edit: Callable[..., Any], value: Any) -> None:
        window, plane = self._window, self._window.plane
        if window.ball is not None and plane is not None:
            window.correct(edit(window.outlines, window.ball, value, plane), f"ball {window.ball + 1}")

    def _begin_adding(self, kind: Kind) -> None:
        self._window.on_photograph = partial(self._add, kind)
        self._window.choose_ball(None)

    def _add(self, kind: Kind, pixel: tuple[float, float]) -> None:
        window, plane = self._window, self._window.plane
        window.on_photograph = None
        if plane is not None:
            window.correct(added(window.outlines, kind, pixel, plane), f"add a {kind} ball")
            window.choose_ball(len(window.outlines) - 1)

    def _take_out(self) -> None:
        window = self._window
        if window.ball is not None:
            index, window.ball = window.ball, None
            window.correct(removed(window.outlines, index), f"remove ball {index + 1}")

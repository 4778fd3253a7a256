"""The panel of the warnings: each with its step; a press goes to the frame or the ball that it is about."""

from typing import Any

from studio.markdown import plain
from studio.review.review_desk import ReviewDesk
from studio.review.warning_places import Warned

MOST = 60
"""That are listed; more would only be scrolled through."""


class WarningsPanel:
    """All warnings of all steps."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, self._gui = desk, desk.client.gui
        self._folder = self._gui.add_folder("Warnings")
        self._handles: list[Any] = []
        self._reading = -1

    def refresh(self) -> None:
        """List the warnings of the folder as it was read."""
        if self._reading == self._desk.reading:
            return
        self._reading = self._desk.reading
        for handle in self._handles:
            handle.remove()
        self._handles = []
        warnings = self._desk.review.warnings
        self._folder.label = f"Warnings ({len(warnings)})"
        with self._folder:
            if not warnings:
                ended = ", ".join(sorted(self._desk.review.done)) or "none has ended"
                self._handles.append(self._gui.add_markdown(f"No step warned of anything. Steps: {ended}."))
            for one in warnings[:MOST]:
                self._add(one)
            if len(warnings) > MOST:
                more = f"{len(warnings) - MOST} more are in report.html."
                self._handles.append(self._gui.add_markdown(more))

    def _add(self, one: Warned) -> None:
        self._handles.append(self._gui.add_markdown(f"**{plain(one.step)}**: {plain(one.text)}"))
        frames = self._desk.review.material.frames
        for frame in one.frames[:4]:
            assert frames is not None
            button = self._gui.add_button(f"Show {frames.names[frame]}")
            self._handles.append(self._desk.on_click(button, self._going(frame, one.ball)))
        if one.ball is not None and not one.frames:
            button = self._gui.add_button(f"Show ball {one.ball + 1}")
            self._handles.append(self._desk.on_click(button, self._going(None, one.ball)))

    def _going(self, frame: int | None, ball: int | None) -> Any:
        return lambda: self._desk.choose(frame=frame, ball=ball, view="Photograph")

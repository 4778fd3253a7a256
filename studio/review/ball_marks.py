"""The balls on the photograph: their outlines, and the chosen one enlarged, with its highlights."""

from typing import Any

import numpy as np

from studio.photograph.outline_marks import KNOB as MOVED
from studio.photograph.outline_marks import OutlineMarks, add_crop
from studio.photograph.outlines import Outline
from studio.photograph.plane import Plane, add_lines
from studio.review.review_window import ReviewWindow
from studio.widgets import Layers

FITTED, WAITING = (60, 220, 90), (170, 170, 170)
"""Of a ball that was found; of one that was not, and waits to be put in its place."""
SEEN, NOW = (255, 235, 60), (60, 170, 255)
"""Highlights; that of the frame that is chosen."""


class BallMarks:
    """What is drawn of the balls."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._layers = window, Layers()
        self._outlines = OutlineMarks(window, self._colour)

    def refresh(self, plane: Plane) -> None:
        """Draw the window's balls."""
        window, draw = self._window, self._layers.draw
        now, count = (window.reading, window.ball), len(window.outlines)
        self._outlines.refresh(plane)
        draw("crop", (now, count), lambda: self._add_crop(plane))
        draw("highlights", (now, window.frame, count), lambda: self._add_highlights(plane))

    def _colour(self, ball: Outline) -> tuple[int, int, int] | None:
        if ball.is_moved or self._window.review.spheres:
            return MOVED if ball.is_moved else FITTED
        return WAITING if self._window.tab == "Balls" else None

    def _add_crop(self, plane: Plane) -> list[Any]:
        """Show the chosen ball by all photographs together, in full resolution."""
        window, material = self._window, self._window.review.material
        if window.ball is None or material.frames is None or material.exposure is None:
            return []
        return [add_crop(window, plane, material.frames, material.exposure, window.outlines[window.ball])]

    def _add_highlights(self, plane: Plane) -> list[Any]:
        """Mark the chosen ball's highlights by crosses."""
        window, seen, index = self._window, self._window.review.highlights_px, self._window.ball
        if index is None or seen is None or index >= len(seen):
            return []
        arm = 0.03 * window.outlines[index].radius_px * plane.per_px
        crosses = arm * np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]])
        crosses = plane.place(seen[index], lift=0.0024)[:, None, None] + crosses
        known = np.isfinite(seen[index]).all(-1)
        is_now = known & (np.arange(len(known)) == window.frame)
        return [
            add_lines(window.client.scene, name, crosses[which].reshape(-1, 2, 3), colour, width_px)
            for name, which, colour, width_px in (("seen", known, SEEN, 2.0), ("this_frame", is_now, NOW, 4.0))
            if which.any()
        ]

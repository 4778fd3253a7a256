"""The photograph large in the browser's view, its balls on it, the other frames as a strip below."""

from typing import Any

import numpy as np

from scene.errors import SceneError
from studio.review.ball_marks import BallMarks
from studio.review.contact_sheet import ContactSheet, contact_sheet
from studio.review.photograph_picture import Look, photograph
from studio.review.plane import ROOT, WIDE, Plane, add_picture
from studio.review.review_window import ReviewWindow
from studio.widgets import Layers

GAP = 0.25


class PhotographView:
    """What stands in the plane of the photograph."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._view = window, window.client.scene
        self._root = self._view.add_frame(ROOT, show_axes=False)
        self._layers, self._marks = Layers(), BallMarks(window)
        self._sheet: ContactSheet | None = None

    def refresh(self) -> None:
        """Show the window's frame, balls and strip; only what changed is sent."""
        window, plane = self._window, self._window.plane
        self._root.visible = window.view == "Photograph"
        if plane is None:
            return
        draw, reading = self._layers.draw, window.reading
        draw("sheet", reading, self._make_sheet)
        draw("strip", (reading, window.frame), lambda: self._add_strip(plane))
        key = (window.view, window.ball, reading, window.beside is None, window.looks)
        draw("face", key, lambda: self._face(plane))
        draw("picture", (reading, window.frame, window.shown), lambda: self._add_picture(plane))
        draw("beside", window.beside, lambda: self._add_beside(plane))
        self._marks.refresh(plane)

    def _strip_high(self) -> float:
        return 0.0 if self._sheet is None else WIDE * self._sheet.image.shape[0] / self._sheet.image.shape[1]

    def _face(self, plane: Plane) -> None:
        """Look straight at the photograph, or at the chosen ball, when another is chosen."""
        window = self._window
        if window.view != "Photograph":
            return
        if window.ball is not None:
            ball = window.outlines[window.ball]
            size = 3.2 * ball.radius_px * plane.per_px
            window.look_straight(plane.place(ball.center_px), size, size)
            return
        strip = GAP + self._strip_high() if self._sheet is not None else 0.0
        aside = 0.0 if window.beside is None else WIDE + GAP
        window.look_straight([aside / 2, -strip / 2, 0.0], WIDE + aside, plane.high + strip)

    def _add_picture(self, plane: Plane) -> list[Any]:
        window = self._window
        try:
            image = photograph(window.review, window.frame, window.shown)
        except SceneError as error:
            # What was to lie over it is not there: the frame as it is.
            window.show_fault(str(error))
            image = photograph(window.review, window.frame, Look(brightness=window.shown.brightness))
        size, middle = (WIDE, plane.high), (0.0, 0.0, 0.0)

        def clicked(across: float, down: float) -> None:
            self._clicked((across * plane.width - 0.5, down * plane.height - 0.5))

        return [add_picture(window, f"{ROOT}/picture", image, size, middle, clicked)]

    def _add_beside(self, plane: Plane) -> list[Any]:
        """Show another picture of the same view to the right, as large."""
        beside, x = self._window.beside, WIDE + GAP
        if beside is None:
            return []
        label = self._view.add_label(f"{ROOT}/caption", beside.caption, position=(x, plane.high / 2 + 0.1, 0.0))
        return [add_picture(self._window, f"{ROOT}/beside", beside.image, (WIDE, plane.high), (x, 0.0, 0.0)), label]

    def _clicked(self, pixel: tuple[float, float]) -> None:
        window = self._window
        if window.on_photograph is not None:
            window.on_photograph(pixel)
            return
        away = [np.hypot(*np.subtract(ball.center_px, pixel)) / ball.radius_px for ball in window.outlines]
        if away and min(away) < 1:
            window.choose(ball=int(np.argmin(away)))

    def _make_sheet(self) -> None:
        self._sheet = contact_sheet(self._window.review)

    def _add_strip(self, plane: Plane) -> list[Any]:
        window, sheet, high = self._window, self._sheet, self._strip_high()
        if sheet is None:
            return []
        top, image = -plane.high / 2 - GAP, sheet.with_chosen(window.frame)

        def clicked(across: float, down: float) -> None:
            frame = sheet.frame_at(across, down)
            if frame is not None:
                window.choose(frame=frame)

        return [add_picture(window, f"{ROOT}/strip", image, (WIDE, high), (0.0, top - high / 2, 0.0), clicked)]

"""Balls outlined on the photograph with their names; knobs on the chosen one to drag; the ball itself, enlarged."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from scene.camera import Camera
from scene.frames import Frames
from studio.browser_window import BrowserWindow
from studio.photograph.outlines import Outline, moved, resized
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import ROOT, Plane, add_lines, add_picture
from studio.widgets import NO_SHADOW, Layers

Array = NDArray[np.float64]
Colour = tuple[int, int, int]
KNOB = (255, 150, 0)
WIDTH_PX = 500


def add_crop(
    window: BrowserWindow, plane: Plane, frames: Frames, exposure: pictures.Exposure, ball: Outline, *, step: int = 1
) -> Any:
    """Show a ball: a mirror so that its edge and all highlights are seen. Return the handle.

    step: Pixels of the plane in one of the frames', along a side.
    """
    center, radius = (np.array(ball.center_px) + 0.5) / step - 0.5, ball.radius_px / step
    size = {"width": frames.width, "height": frames.height}
    box = pictures.PixelBox.around(center - radius, center + radius, margin=0.25, **size)
    image = pictures.shrink(pictures.ball_picture(frames, box, brightest=False), WIDTH_PX)
    if ball.kind == "chrome":
        brightest = pictures.shrink(pictures.ball_picture(frames, box, brightest=True), WIDTH_PX)
        image = pictures.mirror_picture(image / exposure.balance, brightest)
    else:
        image = exposure.develop(image)
    # Edges of pixels are half a pixel from their centres, in either size.
    middle = np.array([box.left + box.right, box.top + box.bottom]) * step / 2 - 0.5
    per_px = plane.per_px * step
    place = plane.place(middle, lift=0.001)
    return add_picture(window, f"{ROOT}/crop", image, (box.width * per_px, box.height * per_px), place)


class OutlineMarks:
    """What is drawn of the window's outlines. colour: Given an outline, that of its line; None: it is not drawn."""

    def __init__(self, window: PhotographWindow, colour: Callable[[Outline], Colour | None]) -> None:
        self._window, self._view, self._layers = window, window.client.scene, Layers()
        self._colour, self._knobs = colour, []

    def refresh(self, plane: Plane) -> None:
        """Draw the window's balls. A knob is moved, not made anew: it may be under a hand."""
        window, camera, draw = self._window, self._window.camera, self._layers.draw
        now = (window.reading, window.ball)
        looks = tuple(map(self._colour, window.outlines))
        draw("outlines", (now, window.outlines, camera, looks), lambda: self._add_outlines(plane, camera))
        draw("knobs", (now, len(window.outlines), camera is None), lambda: self._add_knobs(plane, camera))
        if window.ball is not None and self._knobs:
            for knob, place in zip(self._knobs, self._knob_places(plane, window.ball), strict=True):
                knob.position = tuple(place)

    def _add_outlines(self, plane: Plane, camera: Camera | None) -> list[Any]:
        window, handles = self._window, []
        for index, ball in enumerate(window.outlines):
            colour = self._colour(ball)
            if colour is None or camera is None:
                continue
            line = closed(plane.place(ball.sphere.outline(camera, 180), lift=0.002))
            handles.append(
                add_lines(self._view, f"outline_{index}", line, colour, 3.0 if window.ball == index else 2.0)
            )
            corner = tuple(plane.place(np.add(ball.center_px, [0, -1.15 * ball.radius_px]), lift=0.002))
            name = f"{ball.kind} ball {index + 1}"
            handles.append(self._view.add_label(f"{ROOT}/name_{index}", name, position=corner))
        return handles

    def _knob_places(self, plane: Plane, index: int) -> Array:
        """Return where the knobs stand, on the middle and the rim."""
        ball = self._window.outlines[index]
        return plane.place(np.add(ball.center_px, [[0, 0], [ball.radius_px, 0]]), lift=0.003)

    def _add_knobs(self, plane: Plane, camera: Camera | None) -> list[Any]:
        window, index = self._window, self._window.ball
        self._knobs = []
        if index is None or camera is None:
            return []

        def to_center(pixel: tuple[float, float], held_s: float) -> None:
            window.correct(moved(window.outlines, index, pixel, plane), f"move ball {index + 1}", held_s)

        def to_rim(pixel: tuple[float, float], held_s: float) -> None:
            reach = float(np.hypot(*np.subtract(pixel, window.outlines[index].center_px)))
            window.correct(resized(window.outlines, index, reach, plane), f"resize ball {index + 1}", held_s)

        look = {"radius": 0.05 * window.outlines[index].radius_px * plane.per_px, "color": KNOB, **NO_SHADOW}
        for name, at, use in zip(("center", "rim"), self._knob_places(plane, index), (to_center, to_rim), strict=True):
            self._knobs.append(self._view.add_icosphere(f"{ROOT}/{name}", position=tuple(at), **look))
            self._on_drag(self._knobs[-1], plane, use)
        return list(self._knobs)

    def _on_drag(self, knob: Any, plane: Plane, use: Callable[[tuple[float, float], float], None]) -> None:
        held_s = time.monotonic()

        def dragged(phase: str, eye: Array, end: Array) -> None:
            nonlocal held_s
            if phase == "start":
                held_s = time.monotonic()
            elif (pixel := plane.pixel(eye, end - eye)) is not None:
                use(pixel, held_s)

        def said(event: Any) -> tuple[Any, ...]:
            return event.phase, np.array(event.client.camera.position), np.array(event.end_position)

        self._window.on(knob.on_drag("left"), dragged, said)


def closed(points: Array) -> Array:
    """Return (K, 2, 3), the strokes of a closed line through points (K, 3)."""
    return np.stack([points, np.roll(points, -1, 0)], 1)

"""The balls drawn on the photograph: outlines, highlights and by how much they miss, knobs to drag."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from scene.spheres import Sphere
from studio.review.corrections import moved, resized
from studio.review.plane import ROOT, Plane, add_lines, add_picture
from studio.review.recalibration import mirrored_px, residuals_px, rms_px
from studio.review.review_window import ReviewWindow
from studio.widgets import NO_SHADOW, Layers

Array = NDArray[np.float64]
FITTED, MOVED, AGAIN = (60, 220, 90), (255, 150, 0), (60, 170, 255)
SEEN, MISSES = (255, 235, 60), (255, 70, 200)
CROP_WIDTH = 500


class BallMarks:
    """What is drawn of the balls."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._view, self._layers = window, window.client.scene, Layers()
        self._knobs: list[Any] = []

    def refresh(self, plane: Plane) -> None:
        """Draw the window's balls. A knob is moved, not made anew: it may be under a hand."""
        window, draw = self._window, self._layers.draw
        now = (window.reading, window.ball)
        count = len(window.outlines)
        draw("outlines", (now, window.outlines, id(window.refitted)), lambda: self._add_outlines(plane))
        draw("crop", (now, count), lambda: self._add_crop(plane))
        draw("highlights", (now, window.frame, count), lambda: self._add_highlights(plane))
        draw("knobs", (now, count), lambda: self._add_knobs(plane))
        if window.ball is not None and self._knobs:
            for knob, place in zip(self._knobs, self._knob_places(plane, window.ball), strict=True):
                knob.position = tuple(place)

    def _add_outlines(self, plane: Plane) -> list[Any]:
        """Draw the balls as they are to be calibrated with, with their names, and as calibrating again found them."""
        window, camera, handles = self._window, self._window.review.material.camera, []
        if camera is None:
            return handles

        def draw(name: str, index: int, sphere: Sphere, lift: float, colour: Any, width_px: float) -> bool:
            is_seen = not sphere.apart or window.ball == index
            if is_seen:
                line = _closed(plane.place(sphere.outline(camera, 180), lift=lift))
                handles.append(add_lines(self._view, f"{name}_{index}", line, colour, width_px))
            return is_seen

        for index, ball in enumerate(window.outlines):
            colour = MOVED if ball.is_moved else FITTED
            if draw("outline", index, ball.sphere, 0.002, colour, 3.0 if window.ball == index else 2.0):
                corner = plane.place(np.add(ball.center_px, [0, -1.15 * ball.radius_px]), lift=0.002)
                name, label = f"{ROOT}/name_{index}", f"{ball.kind} ball {index + 1}"
                handles.append(self._view.add_label(name, label, position=tuple(corner)))
        for index, sphere in enumerate(window.refitted):
            draw("refitted", index, sphere, 0.0022, AGAIN, 2.0)
        return handles

    def _add_crop(self, plane: Plane) -> list[Any]:
        """Show the chosen ball by all of its photographs together, in full resolution."""
        window = self._window
        if window.ball is None:
            return []
        ball, review = window.outlines[window.ball], window.review
        frames, exposure = review.material.frames, review.material.exposure
        if ball.apart and window.ball < len(review.spheres):
            frames, exposure = review.material.photographs_of_ball(window.ball)
        if frames is None or exposure is None:
            return []
        center, size = np.array(ball.center_px), {"width": frames.width, "height": frames.height}
        box = pictures.Box.around(center - ball.radius_px, center + ball.radius_px, margin=0.25, **size)
        image = pictures.shrink(pictures.ball_picture(frames, box, brightest=False), CROP_WIDTH)
        if ball.kind == "chrome":
            brightest = pictures.shrink(pictures.ball_picture(frames, box, brightest=True), CROP_WIDTH)
            image = pictures.mirror_picture(image / exposure.balance, brightest)
        else:
            image = exposure.develop(image)
        middle = plane.place([(box.left + box.right - 1) / 2, (box.top + box.bottom - 1) / 2], lift=0.001)
        size = (box.width * plane.per_px, box.height * plane.per_px)
        return [add_picture(window, f"{ROOT}/crop", image, size, middle)]

    def _knob_places(self, plane: Plane, index: int) -> Array:
        """Return where the knobs stand, on the middle and the rim."""
        ball = self._window.outlines[index]
        return plane.place(np.add(ball.center_px, [[0, 0], [ball.radius_px, 0]]), lift=0.003)

    def _add_knobs(self, plane: Plane) -> list[Any]:
        window, camera, index = self._window, self._window.review.material.camera, self._window.ball
        self._knobs = []
        if index is None or camera is None:
            return []

        def to_center(pixel: tuple[float, float]) -> None:
            window.correct(moved(window.outlines, index, pixel, camera))

        def to_rim(pixel: tuple[float, float]) -> None:
            reach = float(np.hypot(*np.subtract(pixel, window.outlines[index].center_px)))
            window.correct(resized(window.outlines, index, reach, camera))

        look = {"radius": 0.05 * window.outlines[index].radius_px * plane.per_px, "color": MOVED, **NO_SHADOW}
        for name, at, use in zip(("center", "rim"), self._knob_places(plane, index), (to_center, to_rim), strict=True):
            self._knobs.append(self._view.add_icosphere(f"{ROOT}/{name}", position=tuple(at), **look))
            self._on_drag(self._knobs[-1], plane, use)
        return list(self._knobs)

    def _on_drag(self, knob: Any, plane: Plane, use: Callable[[tuple[float, float]], None]) -> None:
        def dragged(phase: str, eye: Array, end: Array) -> None:
            pixel = plane.pixel(eye, end - eye)
            if pixel is not None and phase != "start":
                use(pixel)

        def said(event: Any) -> tuple[Any, ...]:
            return event.phase, np.array(event.client.camera.position), np.array(event.end_position)

        self._window.on(knob.on_drag("left"), dragged, said)

    def _add_highlights(self, plane: Plane) -> list[Any]:
        """Draw the chosen ball's highlights, and by how much they miss, drawn larger."""
        window, review, index = self._window, self._window.review, self._window.ball
        seen, lights, camera = review.highlights_px, review.lights, review.material.camera
        if index is None or seen is None or lights is None or camera is None or index >= len(review.spheres):
            return []
        known = np.isfinite(seen[index]).all(-1)
        if not known.any():
            return []
        sphere = review.spheres[index]
        arm = 0.03 * sphere.radius_px * plane.per_px
        arms = arm * np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]])
        at = plane.place(seen[index][known], lift=0.0024)
        misses = residuals_px(camera, sphere, lights, seen[index])
        start = mirrored_px(camera, sphere, lights)
        ends = np.stack([start, start + magnification(rms_px(misses), sphere.radius_px) * misses], 1)[known]
        handles = [
            add_lines(self._view, "seen", (at[:, None, None] + arms).reshape(-1, 2, 3), SEEN, 2.0),
            add_lines(self._view, "misses", plane.place(ends, lift=0.0027), MISSES, 3.0),
        ]
        if known[window.frame]:
            angle = np.linspace(0, 2 * np.pi, 32, endpoint=False)
            ring = 2 * arm * np.stack([np.cos(angle), np.sin(angle), np.zeros(32)], -1)
            ring += plane.place(seen[index][window.frame], lift=0.0024)
            handles.append(add_lines(self._view, "this_frame", _closed(ring), SEEN, 3.0))
        return handles


def magnification(rms: float, radius_px: float) -> float:
    """Return 1, 10, 100 or 1000: so much larger may misses be drawn and stay under a fifth of the radius, rms."""
    if not np.isfinite(rms) or rms <= 0:
        return 1.0
    return float(10 ** np.clip(np.floor(np.log10(0.2 * radius_px / rms)), 0, 3))


def _closed(points: Array) -> Array:
    """Return (K, 2, 3), the strokes of a closed line through points (K, 3)."""
    return np.stack([points, np.roll(points, -1, 0)], 1)

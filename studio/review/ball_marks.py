"""The balls drawn on the photograph: outlines, highlights and by how much they miss, knobs to drag."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from studio.review.corrections import moved, resized
from studio.review.mirror import mirrored_px, residuals_px, rms_px
from studio.review.plane import ROOT, Plane, add_lines, add_picture, cross, segments
from studio.review.review_desk import ReviewDesk
from studio.review.shown import Shown

FITTED, MOVED, AGAIN = (60, 220, 90), (255, 150, 0), (60, 170, 255)
SEEN, MISSES = (255, 235, 60), (255, 70, 200)
CROP_WIDTH = 500


class BallMarks:
    """What is drawn of the balls."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, self._view, self._shown = desk, desk.client.scene, Shown()
        self._knobs: list[Any] = []

    def refresh(self, plane: Plane) -> None:
        """Draw the desk's balls. A knob is moved, not made anew: it may be under a hand."""
        desk, add = self._desk, self._shown.once
        review, ball = desk.reading, desk.ball
        add("outlines", (review, desk.outlines, ball), lambda: self._add_outlines(plane))
        add("refitted", (review, id(desk.refitted), ball), lambda: self._add_refitted(plane))
        add("crop", (review, ball, len(desk.outlines)), lambda: self._add_crop(plane))
        add("highlights", (review, ball, desk.frame, len(desk.outlines)), lambda: self._add_highlights(plane))
        add("knobs", (review, ball, len(desk.outlines)), lambda: self._add_knobs(plane))
        if ball is not None and self._knobs:
            for knob, place in zip(self._knobs, self._knob_places(plane, ball), strict=True):
                knob.position = tuple(place)

    def _add_outlines(self, plane: Plane) -> list[Any]:
        desk, camera, handles = self._desk, self._desk.review.material.camera, []
        if camera is None:
            return handles
        for index, ball in enumerate(desk.outlines):
            is_chosen = desk.ball == index
            if ball.apart and not is_chosen:
                continue
            line = segments(plane.place(ball.sphere.outline(camera, 180), lift=0.002))
            colour = MOVED if ball.is_moved else FITTED
            handles.append(add_lines(self._view, f"outline_{index}", line, colour, 3.0 if is_chosen else 2.0))
            corner = plane.place(np.add(ball.center_px, [0, -1.15 * ball.radius_px]), lift=0.002)
            label = f"{ball.kind} ball {index + 1}"
            handles.append(self._view.add_label(f"{ROOT}/name_{index}", label, position=tuple(corner)))
        return handles

    def _add_refitted(self, plane: Plane) -> list[Any]:
        camera, handles = self._desk.review.material.camera, []
        for index, sphere in enumerate(self._desk.refitted):
            if camera is not None and (not sphere.apart or self._desk.ball == index):
                line = segments(plane.place(sphere.outline(camera, 180), lift=0.0022))
                handles.append(add_lines(self._view, f"refitted_{index}", line, AGAIN, 2.0))
        return handles

    def _add_crop(self, plane: Plane) -> list[Any]:
        """Show the chosen ball by all of its photographs together, in full resolution."""
        desk = self._desk
        if desk.ball is None:
            return []
        ball, review = desk.outlines[desk.ball], desk.review
        frames, exposure = review.material.frames, review.material.exposure
        if ball.apart and desk.ball < len(review.spheres):
            frames, exposure = review.material.photographs_of_ball(desk.ball)
        if frames is None or exposure is None:
            return []
        center, size = np.array(ball.center_px), {"width": frames.width, "height": frames.height}
        box = pictures.Box.around(center - ball.radius_px, center + ball.radius_px, margin=0.25, **size)
        image = pictures.ball_picture(frames, box, brightest=False)
        if ball.kind == "chrome":
            brightest = pictures.ball_picture(frames, box, brightest=True)
            image = pictures.mirror_picture(
                pictures.shrink(image, CROP_WIDTH) / exposure.balance, pictures.shrink(brightest, CROP_WIDTH)
            )
        else:
            image = exposure.develop(pictures.shrink(image, CROP_WIDTH))
        middle = [(box.left + box.right - 1) / 2, (box.top + box.bottom - 1) / 2]
        wide, high = box.width * plane.per_px, box.height * plane.per_px
        return [add_picture(self._view, "crop", image, wide, high, plane.place(middle, lift=0.001))]

    def _knob_places(self, plane: Plane, index: int) -> list[NDArray[np.float64]]:
        ball = self._desk.outlines[index]
        rim = np.add(ball.center_px, [ball.radius_px, 0])
        return [plane.place(ball.center_px, lift=0.003), plane.place(rim, lift=0.003)]

    def _add_knobs(self, plane: Plane) -> list[Any]:
        desk, camera, index = self._desk, self._desk.review.material.camera, self._desk.ball
        self._knobs = []
        if index is None or camera is None:
            return []

        def to_center(pixel: tuple[float, float]) -> None:
            desk.correct(moved(desk.outlines, index, pixel, camera))

        def to_rim(pixel: tuple[float, float]) -> None:
            reach = float(np.hypot(*np.subtract(pixel, desk.outlines[index].center_px)))
            desk.correct(resized(desk.outlines, index, reach, camera))

        size = 0.05 * desk.outlines[index].radius_px * plane.per_px
        places = self._knob_places(plane, index)
        self._knobs = [
            self._add_knob(plane, *row, size)
            for row in zip(("center", "rim"), places, (to_center, to_rim), strict=True)
        ]
        return list(self._knobs)

    def _add_knob(self, plane: Plane, name: str, at: NDArray[np.float64], use: Any, size: float) -> Any:
        look = {"color": MOVED, "cast_shadow": False, "receive_shadow": False}
        handle = self._view.add_icosphere(f"{ROOT}/{name}", radius=size, position=tuple(at), **look)

        async def _(event: Any) -> None:
            eye = np.array(event.client.camera.position)
            pixel = plane.pixel(eye, np.array(event.end_position) - eye)
            if pixel is not None and event.phase != "start":
                self._desk.post(lambda: use(pixel))

        handle.on_drag("left")(_)
        return handle

    def _add_highlights(self, plane: Plane) -> list[Any]:
        """Draw the chosen ball's highlights, and by how much they miss, drawn larger."""
        desk, review, index = self._desk, self._desk.review, self._desk.ball
        seen, lights, camera = review.highlights_px, review.lights, review.material.camera
        if index is None or seen is None or lights is None or camera is None or index >= len(review.spheres):
            return []
        known = np.isfinite(seen[index]).all(-1)
        if not known.any():
            return []
        sphere = review.spheres[index]
        arm = 0.03 * sphere.radius_px * plane.per_px
        crosses = np.concatenate([cross(plane.place(pixel, lift=0.0024), arm) for pixel in seen[index][known]])
        misses = residuals_px(camera, sphere, lights, seen[index])
        start = mirrored_px(camera, sphere, lights)
        ends = np.stack([start, start + magnification(rms_px(misses), sphere.radius_px) * misses], 1)[known]
        handles = [
            add_lines(self._view, "seen", crosses, SEEN, 2.0),
            add_lines(self._view, "misses", plane.place(ends, lift=0.0027), MISSES, 3.0),
        ]
        if known[desk.frame]:
            ring = plane.place(seen[index][desk.frame], lift=0.0024) + 2 * arm * _ring(32)
            handles.append(add_lines(self._view, "this_frame", segments(ring), SEEN, 3.0))
        return handles


def magnification(rms: float, radius_px: float) -> float:
    """Return 1, 10, 100 or 1000: so much larger may misses be drawn and stay under a fifth of the radius, rms."""
    if not np.isfinite(rms) or rms <= 0:
        return 1.0
    return float(10 ** np.clip(np.floor(np.log10(0.2 * radius_px / rms)), 0, 3))


def _ring(count: int) -> NDArray[np.float64]:
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], -1)

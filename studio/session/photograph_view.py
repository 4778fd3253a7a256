"""The photograph large in the browser's view, its strip below, another beside; on it the balls, with knobs to drag."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.session.manifest import SphereTable
from compare.report import pictures
from compare.report.picture_strip import CHOSEN, PictureStrip
from compare.report.registration_pictures import SCAN_COLOUR
from scene.camera import Camera
from scene.errors import SceneError
from scene.map_pictures import Image
from scene.spheres import Sphere
from studio.session.ball_edits import Balls, circle_of, moved, resized
from studio.session.photograph_picture import frame_strip, normals_beside, photograph
from studio.session.plane import ROOT, WIDE, Plane, add_lines, add_numbered, add_picture
from studio.session.session_window import SessionWindow
from studio.widgets import HELD, LIGHT, NO_SHADOW, Layers

Array = NDArray[np.float64]
GAP = 0.25
"""Between the photograph, the strip and what stands beside, in the view's units."""
CROP_PX = 500
"""Width of the chosen ball's picture."""
FITTED, WAITING = (60, 220, 90), (170, 170, 170)
"""Of a ball that was found; that was not found, and waits to be put in its place."""


class PhotographView:
    """What stands in the plane of the photograph."""

    def __init__(self, window: SessionWindow) -> None:
        self._window, self._view, self._layers = window, window.client.scene, Layers()
        self._root = self._view.add_frame(ROOT, show_axes=False)
        self._strip: PictureStrip | None = None
        self._knobs: list[Any] = []

    def refresh(self) -> None:
        """Show the window's photograph, balls and strip; only what changed is sent."""
        window, draw, plane = self._window, self._layers.draw, self._window.plane
        self._root.visible = window.is_flat
        if plane is None:
            self._layers.keep_only(set())
            return
        review, balls, picks, reading = window.review, window.outlines, window.picks, window.reading
        # The photograph comes first: the small pictures are made of all of them.
        draw("picture", (plane, reading, window.frame, window.how), lambda: [add_picture(
            window, f"{ROOT}/picture", self._picture(), (WIDE, plane.high), (0.0, 0.0, 0.0),
            lambda across, down: window.click((across * plane.width - 0.5, down * plane.height - 0.5)))])  # fmt: skip
        draw("small pictures", reading, lambda: setattr(self, "_strip", frame_strip(review)))
        draw("strip", (reading, window.frame), lambda: self._add_strip(plane))
        # A reading anew while the steps run leaves the look as it is.
        method = window.method if window.tab == "Solve" else ""
        key = (window.is_flat, window.ball, plane, self._strip is None, not method, window.looks)
        draw("face", key, lambda: self._face(plane, WIDE + GAP if method else 0.0))
        draw("beside", (reading, method), lambda: self._add_beside(plane, method))
        camera = review.material.camera if review.names else None
        found = FITTED if review.spheres else WAITING if window.tab == "Balls" else None
        colours = [found if window.is_found(ball) else HELD for ball in balls]
        draw("outlines", (reading, window.ball, balls, colours), lambda: self._add_outlines(plane, camera, colours))
        now = (reading, window.ball, len(balls))
        draw("knobs", now, lambda: self._add_knobs(plane, camera is not None))
        draw("crop", now, lambda: self._add_crop(plane))
        draw("highlights", (now, window.frame), lambda: self._add_highlights(plane))
        is_scan = window.tab == "Scan"
        places = [tuple(plane.place(pixel, lift=0.003)) for pixel in picks.pixels if is_scan]
        draw("picks", places, lambda: add_numbered(self._view, f"{ROOT}/pick", places, 0.04, CHOSEN))
        draw("scan", (reading, is_scan), lambda: self._add_scan(plane) if is_scan else [])
        if window.ball is not None and self._knobs:
            # A knob is moved, not made anew: it may be under a hand.
            for knob, place in zip(self._knobs, _knob_places(plane, balls[window.ball]), strict=True):
                knob.position = tuple(place)

    def _picture(self) -> Image:
        window = self._window
        try:
            return photograph(window.review, window.frame, window.how)
        except SceneError as error:
            # What was to lie over it is not there: the frame as it is.
            window.show_fault(str(error))
            return photograph(window.review, window.frame, replace(window.how, marks_object=False))

    def _add_scan(self, plane: Plane) -> list[Any]:
        """Draw the registered scan's outline."""
        from align.pose.scan_view import outline_strokes

        review = self._window.review
        placed = review.placed_scan
        if placed is None or review.material.camera is None:
            return []
        mesh, pose = placed
        strokes = outline_strokes(mesh, pose, review.material.camera)
        return add_lines(self._view, "scan", plane.place(strokes, lift=0.002), SCAN_COLOUR, 2)

    def _face(self, plane: Plane, aside: float) -> None:
        """Look straight at the photograph with what stands around it, or at the chosen ball."""
        window = self._window
        if not window.is_flat:
            return
        if window.ball is not None:
            center, radius = circle_of(window.outlines[window.ball])
            size = 3.2 * radius * plane.per_px
            window.look_straight(plane.place(center), size, size)
            return
        below = 0.0 if self._strip is None else GAP + _high(self._strip)
        window.look_straight([aside / 2, -below / 2, 0.0], WIDE + aside, plane.high + below)

    def _add_strip(self, plane: Plane) -> list[Any]:
        window, strip = self._window, self._strip
        if strip is None:
            return []

        def clicked(across: float, down: float) -> None:
            if (index := strip.frame_at(across, down)) is not None:
                window.choose(frame=index)

        middle = (0.0, -plane.high / 2 - GAP - _high(strip) / 2, 0.0)
        image = strip.with_chosen(window.frame)
        return [add_picture(window, f"{ROOT}/strip", image, (WIDE, _high(strip)), middle, clicked)]

    def _add_beside(self, plane: Plane, method: str) -> list[Any]:
        image, x = normals_beside(self._window.review, method), WIDE + GAP
        if image is None:
            return []
        told, above = f"normals of {method}: red right, green up, blue toward you", (x, plane.high / 2 + 0.1, 0.0)
        label = self._view.add_label(f"{ROOT}/caption", told, position=above, anchor="bottom-center")
        return [add_picture(self._window, f"{ROOT}/beside", image, (WIDE, plane.high), (x, 0.0, 0.0)), label]

    def _add_crop(self, plane: Plane) -> list[Any]:
        """Show the chosen ball by all frames together: a mirror so that its edge and all highlights are seen."""
        window, material = self._window, self._window.review.material
        frames, exposure = material.frames, material.exposure
        if window.ball is None or frames is None or exposure is None:
            return []
        ball = window.outlines[window.ball]
        center, radius = circle_of(ball)
        size = {"width": frames.width, "height": frames.height}
        box = pictures.PixelBox.around(np.subtract(center, radius), np.add(center, radius), margin=0.25, **size)
        image = pictures.ball_picture(frames, exposure, box, CROP_PX, is_mirror=ball.kind == "chrome")
        # Edges of pixels are half a pixel from their centres.
        middle = np.array([box.left + box.right, box.top + box.bottom]) / 2 - 0.5
        wide, high = box.width * plane.per_px, box.height * plane.per_px
        return [add_picture(window, f"{ROOT}/crop", image, (wide, high), plane.place(middle, lift=0.001))]

    def _add_highlights(self, plane: Plane) -> list[Any]:
        """Mark the chosen ball's highlights by crosses."""
        window, seen, index = self._window, self._window.review.highlights_px, self._window.ball
        if index is None or seen is None or index >= len(seen):
            return []
        arm = 0.03 * circle_of(window.outlines[index])[1] * plane.per_px
        crosses = arm * np.array([[[-1, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]]])
        crosses = plane.place(seen[index], lift=0.0024)[:, None, None] + crosses
        known = np.isfinite(seen[index]).all(-1)
        is_now = known & (np.arange(len(known)) == window.frame)
        handles = add_lines(self._view, "seen", crosses[known].reshape(-1, 2, 3), LIGHT, 2)
        return handles + add_lines(self._view, "this_frame", crosses[is_now].reshape(-1, 2, 3), CHOSEN, 4)

    def _add_outlines(self, plane: Plane, camera: Camera | None, colours: list[Any]) -> list[Any]:
        window, handles = self._window, []
        for index, (ball, colour) in enumerate(zip(window.outlines, colours, strict=True)):
            if camera is None or colour is None:
                continue
            center, radius = circle_of(ball)
            outline = Sphere(ball.kind, np.array(center), radius, ball.diameter_mm).outline(camera, 180)
            points = plane.place(outline, lift=0.002)
            strokes, width_px = np.stack([points, np.roll(points, -1, 0)], 1), 3.0 if window.ball == index else 2.0
            handles += add_lines(self._view, f"outline_{index}", strokes, colour, width_px)
            corner = tuple(plane.place(np.add(center, [0, -1.15 * radius]), lift=0.002))
            name = f"{ball.kind} ball {index + 1}"
            handles.append(self._view.add_label(f"{ROOT}/name_{index}", name, position=corner))
        return handles

    def _add_knobs(self, plane: Plane, are_drawn: bool) -> list[Any]:
        index, self._knobs = self._window.ball, []
        if index is None or not are_drawn:
            return []
        ball = self._window.outlines[index]
        look = {"radius": 0.05 * circle_of(ball)[1] * plane.per_px, "color": HELD, **NO_SHADOW}
        edits = (("move", moved), ("resize", _to_rim))
        for name, at, edit in zip(("center", "rim"), _knob_places(plane, ball), edits, strict=True):
            self._knobs.append(self._view.add_icosphere(f"{ROOT}/{name}", position=tuple(at), **look))
            self._on_drag(self._knobs[-1], plane, index, *edit)
        return list(self._knobs)

    def _on_drag(self, knob: Any, plane: Plane, index: int, verb: str, edit: Callable[..., Balls]) -> None:
        window, held_s = self._window, time.monotonic()

        def dragged(phase: str, eye: Array, end: Array) -> None:
            nonlocal held_s
            if phase == "start":
                held_s = time.monotonic()
            elif (pixel := plane.pixel(eye, end - eye)) is not None:
                window.correct(edit(window.outlines, index, pixel, plane), f"{verb} ball {index + 1}", held_s)

        window.on(knob.on_drag("left"), dragged, lambda event: (
            event.phase, np.array(event.client.camera.position), np.array(event.end_position)))  # fmt: skip


def _to_rim(balls: Balls, index: int, pixel: tuple[float, float], plane: Plane) -> Balls:
    """Return the balls, one of them so large that its rim runs through a pixel."""
    reach = float(np.hypot(*np.subtract(pixel, circle_of(balls[index])[0])))
    return resized(balls, index, reach, plane)


def _knob_places(plane: Plane, ball: SphereTable) -> Array:
    """Return where the knobs stand, on the middle and the rim."""
    center, radius = circle_of(ball)
    return plane.place(np.add(center, [[0, 0], [radius, 0]]), lift=0.003)


def _high(strip: PictureStrip) -> float:
    """Return the height in the view's units, where a strip is as wide as the photograph."""
    return WIDE * strip.image.shape[0] / strip.image.shape[1]

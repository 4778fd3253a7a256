"""The photograph large in the browser's view, its balls on it, the other frames as a strip below."""

from typing import Any

import numpy as np

from scene.errors import SceneError
from studio.review.ball_marks import BallMarks
from studio.review.contact_sheet import ContactSheet, contact_sheet
from studio.review.photograph_view import Look, photograph
from studio.review.plane import ROOT, WIDE, Plane, add_picture
from studio.review.review_desk import ReviewDesk
from studio.review.shown import Shown

GAP = 0.25


class Wall:
    """What stands in the plane of the photograph."""

    def __init__(self, desk: ReviewDesk) -> None:
        self._desk, self._view = desk, desk.client.scene
        self._root = self._view.add_frame(ROOT, show_axes=False)
        self._shown, self._marks = Shown(), BallMarks(desk)
        self._sheet: ContactSheet | None = None
        self._looked: Any = None

    @property
    def plane(self) -> Plane | None:
        frames = self._desk.review.material.frames
        return None if frames is None else Plane(frames.width, frames.height)

    def refresh(self) -> None:
        """Show the desk's frame, balls and strip; only what changed is sent."""
        desk, plane = self._desk, self.plane
        self._root.visible = desk.view == "Photograph"
        if plane is None:
            return
        self._shown.once("sheet", (desk.reading,), self._make_sheet)
        self._shown.once("strip", (desk.reading, desk.frame), lambda: self._add_strip(plane))
        self._face(plane)
        self._shown.once("picture", (desk.reading, desk.frame, desk.look), lambda: self._add_picture(plane))
        self._shown.once("beside", desk.beside, lambda: self._add_beside(plane))
        self._marks.refresh(plane)

    def _face(self, plane: Plane) -> None:
        """Look straight at the photograph, or at the chosen ball, when another is chosen."""
        desk = self._desk
        wanted = (desk.view, desk.ball, desk.reading, desk.beside is None, desk.looks)
        if wanted == self._looked or desk.view != "Photograph":
            self._looked = wanted
            return
        self._looked = wanted
        camera = desk.client.camera
        strip = 0.0 if self._sheet is None else GAP + WIDE * self._sheet.image.shape[0] / self._sheet.image.shape[1]
        middle, high, wide = np.array([0.0, -strip / 2, 0.0]), plane.high + strip, WIDE
        if desk.beside is not None:
            middle, wide = middle + [(WIDE + GAP) / 2, 0.0, 0.0], 2 * WIDE + GAP
        if desk.ball is not None:
            ball = desk.outlines[desk.ball]
            middle = plane.place(ball.center_px)
            high = wide = 3.2 * ball.radius_px * plane.per_px
        tangent = np.tan(camera.fov / 2)
        away = 0.54 * max(high / tangent, wide / (tangent * max(camera.aspect, 0.3)))
        camera.position = middle + [0.0, 0.0, away]
        camera.look_at = middle
        camera.up_direction = (0.0, 1.0, 0.0)

    def _add_picture(self, plane: Plane) -> list[Any]:
        desk = self._desk
        try:
            image = photograph(desk.review, desk.frame, desk.look)
        except SceneError as error:
            # What was to lie over it is not there: the frame as it is.
            desk.tell_fault(str(error))
            image = photograph(desk.review, desk.frame, Look(brightness=desk.look.brightness))
        handle = add_picture(self._view, "picture", image, WIDE, plane.high, (0.0, 0.0, 0.0))
        handle.on_click(self._click_photograph(plane))
        return [handle]

    def _add_beside(self, plane: Plane) -> list[Any]:
        """Show another picture of the same view to the right, as large."""
        beside = self._desk.beside
        if beside is None:
            return []
        middle = (WIDE + GAP, 0.0, 0.0)
        label = self._view.add_label(
            f"{ROOT}/caption", beside.caption, position=(WIDE + GAP, plane.high / 2 + 0.1, 0.0)
        )
        return [add_picture(self._view, "beside", beside.image, WIDE, plane.high, middle), label]

    def _click_photograph(self, plane: Plane) -> Any:
        async def _(event: Any) -> None:
            pixel = plane.pixel(event.ray_origin, event.ray_direction)
            if pixel is not None:
                self._desk.post(lambda: self._clicked(pixel))

        return _

    def _clicked(self, pixel: tuple[float, float]) -> None:
        desk = self._desk
        if desk.on_photograph is not None:
            desk.on_photograph(pixel)
            return
        away = [np.hypot(*np.subtract(ball.center_px, pixel)) / ball.radius_px for ball in desk.outlines]
        if away and min(away) < 1:
            desk.choose(ball=int(np.argmin(away)))

    def _make_sheet(self) -> list[Any]:
        self._sheet = contact_sheet(self._desk.review)
        return []

    def _add_strip(self, plane: Plane) -> list[Any]:
        desk, sheet = self._desk, self._sheet
        if sheet is None:
            return []
        high = WIDE * sheet.image.shape[0] / sheet.image.shape[1]
        top = -plane.high / 2 - GAP
        handle = add_picture(self._view, "strip", sheet.with_chosen(desk.frame), WIDE, high, (0.0, top - high / 2, 0.0))

        async def _(event: Any) -> None:
            origin, direction = np.array(event.ray_origin), np.array(event.ray_direction)
            x, y, _ = origin - origin[2] / direction[2] * direction
            frame = sheet.frame_at(x / WIDE + 0.5, (top - y) / high)
            if frame is not None:
                desk.post(lambda: desk.choose(frame=frame))

        handle.on_click(_)
        return [handle]

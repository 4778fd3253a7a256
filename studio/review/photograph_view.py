"""The photograph large in the browser's view, its balls on it, the other frames as a strip below."""

from typing import Any

from compare.report.picture_strip import CELL_PX, INK, Label, PictureStrip
from compare.report.pictures import thumbnail
from scene.errors import SceneError
from studio.photograph.plane import ROOT, WIDE, Plane, add_picture
from studio.photograph.shown_photograph import GAP, add_photograph, add_strip, look_at_photograph
from studio.review.ball_marks import BallMarks
from studio.review.folder import Review
from studio.review.photograph_picture import Look, photograph
from studio.review.review_window import ReviewWindow
from studio.widgets import Layers

MUCH_CLIPPED = 0.002
"""Share of a frame's pixels; a chrome ball's highlight is far less."""
CLIPPED, WARNED = (255, 60, 90), (255, 160, 0)


def frame_strip(review: Review) -> PictureStrip | None:
    """Return all frames small, one tone curve for all, each with number, name and what is clipped; None without any."""
    frames, exposure, shares = review.material.frames, review.material.exposure, review.clipped_share
    if frames is None or exposure is None or not len(frames):
        return None
    warned = {frame for one in review.warnings for frame in one.frames}
    warned |= {index for index, flags in enumerate(review.lights.flags if review.lights else ()) if flags}

    def label(index: int, name: str) -> Label:
        if shares is not None and shares[index] >= MUCH_CLIPPED:
            return f"{index + 1}  clipped {shares[index]:.1%}", CLIPPED
        return (f"{index + 1} {name}  (!)", WARNED) if index in warned else (f"{index + 1} {name}", INK)

    pictures = [exposure.develop(thumbnail(frames, index, CELL_PX)) for index in range(len(frames))]
    return PictureStrip.of(pictures, [label(index, name) for index, name in enumerate(frames.names)])


class PhotographView:
    """What stands in the plane of the photograph."""

    def __init__(self, window: ReviewWindow) -> None:
        self._window, self._view = window, window.client.scene
        self._root = self._view.add_frame(ROOT, show_axes=False)
        self._layers, self._marks = Layers(), BallMarks(window)
        self._strip: PictureStrip | None = None

    def refresh(self) -> None:
        """Show the window's frame, balls and strip; only what changed is sent."""
        window, plane = self._window, self._window.plane
        self._root.visible = window.view == "Photograph"
        if plane is None:
            return
        draw, reading = self._layers.draw, window.reading
        # The photograph comes first: the small pictures are made of all of them.
        draw("picture", (reading, window.frame, window.shown), lambda: self._add_picture(plane))
        draw("small pictures", reading, self._make_strip)
        draw("strip", (reading, window.frame), lambda: self._add_strip(plane))
        # A reading anew while the steps run leaves the look as it is.
        key = (window.view, window.ball, plane, self._strip is None, window.beside is None, window.looks)
        draw("face", key, lambda: self._face(plane))
        draw("beside", window.beside, lambda: self._add_beside(plane))
        self._marks.refresh(plane)

    def _face(self, plane: Plane) -> None:
        """Look straight at the photograph, or at the chosen ball, when another is chosen."""
        window = self._window
        if window.view == "Photograph":
            look_at_photograph(window, plane, self._strip, aside=0.0 if window.beside is None else WIDE + GAP)

    def _add_picture(self, plane: Plane) -> list[Any]:
        window = self._window
        try:
            image = photograph(window.review, window.frame, window.shown)
        except SceneError as error:
            # What was to lie over it is not there: the frame as it is.
            window.show_fault(str(error))
            image = photograph(window.review, window.frame, Look(brightness=window.shown.brightness))
        return add_photograph(window, plane, image)

    def _add_beside(self, plane: Plane) -> list[Any]:
        """Show another picture of the same view to the right, as large."""
        beside, x = self._window.beside, WIDE + GAP
        if beside is None:
            return []
        above = (x, plane.high / 2 + 0.1, 0.0)
        label = self._view.add_label(f"{ROOT}/caption", beside.caption, position=above, anchor="bottom-center")
        return [add_picture(self._window, f"{ROOT}/beside", beside.image, (WIDE, plane.high), (x, 0.0, 0.0)), label]

    def _make_strip(self) -> None:
        self._strip = frame_strip(self._window.review)

    def _add_strip(self, plane: Plane) -> list[Any]:
        window, strip = self._window, self._strip
        if strip is None:
            return []
        return add_strip(window, plane, strip, window.frame, lambda frame: window.choose(frame=frame))

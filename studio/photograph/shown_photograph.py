"""The photograph large in the browser's view, its strip of small pictures below, and how a look is taken at them."""

from collections.abc import Callable
from typing import Any

from compare.report.picture_strip import PictureStrip
from scene.map_pictures import Image
from studio.browser_window import BrowserWindow
from studio.photograph.photograph_window import PhotographWindow
from studio.photograph.plane import ROOT, WIDE, Plane, add_picture

GAP = 0.25
"""Between the photograph, the strip and what stands beside, in the view's units."""


def add_photograph(window: PhotographWindow, plane: Plane, image: Image) -> list[Any]:
    """Show the photograph; the window is told which of its pixels is clicked. Return the handles."""

    def clicked(across: float, down: float) -> None:
        window.click((across * plane.width - 0.5, down * plane.height - 0.5))

    return [add_picture(window, f"{ROOT}/picture", image, (WIDE, plane.high), (0.0, 0.0, 0.0), clicked)]


def add_strip(
    window: BrowserWindow, plane: Plane, strip: PictureStrip, chosen: int | None, use: Callable[[int], Any]
) -> list[Any]:
    """Show a strip below the photograph; `use` is called with the picture that is clicked. Return the handles."""

    def clicked(across: float, down: float) -> None:
        index = strip.frame_at(across, down)
        if index is not None:
            use(index)

    middle = (0.0, -plane.high / 2 - GAP - _high(strip) / 2, 0.0)
    return [add_picture(window, f"{ROOT}/strip", strip.with_chosen(chosen), (WIDE, _high(strip)), middle, clicked)]


def look_at_photograph(
    window: PhotographWindow, plane: Plane, strip: PictureStrip | None, *, aside: float = 0.0
) -> None:
    """Look straight at the photograph with its strip, or at the ball that is chosen.

    aside: Width of what stands beside the photograph.
    """
    if window.ball is not None:
        ball = window.outlines[window.ball]
        size = 3.2 * ball.radius_px * plane.per_px
        window.look_straight(plane.place(ball.center_px), size, size)
        return
    below = 0.0 if strip is None else GAP + _high(strip)
    window.look_straight([aside / 2, -below / 2, 0.0], WIDE + aside, plane.high + below)


def _high(strip: PictureStrip) -> float:
    """Return the height in the view's units, where a strip is as wide as the photograph."""
    return WIDE * strip.image.shape[0] / strip.image.shape[1]

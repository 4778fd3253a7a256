"""A ball by all of its photographs together, laid over the photograph."""

from typing import Any

import numpy as np

from compare.report import pictures
from scene.frames import Frames
from studio.browser_window import BrowserWindow
from studio.photograph.outlines import Outline
from studio.photograph.plane import ROOT, Plane, add_picture

WIDTH_PX = 500


def add_crop(
    window: BrowserWindow, plane: Plane, frames: Frames, exposure: pictures.Exposure, ball: Outline, *, step: int = 1
) -> Any:
    """Show a ball: a mirror so that its edge and all highlights are seen. Return the handle.

    step: Pixels of the plane in one of the frames', along a side.
    """
    center, radius = (np.array(ball.center_px) + 0.5) / step - 0.5, ball.radius_px / step
    size = {"width": frames.width, "height": frames.height}
    box = pictures.Box.around(center - radius, center + radius, margin=0.25, **size)
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

"""A picture of what was found: the scene with the balls in circles, and the photographs small."""

import cv2
import numpy as np
from numpy.typing import NDArray

from compare.report.picture_strip import INK, PAPER, PictureStrip
from compare.report.pictures import Exposure
from shoot.init.draft import Draft

WIDTH = 1236
"""Of six small pictures beside each other."""
MOST = 12
"""Photographs that are shown small."""
COLOURS = {"chrome": (90, 220, 255), "white": (255, 190, 60)}


def contact_sheet(draft: Draft) -> NDArray[np.uint8]:
    """Return the sheet (H, W, 3), RGB."""
    frames = draft.small
    some = frames.only(slice(None, None, -(-len(frames) // MOST)))
    linear = some.read()
    mean, *pictures = (Exposure.for_picture(one).develop(one) for one in (linear.mean(axis=0), *linear))
    size = WIDTH, round(WIDTH * frames.height / frames.width)
    scene = np.array(cv2.resize(mean, size, interpolation=cv2.INTER_AREA), np.uint8)
    scale = WIDTH / (frames.width * draft.step)
    for number, ball in enumerate(draft.manifest.spheres, 1):
        if not ball.center_px or not ball.radius_px:
            continue
        u, v, radius = (scale * value for value in (*ball.center_px, ball.radius_px))
        colour = COLOURS[ball.kind]
        cv2.circle(scene, (round(16 * u), round(16 * v)), round(16 * radius), colour, 2, cv2.LINE_AA, shift=4)
        size = f", {ball.diameter_mm:g} mm" if ball.diameter_mm else ""
        _write(scene, f"{number} {ball.kind}{size}", u, v - radius - 8, colour)
    _write(scene, f"{draft.folder.name}: mean of the flash frames", 0, 26, (255, 255, 255))
    strip = PictureStrip.of(pictures, [(name[-24:], INK) for name in some.names]).image
    beside = np.full((len(strip), WIDTH - strip.shape[1], 3), PAPER, np.uint8)
    return np.concatenate([scene, np.concatenate([strip, beside], 1)])


def _write(picture: NDArray[np.uint8], text: str, x: float, y: float, colour: tuple[int, int, int]) -> None:
    """Write a text on a dark ground, its middle at x if it is then wholly inside the picture."""
    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.6, 1)
    x = int(np.clip(x - width / 2, 2, max(picture.shape[1] - width - 2, 2)))
    y = int(np.clip(y, height + 2, picture.shape[0] - below - 2))
    ground = picture[max(y - height - 2, 0) : y + below, max(x - 2, 0) : x + width + 2]
    ground //= 3
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colour, 1, cv2.LINE_AA)

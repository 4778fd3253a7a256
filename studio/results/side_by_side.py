"""Two maps side by side: pictures of the same part, with the same cursor, by the same colours."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from compare.report.pictures import (
    Box,
    Exposure,
    Image,
    error_picture,
    legend_ball,
    normal_picture,
    with_colour_scale,
)
from scene.errors import SceneError
from studio.results.result_maps import TRUTH, Results, Source
from studio.results.viewport import LARGEST, Viewport

What = Literal["normals", "errors", "albedo"]
WHATS: tuple[What, ...] = get_args(What)
PAPER, MARK, PALE = (255, 255, 255), (200, 0, 60), (pictures.PAPER,) * 3


@dataclass(frozen=True)
class Choice:
    """What is looked at.

    zoom: 1: the whole object.
    centre (u, v): The pixel in the middle; None: the object's middle.
    cursor (u, v): The pixel that is pointed at.
    """

    what: What
    left: Source
    right: Source
    zoom: int = 1
    centre: tuple[float, float] | None = None
    cursor: tuple[int, int] | None = None

    def moved(self, results: Results, across: float, down: float) -> "Choice":
        """Return the same moved by shares of what is shown, to the right and downward."""
        viewport = viewport_of(results, self)
        u, v = viewport.centre
        moved = replace(self, centre=(u + across * viewport.width, v + down * viewport.height))
        # At the picture's edge it stays, and the way back is as long as the way there.
        return replace(moved, centre=viewport_of(results, moved).centre)

    def zoomed(self, zoom: int) -> "Choice":
        """Return the same `zoom` times larger, about the cursor where there is one; 1: all of the object."""
        return replace(self, zoom=zoom, centre=None if zoom == 1 else self.cursor or self.centre)


def box_of(results: Results) -> Box:
    """Return the box around the object, which zoom 1 shows."""
    mask, (width, height) = results.review.material.mask, results.size
    return Box(0, 0, width, height) if mask is None else Box.of_mask(mask, margin=0.04)


def viewport_of(results: Results, choice: Choice) -> Viewport:
    """Return what part of the picture is shown."""
    box = box_of(results)
    middle = ((box.left + box.right - 1) / 2, (box.top + box.bottom - 1) / 2)
    return Viewport.of(box, choice.zoom, choice.centre or middle, results.size)


def map_picture(results: Results, choice: Choice, source: Source) -> Image:
    """Return one of the maps with the cursor. Raises SceneError: it is not there."""
    viewport = viewport_of(results, choice)
    columns, rows = np.meshgrid(*viewport.pixels)
    if choice.what == "errors":
        if source == TRUTH:
            raise SceneError("The ground truth is what errors are measured against: choose a method.")
        picture = error_picture(results.errors(source, rows, columns), results.error_end_deg)
    else:
        values = np.asarray(results.map(choice.what, source)[rows, columns], np.float32)
        if choice.what == "normals":
            picture = normal_picture(values, values.shape[1])
        else:
            picture = Exposure(albedo_white(results, choice), _balance(results)).develop(values)
            picture = np.where(np.isfinite(values).all(-1, keepdims=True), picture, PALE).astype(np.uint8)
    return _with_cursor(picture, viewport, choice.cursor)


def key_of(results: Results, choice: Choice) -> tuple[Image | None, str]:
    """Return a picture, if any, and words to read the colours by."""
    if choice.what == "normals":
        return legend_ball(80), "a ball facing you: red right, green up, blue toward you; pale grey: unknown"
    if choice.what == "albedo":
        return None, f"sRGB; white is {albedo_white(results, choice):.3g}, on both sides"
    scale = with_colour_scale(np.zeros((0, LARGEST, 3), np.uint8), results.error_end_deg, "")
    return scale, "angle to the ground truth, one scale for all; pale grey: unknown"


def _balance(results: Results) -> NDArray[np.float64]:
    exposure = results.review.material.exposure
    return np.ones(3) if exposure is None else exposure.balance


def albedo_white(results: Results, choice: Choice) -> float:
    """Return the albedo that is drawn white on both sides: 99 % of the object are below it on either."""
    rows, columns, _ = results.some_pixels
    peaks = []
    for source in (choice.left, choice.right):
        try:
            albedo = np.asarray(results.map("albedo", source)[rows, columns]) / _balance(results)
        except SceneError:
            continue
        known = np.isfinite(albedo).all(-1)
        peaks += [float(np.quantile(albedo[known].max(-1), 0.99))] if known.any() else []
    return max(max(peaks, default=1.0), 1e-6)


def _with_cursor(picture: Image, viewport: Viewport, cursor: tuple[int, int] | None) -> Image:
    """Return a picture with a frame around a pixel and four strokes toward it: the pixel itself stays to be seen."""
    import cv2

    if cursor is None:
        return picture
    high, wide = picture.shape[:2]
    across, down = viewport.share(*cursor)
    if not (0 <= across <= 1 and 0 <= down <= 1):
        return picture
    x, y = across * wide, down * high
    half = max(5.0, 0.5 * wide / viewport.width + 2)
    low, top, right, bottom = (round(edge) for edge in (x - half, y - half, x + half, y + half))
    drawn, arm, column, row = picture.copy(), 14, round(x), round(y)
    strokes = [((low - arm, row), (low, row)), ((right, row), (right + arm, row)),
               ((column, top - arm), (column, top)), ((column, bottom), (column, bottom + arm))]  # fmt: skip
    for colour, thickness in ((PAPER, 5), (MARK, 2)):
        drawn = cv2.rectangle(drawn, (low, top), (right, bottom), colour, thickness)
        for start, end in strokes:
            drawn = cv2.line(drawn, start, end, colour, thickness)
    return np.asarray(drawn, np.uint8)

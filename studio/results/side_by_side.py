"""Two maps side by side, of the same part of the picture and with the same cursor, in one picture."""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from compare.report.pictures import Box, Exposure, Image, error_picture, legend_ball, normal_picture
from scene.errors import SceneError
from studio.results.result_maps import TRUTH, Results, Source
from studio.results.viewport import Layout, Viewport

What = Literal["normals", "errors", "albedo"]
WHATS: tuple[What, ...] = get_args(What)
PAPER, INK, GREY, MARK = (255, 255, 255), (40, 40, 40), (110, 110, 110), (200, 0, 60)
EMPTY = (pictures.PAPER,) * 3


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


def layout_of(results: Results) -> Layout:
    """Return where both pictures stand."""
    return Layout.of(box_of(results))


def viewport_of(results: Results, choice: Choice) -> Viewport:
    """Return what part of the picture is shown."""
    box = box_of(results)
    middle = ((box.left + box.right - 1) / 2, (box.top + box.bottom - 1) / 2)
    return Viewport.of(box, choice.zoom, choice.centre or middle, results.size)


def side_by_side(results: Results, choice: Choice) -> Image:
    """Return both maps with their names, the cursor and the key to read the colours by.

    What is not there is told in its place.
    """
    layout, viewport = layout_of(results), viewport_of(results, choice)
    rows, columns = np.meshgrid(viewport.rows(layout.high), viewport.columns(layout.wide), indexing="ij")
    image = np.full((layout.size[1], layout.size[0], 3), PAPER, np.uint8)
    white = _albedo_white(results, choice) if choice.what == "albedo" else 1.0
    for side, source in enumerate((choice.left, choice.right)):
        x, y = layout.corner(side)
        place = np.s_[y : y + layout.high, x : x + layout.wide]
        try:
            image[place] = _map_picture(results, choice.what, source, rows, columns, white)
        except SceneError as error:
            image[place] = _words(str(error), layout)
        image[place] = _with_cursor(image[place], viewport, choice.cursor)
        image = _text(image, [(f"{choice.what}: {source.label}", (x + 2, layout.above - 10))], 0.75)
    key = _key(results, choice, layout, white)
    top = layout.above + layout.high + 8
    image[top : top + key.shape[0], : key.shape[1]] = key
    return image


def _map_picture(results: Results, what: What, source: Source, rows: NDArray, columns: NDArray, white: float) -> Image:
    if what == "errors":
        if source == TRUTH:
            raise SceneError("The ground truth is what errors are measured against: choose a method.")
        return error_picture(results.errors(source, rows, columns), results.error_end_deg)
    values = np.asarray(results.map(what, source)[rows, columns], np.float32)
    if what == "normals":
        return normal_picture(values, values.shape[1])
    developed = Exposure(white, _balance(results)).develop(values)
    return np.where(np.isfinite(values).all(-1, keepdims=True), developed, EMPTY).astype(np.uint8)


def _balance(results: Results) -> NDArray[np.float64]:
    exposure = results.review.material.exposure
    return np.ones(3) if exposure is None else exposure.balance


def _albedo_white(results: Results, choice: Choice) -> float:
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


def _words(text: str, layout: Layout) -> Image:
    """Return an empty picture that says why it is empty."""
    picture = np.full((layout.high, layout.wide, 3), EMPTY, np.uint8)
    letters, lines = max(12, layout.wide // 10), [""]
    for word in text.split():
        if len(lines[-1]) + len(word) >= letters:
            lines.append("")
        lines[-1] += f" {word}" if lines[-1] else word
    return _text(picture, [(line, (16, 40 + 24 * number)) for number, line in enumerate(lines)], 0.5, GREY)


def _key(results: Results, choice: Choice, layout: Layout, white: float) -> Image:
    """Return the key of the colours, as wide as both pictures."""
    key = np.full((layout.below - 12, layout.size[0], 3), PAPER, np.uint8)
    if choice.what == "normals":
        ball = legend_ball(80)
        key[:80, :80] = np.where((ball == pictures.PAPER).all(-1, keepdims=True), PAPER, ball)
        words = "a ball facing you: red right, green up, blue toward you"
        return _text(key, [(words, (94, 36)), ("pale grey: unknown", (94, 60))])
    if choice.what == "albedo":
        return _text(key, [(f"sRGB; white is {white:.3g}, on both sides", (2, 28))])
    wide, end = layout.wide, results.error_end_deg
    key[6:26, :wide] = error_picture(np.linspace(0, end, wide)[None], end)
    lines = [(f"{end * part / 4:g}", (part * wide // 4, 46)) for part in range(4)]
    lines += [(f"{end:g}+ deg", (wide - 76, 46))]
    return _text(key, [*lines, ("angle to the ground truth, one scale for all; pale grey: unknown", (2, 70))])


def _text(
    image: Image, lines: list[tuple[str, tuple[int, int]]], size: float = 0.62, colour: tuple[int, int, int] = INK
) -> Image:
    """Write texts at places (x, y) into a picture; return it."""
    import cv2

    for text, place in lines:
        cv2.putText(image, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)
    return image

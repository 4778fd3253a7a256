"""What a session's tables are in Python: a short text, a small table in a notebook, a pandas DataFrame, a figure."""

import math
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

import pandas

from compare.report.pictures import Exposure, thumbnail
from compare.statistics.statistics import statistics_rows
from draw.object_charts import error_histograms
from draw.readable import readable
from draw.svg import COLOURS, Drawing, line, shape, svg
from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.map_pictures import data_uri
from scene.notebook import data_frame, table_html
from scene.spheres import Sphere

T = TypeVar("T")
PLOTTED_WIDTH = 900
"""Pixels of a photograph in a notebook."""


class Table(list[T]):
    """Results that a person at a prompt or in a notebook sees as a table.

    Parameters
    ----------
    items : iterable
        The results themselves.
    caption : str
        What matters, in one line.
    rows : list of dict, optional
        Plain values, the units in the names. Default: the items are these.
    draw : callable, optional
        Returns the figure that `plot` gives.
    """

    def __init__(
        self,
        items: Iterable[T],
        caption: str,
        rows: list[dict[str, Any]] | None = None,
        draw: "Callable[[], Drawing | None] | None" = None,
    ) -> None:
        super().__init__(items)
        self.caption, self._draw = caption, draw
        self._rows: Any = list(self) if rows is None else rows

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows, each a dict of plain values; the units are in the names."""
        return self._rows

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return the rows as a pandas DataFrame; NaN where unknown."""
        return data_frame(self._rows)

    def plot(self) -> "Drawing":
        """Return a drawing: of errors their histograms, of balls their outlines in the first photograph.

        Raises
        ------
        SceneError
            There is nothing to draw.
        """
        drawn = self._draw() if self._draw else None
        if drawn is None:
            raise SceneError(f"{self.caption}: there is nothing to draw.")
        return drawn

    def __repr__(self) -> str:
        return self.caption

    def _repr_html_(self) -> str:
        return table_html(self._rows, self.caption)


def error_table(compared: dict[str, Any]) -> Table[dict[str, Any]]:
    """Return the methods' angular errors, a row a method and kind of frames; see `statistics_rows` for the columns.

    `compared`: the part `compare` of summary.json. The drawing has the share of pixels by error in degrees, a panel a
    method, real filled, twin a line.
    """
    rows = statistics_rows(compared)
    said = ", ".join(f"{row['method']} {readable(row['median_deg'])} ({row['frames']})" for row in rows)
    methods = list(dict.fromkeys(row["method"] for row in rows))
    caption = f"median angular error, degrees: {said or 'none is known'}"
    return Table(rows, caption, draw=lambda: error_histograms(compared, methods))


def ball_rows(balls: Iterable[Sphere], camera: Camera) -> list[dict[str, Any]]:
    """Return a row a ball.

    Returns
    -------
    list of dict
        kind; column_px, row_px: the projected centre; radius_px; diameter_mm, x_mm, y_mm, z_mm, distance_mm: None where
        no diameter is known; sigma_px: standard deviation of the centre, one axis; score: 0 to 1, how much of the
        outline was seen.
    """
    rows = []
    for ball in balls:
        is_sized = ball.diameter_mm is not None and not camera.is_orthographic
        center = ball.center_mm(camera).tolist() if is_sized else None
        x, y, z = center or (None, None, None)
        column, row = ball.center_px.tolist()
        found = {"kind": ball.kind, "column_px": column, "row_px": row, "radius_px": ball.radius_px}
        found |= {"x_mm": x, "y_mm": y, "z_mm": z, "distance_mm": math.hypot(*center) if center else None}
        rows.append(found | {"diameter_mm": ball.diameter_mm, "sigma_px": ball.sigma_px, "score": ball.score})
    return rows


def ball_table(balls: Iterable[Sphere], camera: Camera, frames: Frames) -> Table[Sphere]:
    """Return the calibration balls with the camera that saw them, a row each: see `ball_rows`.

    The drawing is the first photograph, in its pixels, with the balls' outlines.
    """
    balls = list(balls)

    def draw() -> "Drawing":
        picture = Exposure.for_frames(frames).develop(thumbnail(frames, 0, PLOTTED_WIDTH))
        size = {"width": frames.width, "height": frames.height}
        parts = [shape("image", **size, href=data_uri(picture, photograph=True))]
        for number, ball in enumerate(balls, 1):
            outline = ball.outline(camera) + 0.5
            told, width = f"{ball.kind} ball {number}", frames.width / 300
            parts.append(line([*outline, outline[0]], COLOURS[5], told, stroke_width=width))
        return svg(frames.width, frames.height, parts, label="the first photograph with the balls' outlines")

    kinds = [ball.kind for ball in balls]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    caption = f"{len(balls)} balls: {counts}" if balls else "no balls"
    return Table(balls, caption, ball_rows(balls, camera), draw)

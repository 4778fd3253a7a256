"""What a session's tables are in Python: a short text, a small table in a notebook, a pandas DataFrame, a figure."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.notebook import data_frame, table_html
from scene.spheres import Sphere

if TYPE_CHECKING:
    import pandas

    from draw.svg import Drawing


class _Shown:
    """Rows that a person at a prompt or in a notebook sees: `caption` says in one line what matters."""

    caption: str

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows, each a dict of plain values; the units are in the names."""
        raise NotImplementedError

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return the rows as a pandas DataFrame; NaN where unknown."""
        return data_frame(self.rows())

    def __repr__(self) -> str:
        return self.caption

    def _repr_html_(self) -> str:
        return table_html(self.rows(), self.caption)


class Table(_Shown, tuple[dict[str, Any], ...]):
    """Rows of a table.

    Parameters
    ----------
    rows : iterable of dict
    caption : str
    """

    def __new__(cls, rows: Iterable[dict[str, Any]], caption: str) -> Self:
        found = super().__new__(cls, rows)
        found.caption = caption
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows."""
        return list(self)


class Errors(Table):
    """The methods' angular errors, a row a method and kind of frames; see `statistics_rows` for the columns.

    Parameters
    ----------
    compared : dict
        The part `compare` of summary.json.
    """

    _compared: dict[str, Any]

    def __new__(cls, compared: dict[str, Any]) -> Self:
        from compare.statistics.statistics import statistics_rows

        rows = statistics_rows(compared)
        said = (f"{row['method']} {row['median_deg']:.2f} ({row['frames']})" for row in rows)
        caption = f"median angular error, degrees: {', '.join(said) or 'none is known'}"
        found = super().__new__(cls, rows, caption)
        found._compared = compared
        return found

    def plot(self) -> "Drawing":
        """Return a drawing: the share of pixels by error in degrees, a panel a method, real filled, twin a line.

        Raises
        ------
        SceneError
            No method has an error.
        """
        from draw.object_charts import error_histograms

        drawn = error_histograms(self._compared, list(dict.fromkeys(row["method"] for row in self)))
        if drawn is None:
            raise SceneError("errors: no method shares a pixel with the truth, so there is nothing to draw.")
        return drawn


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
        center = ball.center_mm(camera) if is_sized else np.full(3, np.nan)
        place = [*center.tolist(), float(np.linalg.norm(center))] if is_sized else [None] * 4
        column, row = ball.center_px.tolist()
        found = {"kind": ball.kind, "column_px": column, "row_px": row, "radius_px": ball.radius_px}
        found |= dict(zip(("x_mm", "y_mm", "z_mm", "distance_mm"), place, strict=True))
        rows.append(found | {"diameter_mm": ball.diameter_mm, "sigma_px": ball.sigma_px, "score": ball.score})
    return rows


class Balls(_Shown, tuple[Sphere, ...]):
    """The calibration balls, `scene.spheres.Sphere`, with the camera that saw them and the photographs."""

    _camera: Camera
    _frames: Frames

    def __new__(cls, balls: Iterable[Sphere], camera: Camera, frames: Frames) -> Self:
        found = super().__new__(cls, balls)
        found._camera, found._frames = camera, frames
        kinds = [ball.kind for ball in found]
        counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        found.caption = f"{len(found)} balls: {counts}" if found else "no balls"
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Return a row a ball, see `ball_rows`."""
        return ball_rows(self, self._camera)

    def plot(self) -> "Drawing":
        """Return a drawing of the first photograph with the balls' outlines; axes in px."""
        from compare.report.pictures import Exposure, thumbnail
        from draw.object_charts import map_chart
        from scene.estimate import PLOTTED_WIDTH
        from scene.map_pictures import data_uri

        frames = self._frames
        picture = Exposure.for_frames(frames).develop(thumbnail(frames, 0, PLOTTED_WIDTH))
        outlines = {}
        for index, ball in enumerate(self):
            line = ball.outline(self._camera)
            outlines[f"{ball.kind} ball {index + 1}"] = np.concatenate([line, line[:1]])
        uri = data_uri(picture, photograph=True)
        label = "the first photograph with the balls' outlines"
        return map_chart(uri, width=frames.width, height=frames.height, label=label, outlines=outlines)

"""What a session's tables are in Python: a short text, a small table in a notebook, a pandas DataFrame, a figure."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from scene.camera import Camera
from scene.errors import SceneError
from scene.frames import Frames
from scene.notebook import data_frame, table_html
from scene.spheres import Sphere

if TYPE_CHECKING:
    import pandas

    from draw.svg import Drawing


class Table:
    """Rows of a table, each a dict of plain values; the units are in the names.

    Parameters
    ----------
    rows : iterable of dict
    caption : str
        One line that says what matters.
    """

    def __init__(self, rows: Iterable[dict[str, Any]], caption: str) -> None:
        self._rows, self.caption = tuple(rows), caption

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows."""
        return list(self._rows)

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return the rows as a pandas DataFrame; NaN where unknown."""
        return data_frame(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self._rows)

    def __getitem__(self, index: int) -> dict[str, Any]:
        return self._rows[index]

    def __repr__(self) -> str:
        return self.caption

    def _repr_html_(self) -> str:
        return table_html(self._rows, self.caption)


class Errors(Table):
    """The methods' angular errors, a row a method and kind of frames; see `statistics_rows` for the columns.

    Parameters
    ----------
    compared : dict
        The part `compare` of summary.json.
    """

    def __init__(self, compared: dict[str, Any]) -> None:
        from compare.statistics.statistics import statistics_rows

        self._compared, rows = compared, statistics_rows(compared)
        said = (f"{row['method']} {row['median_deg']:.2f} ({row['frames']})" for row in rows)
        super().__init__(rows, f"median angular error, degrees: {', '.join(said) or 'none is known'}")

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


class Balls(tuple[Sphere, ...]):
    """The calibration balls, `scene.spheres.Sphere`, with the camera that saw them and the photographs."""

    _camera: Camera
    _frames: Frames

    def __new__(cls, balls: Iterable[Sphere], camera: Camera, frames: Frames) -> "Balls":
        found = super().__new__(cls, balls)
        found._camera, found._frames = camera, frames
        return found

    def rows(self) -> list[dict[str, Any]]:
        """Return a row a ball.

        Returns
        -------
        list of dict
            kind; column_px, row_px: the projected centre; radius_px; diameter_mm, x_mm, y_mm, z_mm: None where no
            diameter is known; sigma_px: standard deviation of the centre, one axis; score: 0 to 1, how much of the
            outline was seen.
        """
        rows = []
        for ball in self:
            is_sized = ball.diameter_mm is not None and not self._camera.is_orthographic
            center = ball.center_mm(self._camera).tolist() if is_sized else (None, None, None)
            column, row = ball.center_px.tolist()
            found = {"kind": ball.kind, "column_px": column, "row_px": row, "radius_px": ball.radius_px}
            found |= {"diameter_mm": ball.diameter_mm, **dict(zip(("x_mm", "y_mm", "z_mm"), center, strict=True))}
            rows.append(found | {"sigma_px": ball.sigma_px, "score": ball.score})
        return rows

    def to_dataframe(self) -> "pandas.DataFrame":
        """Return `rows` as a pandas DataFrame; NaN where unknown."""
        return data_frame(self.rows())

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

    def __repr__(self) -> str:
        kinds = [ball.kind for ball in self]
        counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
        return f"{len(self)} balls: {counts}" if self else "no balls"

    def _repr_html_(self) -> str:
        return table_html(self.rows(), repr(self))

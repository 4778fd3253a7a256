"""Figures by plotly that the report and Python share: `scene.lights.Lights`, and maps of the object."""

from html import escape
from typing import Any

import numpy as np

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Told apart by colour-blind eyes too [Okabe2008]."""
MOST_NUMBERED = 30
"""Of more lights the numbers would lie on each other."""
CHANNELS = {"red": "#D55E00", "green": "#009E73", "blue": "#0072B2"}


def laid_out(figure: Any, *, height: int, legend_y: float = 1.02) -> Any:
    """Give a figure the one look of them all, and return it; `height` in pixels of the page."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 64, "r": 16, "t": 16, "b": 52},
        font={"family": "system-ui, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif", "size": 13},
        legend={"orientation": "h", "yanchor": "bottom", "y": legend_y, "x": 0},
        hoverlabel={"font": {"size": 13}},
    )
    figure.update_xaxes(title_font_size=13).update_yaxes(title_font_size=13)
    return figure


def light_directions(lights: Any) -> Any:
    """Return the lights on the hemisphere, as the camera sees it: centre = its axis, rim = 90 degrees or more."""
    import plotly.express as px

    rows = _rows(lights)
    rim_deg = max(90.0, float(np.ceil(max(row["zenith_deg"] for row in rows) / 10) * 10))
    figure = px.scatter_polar(rows, **_marks(rows), r="zenith_deg", theta="azimuth_deg", color="intensity",
                              range_r=[0, rim_deg], start_angle=0, direction="counterclockwise")  # fmt: skip
    figure.update_traces(marker_size=11, textposition="top center")
    figure.update_polars(
        angularaxis={"tickvals": [0, 90, 180, 270], "ticktext": ["right (+x)", "up (+y)", "left", "down"]}
    )
    return laid_out(figure, height=430)


def light_intensities(lights: Any) -> Any:
    """Return three bars a light: its intensity in each channel, with its sigma."""
    import plotly.express as px

    columns = [f"intensity_{name[0]}" for name in CHANNELS]
    figure: Any = px.bar(_rows(lights), x="light", y=columns, hover_name="name", barmode="group",
                    color_discrete_sequence=list(CHANNELS.values()))  # fmt: skip
    for bars, channel, intensity in zip(figure.data, CHANNELS, lights.intensities.T, strict=True):
        bars.name = channel
        bars.error_y = {"array": np.nan_to_num(lights.intensity_sigma) * intensity}
    figure.update_layout(legend_title_text="")
    figure.update_yaxes(title="intensity (mean over lights = 1)")
    return laid_out(figure, height=330)


def light_sigmas(lights: Any) -> Any:
    """Return a bar a light: the standard deviation of its direction, degrees, one axis."""
    import plotly.express as px

    return laid_out(px.bar(_rows(lights), x="light", y="direction_sigma_deg", hover_name="name"), height=260)


def light_positions(lights: Any) -> Any:
    """Return the near lights in millimetres, with the object's centre and the camera."""
    import plotly.express as px

    rows = _rows(lights)
    figure = px.scatter_3d(rows, **_marks(rows), x="x_mm", y="y_mm", z="z_mm")
    for name, place in (("object's centre", lights.reference_point_mm), ("camera", np.zeros(3))):
        figure.add_scatter3d(**{axis: [value] for axis, value in zip("xyz", place, strict=True)}, name=name)
    figure.update_scenes(aspectmode="data", camera={"up": {"x": 0, "y": 1, "z": 0}})
    return laid_out(figure, height=450)


def _rows(lights: Any) -> list[dict[str, Any]]:
    """Return the table of the lights, with a number, the angle from the camera's axis and the mean intensity."""
    rows = lights.rows()
    for number, (row, mean) in enumerate(zip(rows, lights.intensities.mean(1).tolist(), strict=True), 1):
        row |= {"light": number, "name": escape(row["name"]), "intensity": mean}
        row["zenith_deg"] = 90 - (row["elevation_deg"] or 0)
    return rows


def _marks(rows: list[dict[str, Any]]) -> dict[str, Any]:
    return {"hover_name": "name", "text": "light" if len(rows) <= MOST_NUMBERED else None}


def map_figure(picture: str, *, width: int, height: int) -> Any:
    """Return the figure of a map of the object.

    Parameters
    ----------
    picture : str
        The map's picture, perhaps smaller than the map, as a data URI.
    width, height : int
        Size of the map in pixels: what the axes count.
    """
    import plotly.graph_objects as go

    # The middle of the first pixel is at 0: the picture begins half a pixel before it.
    figure = go.Figure()
    figure.add_layout_image(
        source=picture, x=-0.5, y=-0.5, sizex=width, sizey=height, xref="x", yref="y", sizing="stretch", layer="below"
    )
    figure.update_xaxes(title="column (px)", range=[-0.5, width - 0.5], constrain="domain", showgrid=False)
    figure.update_yaxes(title="row (px)", range=[height - 0.5, -0.5], scaleanchor="x", constrain="domain")
    figure.update_yaxes(showgrid=False)
    return laid_out(figure, height=int(np.clip(70 + 640 * height / width, 240, 720)))

"""Figures by plotly that the report and Python share: the lights, and maps of the object."""

from html import escape
from typing import Any

import numpy as np

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Told apart by colour-blind eyes too [Okabe2008]."""
SCALE_TICKS_DEG = (30, 60, 90)
"""Angles from the camera's axis that the hemisphere names."""
MOST_NUMBERED = 30
"""Of more lights the numbers would lie on each other."""
CHANNELS = (("red", "#D55E00", "triangle-up"), ("green", "#009E73", "circle"), ("blue", "#0072B2", "triangle-down"))


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


def _numbers(rows: list[dict[str, Any]]) -> list[int]:
    return list(range(1, len(rows) + 1))


def _names(rows: list[dict[str, Any]]) -> list[str]:
    return [escape(row["name"]) for row in rows]


def light_directions(lights: dict[str, Any]) -> Any:
    """Return `scene.lights.Lights.facts` on the hemisphere, as the camera sees it.

    The centre is the camera's axis, the rim 90 degrees from it.
    """
    import plotly.graph_objects as go

    rows = lights["frames"]
    colorbar = {"title": {"text": "intensity"}, "thickness": 12, "len": 0.8, "x": 1.02}
    colours = {"color": [row["intensity_mean"] for row in rows], "colorscale": "Cividis", "colorbar": colorbar}
    figure = go.Figure(
        go.Scatterpolar(
            r=[row["zenith_deg"] for row in rows],
            theta=[row["azimuth_deg"] for row in rows],
            mode="markers+text" if len(rows) <= MOST_NUMBERED else "markers",
            text=[str(number) for number in _numbers(rows)],
            textposition="top center",
            showlegend=False,
            hovertext=_names(rows),
            hovertemplate="%{hovertext}<br>%{r:.1f}° from the camera's axis, azimuth %{theta:.1f}°<extra></extra>",
            marker={"size": 11, **colours, "line": {"width": 1, "color": "#333"}},
        )
    )
    rim_deg = max(90.0, float(np.ceil((lights.get("zenith_max_deg") or 0) / 10) * 10))
    # The axis' own labels stand at one fixed angle, whatever light is there.
    ticks = list(SCALE_TICKS_DEG)
    figure.add_scatterpolar(
        r=ticks,
        theta=[_clear_angle_deg(rows, rim_deg)] * len(ticks),
        mode="text",
        text=[f"{tick}°" for tick in ticks],
        textfont={"size": 11, "color": "#666"},
        hoverinfo="skip",
        showlegend=False,
    )
    words = {"tickvals": [0, 90, 180, 270], "ticktext": ["right (+x)", "up (+y)", "left", "down"]}
    figure.update_polars(
        domain={"x": [0.06, 0.84], "y": [0.03, 0.97]},
        radialaxis={"range": [0, rim_deg], "tickvals": ticks, "showticklabels": False, "showline": False, "ticks": ""},
        angularaxis={**words, "direction": "counterclockwise"},
    )
    return laid_out(figure, height=430)


def _clear_angle_deg(rows: list[dict[str, Any]], rim_deg: float) -> float:
    """Return the angle at which the scale's labels lie farthest from lights, their numbers and the rim's words."""

    def at(radius: Any, angle_deg: Any) -> np.ndarray:
        angle = np.radians(angle_deg)
        return np.stack(np.broadcast_arrays(radius * np.cos(angle), radius * np.sin(angle)), -1)

    lights = at(np.array([row["zenith_deg"] for row in rows]), np.array([row["azimuth_deg"] for row in rows]))
    words = at(1.1 * rim_deg, np.array([0.0, 90.0, 180.0, 270.0]))
    # A number stands a tenth of the rim above its light.
    taken = np.concatenate([lights, lights + [0.0, 0.1 * rim_deg], words])
    angles = np.arange(0.0, 360.0, 3.0)
    labels = at(np.array(SCALE_TICKS_DEG), angles[:, None])
    # Labels are about twice as wide as high.
    nearest = np.linalg.norm((labels[:, :, None] - taken) * [0.5, 1.0], axis=-1).min((1, 2))
    return float(angles[np.argmax(nearest)])


def _bars(lights: dict[str, Any], values: list[Any], title: str, **how: Any) -> Any:
    """Return the figure of a bar a light."""
    import plotly.graph_objects as go

    rows = lights["frames"]
    figure = go.Figure(go.Bar(x=_numbers(rows), y=values, hovertext=_names(rows), **how))
    figure.update_xaxes(title="light (number in the hemisphere)", dtick=1 if len(rows) <= MOST_NUMBERED else None)
    return figure.update_yaxes(title=title, rangemode="tozero")


def light_intensities(lights: dict[str, Any]) -> Any:
    """Return a bar per light: mean intensity with its sigma, the channels as marks."""
    rows = lights["frames"]
    sigma = [(row["intensity_sigma"] or 0) * row["intensity_mean"] for row in rows]
    figure = _bars(
        lights,
        [row["intensity_mean"] for row in rows],
        "intensity (mean over frames = 1)",
        error_y={"type": "data", "array": sigma, "visible": any(sigma), "thickness": 1.2},
        marker={"color": "#c9d3dc"},
        name="mean of channels ± 1 sigma",
        hovertemplate="%{hovertext}: %{y:.3f}<extra></extra>",
    )
    for channel, (name, colour, symbol) in enumerate(CHANNELS):
        figure.add_scatter(
            x=_numbers(rows),
            y=[row["intensity"][channel] for row in rows],
            mode="markers",
            name=name,
            marker={"color": colour, "symbol": symbol, "size": 7},
            hovertext=_names(rows),
            hovertemplate=f"%{{hovertext}}, {name}: %{{y:.3f}}<extra></extra>",
        )
    return laid_out(figure, height=330)


def light_sigmas(lights: dict[str, Any]) -> Any:
    """Return a bar per light: the standard deviation of its direction."""
    figure = _bars(
        lights,
        [row["direction_sigma_deg"] for row in lights["frames"]],
        "direction sigma (°, one axis)",
        marker={"color": "#7f93a6"},
        hovertemplate="%{hovertext}: %{y:.3f}°<extra></extra>",
    )
    return laid_out(figure, height=260)


def light_positions(lights: dict[str, Any]) -> Any:
    """Return the near lights in millimetres twice: seen from the camera (x, y), and from above (x, z)."""
    from plotly.subplots import make_subplots

    rows = [(i + 1, row) for i, row in enumerate(lights["frames"]) if row.get("position_mm")]
    figure = make_subplots(1, 2, subplot_titles=("seen from the camera", "seen from above"), horizontal_spacing=0.12)
    groups = [
        ("lights", [row["position_mm"] for _, row in rows], "circle", COLOURS[0], [str(i) for i, _ in rows]),
        ("object's centre", [lights["reference_point_mm"]], "x", COLOURS[1], [""]),
        ("camera", [[0.0, 0.0, 0.0]], "square", "#000", [""]),
    ]
    for column, axis in ((1, 1), (2, 2)):
        for name, points, symbol, colour, labels in groups:
            figure.add_scatter(
                x=[point[0] for point in points],
                y=[point[axis] for point in points],
                mode="markers+text" if len(rows) <= MOST_NUMBERED else "markers",
                text=labels,
                textposition="top center",
                name=name,
                showlegend=column == 1,
                marker={"symbol": symbol, "color": colour, "size": 9},
                hovertemplate=name + " %{text}<br>%{x:.0f}, %{y:.0f} mm<extra></extra>",
                row=1,
                col=column,
            )
    figure.update_xaxes(title="x (mm), right")
    figure.update_yaxes(title="y (mm), up", scaleanchor="x", row=1, col=1)
    figure.update_yaxes(title="z (mm), toward the viewer", scaleanchor="x2", row=1, col=2)
    figure.update_annotations(font_size=13)
    return laid_out(figure, height=450, legend_y=1.08)


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

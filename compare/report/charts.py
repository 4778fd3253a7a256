"""The report's charts, by plotly: data inside the page, no request to anywhere."""

from html import escape
from typing import Any

import numpy as np

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Told apart by colour-blind eyes too [Okabe2008]."""
SCALE_TICKS_DEG = (30, 60, 90)
"""Angles from the camera's axis that the hemisphere names."""
PANELS_ABREAST = 4
MOST_NUMBERED = 30
"""Of more lights the numbers would lie on each other."""
CHANNELS = (("red", "#D55E00", "triangle-up"), ("green", "#009E73", "circle"), ("blue", "#0072B2", "triangle-down"))


def library() -> str:
    """Return plotly.js whole, to be put into the page once."""
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()


def _html(figure: Any, name: str, alt: str, *, height: int, legend_y: float = 1.02) -> str:
    import plotly.io

    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 64, "r": 16, "t": 16, "b": 52},
        font={"family": "system-ui, 'Segoe UI', Helvetica, Arial, 'DejaVu Sans', sans-serif", "size": 13},
        legend={"orientation": "h", "yanchor": "bottom", "y": legend_y, "x": 0},
        hoverlabel={"font": {"size": 13}},
    )
    figure.update_xaxes(title_font_size=13).update_yaxes(title_font_size=13)
    config = {"displaylogo": False, "responsive": True, "displayModeBar": False}
    how: Any = {"include_plotlyjs": False, "full_html": False, "div_id": f"chart-{name}", "config": config}
    div = plotly.io.to_html(figure, default_height=f"{height}px", **how)
    return f'<figure class="chart"><div role="img" aria-label="{escape(alt)}">{div}</div></figure>'


def _numbers(rows: list[dict[str, Any]]) -> list[int]:
    return list(range(1, len(rows) + 1))


def _names(rows: list[dict[str, Any]]) -> list[str]:
    return [escape(row["name"]) for row in rows]


def light_directions(lights: dict[str, Any]) -> str:
    """Return the lights on the hemisphere, as the camera sees it: centre = camera's axis, rim = 90 degrees."""
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
    return _html(figure, "light-directions", "Directions of the lights as the camera sees them", height=430)


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


def light_intensities(lights: dict[str, Any]) -> str:
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
    return _html(figure, "light-intensities", "Relative intensity of each light", height=330)


def light_sigmas(lights: dict[str, Any]) -> str:
    """Return a bar per light: the standard deviation of its direction."""
    figure = _bars(
        lights,
        [row["direction_sigma_deg"] for row in lights["frames"]],
        "direction sigma (°, one axis)",
        marker={"color": "#7f93a6"},
        hovertemplate="%{hovertext}: %{y:.3f}°<extra></extra>",
    )
    return _html(figure, "light-sigmas", "Standard deviation of each light's direction, degrees", height=260)


def light_positions(lights: dict[str, Any], spheres: list[dict[str, Any]]) -> str:
    """Return the near lights in millimetres twice: seen from the camera (x, y), and from above (x, z)."""
    from plotly.subplots import make_subplots

    rows = [(i + 1, row) for i, row in enumerate(lights["frames"]) if row.get("position_mm")]
    figure = make_subplots(1, 2, subplot_titles=("seen from the camera", "seen from above"), horizontal_spacing=0.12)
    balls = [row["center_mm"] for row in spheres if row.get("center_mm")]
    groups = [
        ("lights", [row["position_mm"] for _, row in rows], "circle", COLOURS[0], [str(i) for i, _ in rows]),
        ("balls", balls, "circle-open", "#555", [""] * len(balls)),
        ("object's centre", [lights["reference_point_mm"]], "x", COLOURS[1], [""]),
        ("camera", [[0.0, 0.0, 0.0]], "square", "#000", [""]),
    ]
    for column, axis in ((1, 1), (2, 2)):
        for name, points, symbol, colour, labels in groups:
            if not points:
                continue
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
    alt = "Positions of the lights in millimetres, two views"
    return _html(figure, "light-positions", alt, height=450, legend_y=1.08)


def error_histograms(compared: dict[str, Any], names: list[str]) -> str:
    """Return a panel a method, all on one scale: the share of pixels by error, real filled, twin a line.

    What lies beyond the scale would flatten the rest; it is written into the panel instead.
    """
    from plotly.subplots import make_subplots

    edges = np.array(compared["histogram_edges_deg"])
    found = {name: compared["methods"][name].get("histogram") or {} for name in names}
    found = {name: kinds for name, kinds in found.items() if any(map(sum, kinds.values()))}
    columns = min(PANELS_ABREAST, len(found))
    rows = -(-len(found) // columns)
    titles = [f"<b>{escape(name)}</b>" for name in found]
    room: dict[str, Any] = {"horizontal_spacing": 0.02, "vertical_spacing": 0.24 / rows}
    figure = make_subplots(rows, columns, shared_xaxes=True, shared_yaxes=True, subplot_titles=titles, **room)
    top, named = 0.0, set()
    for index, kinds in enumerate(found.values()):
        place = {"row": index // columns + 1, "col": index % columns + 1}
        beyond = ""
        for kind, counts in kinds.items():
            if not sum(counts):
                continue
            share = 100 * np.array(counts) / sum(counts)
            top = max(top, float(share[:-1].max()))
            beyond += f"<br>{kind} {share[-1]:.2g} %"
            figure.add_scatter(
                x=edges.tolist(),
                y=[*share[:-1].tolist(), float(share[-2])],
                mode="lines",
                line={"shape": "hv", "color": COLOURS[0] if kind == "real" else "#000", "width": 1.5},
                fill="tozeroy" if kind == "real" else "none",
                name="photographs" if kind == "real" else "twin",
                legendgroup=kind,
                showlegend=kind not in named,
                hovertemplate="%{x:.2f}°: %{y:.2f} % of pixels<extra>%{fullData.name}</extra>",
                **place,
            )
            named.add(kind)
        corner = {"x": 0.98, "xref": "x domain", "xanchor": "right", "y": 0.96, "yref": "y domain", "yanchor": "top"}
        look = {"align": "right", "showarrow": False, "font": {"size": 11, "color": "#444"}}
        figure.add_annotation(text=f"beyond {edges[-1]:g}°:{beyond}", **corner, **look, **place)
    figure.update_xaxes(range=[0, float(edges[-1])]).update_xaxes(title="angular error (°)", row=rows)
    figure.update_yaxes(range=[0, 1.05 * top or 1]).update_yaxes(title="pixels (%)", col=1)
    height, alt = 110 + 140 * rows, "Histogram of the angular error of each method"
    return _html(figure, "error-histograms", alt, height=height, legend_y=1 + 30 / height)

"""Charts of lights and of error histograms: as SVG for the report, the histograms by plotly for notebooks too."""

from collections.abc import Iterable
from html import escape
from typing import Any

import numpy as np

from draw.line_chart import Axis, Frame, axes, svg
from scene.figures import CHANNELS, COLOURS, laid_out

MOST_NUMBERED = 30
SIZE = 360
RIM = 150.0
PANEL = (230, 150)
PANELS_ABREAST = 4


def light_directions(lights: dict[str, Any]) -> str:
    """Return the lights on the hemisphere, as the camera sees it: centre = camera's axis, rim = 90 degrees or more."""
    rows, middle = lights["frames"], SIZE / 2
    rim_deg = max(90.0, float(np.ceil((lights.get("zenith_max_deg") or 0) / 10) * 10))
    parts = []
    for angle in (30.0, 60.0, rim_deg):
        radius = RIM * angle / rim_deg
        parts.append(f'<circle cx="{middle}" cy="{middle}" r="{radius:.1f}" fill="none" stroke="#c3cad1"/>')
        parts.append(_text(middle + 0.71 * radius, middle + 0.71 * radius + 12, f"{angle:g}°", 11))
    for x, y, words in ((SIZE - 12, middle, "+x"), (middle, 14, "up (+y)")):
        parts.append(_text(x, y, words, 11))
    for number, row in enumerate(rows, 1):
        azimuth, radius = np.radians(row["azimuth_deg"]), RIM * row["zenith_deg"] / rim_deg
        u, v = middle + radius * np.cos(azimuth), middle - radius * np.sin(azimuth)
        told = f"{row['name']}: {row['zenith_deg']:.1f}° from the camera's axis, azimuth {row['azimuth_deg']:.1f}°"
        mark = f'<circle cx="{u:.1f}" cy="{v:.1f}" r="6" fill="#E69F00" stroke="#333"/>'
        parts.append(f"<g><title>{escape(told)}</title>{mark}</g>")
        if len(rows) <= MOST_NUMBERED:
            parts.append(_text(u, v - 9, str(number), 12))
    return _figure(svg(SIZE, SIZE, parts, label="Directions of the lights as the camera sees them"), "dome")


def light_intensities(lights: dict[str, Any]) -> str:
    """Return each light's intensity, channel by channel, with its sigma as a bar."""
    rows = lights["frames"]
    ends = [value * (1 + (row["intensity_sigma"] or 0)) for row in rows for value in row["intensity"]]
    marks = []
    for number, row in enumerate(rows, 1):
        for channel, (name, colour) in enumerate(CHANNELS.items()):
            value, sigma = row["intensity"][channel], (row["intensity_sigma"] or 0.0) * row["intensity"][channel]
            told = f"{row['name']}, {name}: {value:.3f} ± {sigma:.3f}"
            marks.append((number + 0.18 * (channel - 1), value, sigma, colour, told))
    return _over_lights(marks, len(rows), ends, "Relative intensity of each light", "intensity (mean = 1)")


def light_sigmas(lights: dict[str, Any]) -> str:
    """Return the standard deviation of each light's direction."""
    rows = [(k, row) for k, row in enumerate(lights["frames"], 1) if row["direction_sigma_deg"] is not None]
    marks = [
        (float(k), row["direction_sigma_deg"], 0.0, "#0072B2", f"{row['name']}: {row['direction_sigma_deg']:.3f}°")
        for k, row in rows
    ]
    ends = [row["direction_sigma_deg"] for _, row in rows]
    label = "Standard deviation of each light's direction, degrees"
    return _over_lights(marks, len(lights["frames"]), ends, label, "direction sigma (°)")


def _over_lights(
    marks: Iterable[tuple[float, float, float, str, str]], count: int, ends: list[float], label: str, y_title: str
) -> str:
    frame = Frame(62, 12, 440, 190)
    each = int(np.ceil(count / 16))
    ticks = [(float(k), str(k)) for k in range(1, count + 1, each)]
    x = Axis(0.4, count + 0.6, frame.left, frame.right, False, ticks)
    y = Axis.over([[*ends, 0.0]], frame.bottom, frame.top, log=False)
    parts = axes(x, y, frame, x_title="light", y_title=y_title)
    for at, value, sigma, colour, told in marks:
        low, high = y.at(value - sigma), y.at(value + sigma)
        line = f'<path d="M{x.at(at):.1f} {low:.1f}V{high:.1f}" stroke="{colour}"/>' if sigma else ""
        dot = f'<circle cx="{x.at(at):.1f}" cy="{y.at(value):.1f}" r="3.5" fill="{colour}"/>'
        parts.append(f"<g><title>{escape(told)}</title>{line}{dot}</g>")
    return _figure(svg(450, 240, parts, label=label))


def error_histograms(compared: dict[str, Any], names: list[str]) -> str:
    """Return a panel a method: the share of pixels by error, photographs filled, twin a line, all on one scale."""
    edges, found = np.array(compared["histogram_edges_deg"]), _shares(compared, names)
    if not found:
        return ""
    top = max(float(share[:-1].max()) for kinds in found.values() for share in kinds.values()) or 1.0
    wide, high = PANEL
    parts = []
    for index, (name, kinds) in enumerate(found.items()):
        left, upper = 44 + (index % PANELS_ABREAST) * wide, 30 + (index // PANELS_ABREAST) * (high + 50)
        x = Axis(0, float(edges[-1]), left, left + wide - 22, False, [(end, f"{end:g}°") for end in (0, edges[-1])])
        y = Axis(
            0, 1.05 * top, upper + high, upper, False, [(top, f"{top:.2g} %")] if index % PANELS_ABREAST == 0 else []
        )
        parts += axes(x, y, Frame(left, upper, left + wide - 22, upper + high), x_title="", y_title="")
        parts.append(_text(left + 0.45 * wide, upper - 8, name, 13))
        for kind, share in kinds.items():
            steps = "".join(
                f"L{x.at(a):.1f} {y.at(b):.1f}H{x.at(c):.1f}" for a, b, c in zip(edges, share, edges[1:], strict=False)
            )
            line = f"M{x.at(0):.1f} {y.at(0):.1f}{steps}"
            paint = (
                f'd="{line}V{y.at(0):.1f}Z" fill="#56B4E9"'
                if kind == "real"
                else f'd="{line}" fill="none" stroke="#000"'
            )
            parts.append(f"<path {paint}/>")
            parts.append(
                _text(left + wide - 70, upper + (16 if kind == "real" else 32), f"{kind} beyond: {share[-1]:.2g} %", 11)
            )
    columns, rows = min(len(found), PANELS_ABREAST), -(-len(found) // PANELS_ABREAST)
    drawn = svg(
        44 + columns * wide, 30 + rows * (high + 50), parts, label="Histogram of the angular error of each method"
    )
    return _figure(drawn, "speed") + "<p>Filled: photographs; line: twin.</p>"


def error_histogram_figure(compared: dict[str, Any], names: list[str]) -> Any:
    """Return the figure of a panel a method, all on one scale: the share of pixels by error, real filled, twin a line.

    What lies beyond the scale would flatten the rest; it is written into the panel instead.
    """
    from plotly.subplots import make_subplots

    edges, found = np.array(compared["histogram_edges_deg"]), _shares(compared, names)
    columns = min(PANELS_ABREAST, len(found))
    rows = -(-len(found) // columns)
    titles = [f"<b>{escape(name)}</b>" for name in found]
    room: dict[str, Any] = {"horizontal_spacing": 0.02, "vertical_spacing": 0.24 / rows}
    figure = make_subplots(rows, columns, shared_xaxes=True, shared_yaxes=True, subplot_titles=titles, **room)
    top, named = 0.0, set()
    for index, kinds in enumerate(found.values()):
        place = {"row": index // columns + 1, "col": index % columns + 1}
        beyond = ""
        for kind, share in kinds.items():
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
    height = 110 + 140 * rows
    return laid_out(figure, height=height, legend_y=1 + 30 / height)


def _shares(compared: dict[str, Any], names: list[str]) -> dict[str, dict[str, np.ndarray]]:
    """Return each histogram in percent of its pixels, the last beyond the scale, by method and then real and twin."""
    found = {name: compared["methods"][name].get("histogram") or {} for name in names}
    shares = {name: {kind: 100 * np.array(each) / sum(each) for kind, each in kinds.items() if sum(each)}
              for name, kinds in found.items()}  # fmt: skip
    return {name: kinds for name, kinds in shares.items() if kinds}


def _text(x: float, y: float, words: str, size: int) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="middle" fill="#333">{escape(words)}</text>'


def _figure(drawing: str, kind: str = "") -> str:
    return f'<figure class="chart {kind}">{drawing}</figure>'

"""The report's charts, by plotly: data inside the page, no request to anywhere."""

from html import escape
from typing import Any

import numpy as np

from scene import figures
from scene.figures import COLOURS, laid_out

PANELS_ABREAST = 4


def library() -> str:
    """Return plotly.js whole, to be put into the page once."""
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()


def _html(figure: Any, name: str, alt: str) -> str:
    import plotly.io

    config = {"displaylogo": False, "responsive": True, "displayModeBar": False}
    how: Any = {"include_plotlyjs": False, "full_html": False, "div_id": f"chart-{name}", "config": config}
    div = plotly.io.to_html(figure, default_height=f"{figure.layout.height}px", **how)
    return f'<figure class="chart"><div role="img" aria-label="{escape(alt)}">{div}</div></figure>'


def light_directions(lights: dict[str, Any]) -> str:
    """Return the lights on the hemisphere, as the camera sees it: centre = camera's axis, rim = 90 degrees."""
    figure = figures.light_directions(lights)
    return _html(figure, "light-directions", "Directions of the lights as the camera sees them")


def light_intensities(lights: dict[str, Any]) -> str:
    """Return a bar per light: mean intensity with its sigma, the channels as marks."""
    return _html(figures.light_intensities(lights), "light-intensities", "Relative intensity of each light")


def light_sigmas(lights: dict[str, Any]) -> str:
    """Return a bar per light: the standard deviation of its direction."""
    figure = figures.light_sigmas(lights)
    return _html(figure, "light-sigmas", "Standard deviation of each light's direction, degrees")


def light_positions(lights: dict[str, Any], spheres: list[dict[str, Any]]) -> str:
    """Return the near lights in millimetres twice: seen from the camera (x, y), and from above (x, z)."""
    figure = figures.light_positions(lights, [row["center_mm"] for row in spheres if row.get("center_mm")])
    return _html(figure, "light-positions", "Positions of the lights in millimetres, two views")


def error_histograms(compared: dict[str, Any], names: list[str]) -> str:
    """Return `error_histogram_figure` as HTML."""
    figure = error_histogram_figure(compared, names)
    return _html(figure, "error-histograms", "Histogram of the angular error of each method")


def error_histogram_figure(compared: dict[str, Any], names: list[str]) -> Any:
    """Return the figure of a panel a method, all on one scale: the share of pixels by error, real filled, twin a line.

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
    height = 110 + 140 * rows
    return laid_out(figure, height=height, legend_y=1 + 30 / height)

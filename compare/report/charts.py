"""The figure, by plotly, of how errors are spread: for notebooks."""

from html import escape
from typing import Any

import numpy as np

from scene.figures import COLOURS, laid_out

PANELS_ABREAST = 4


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

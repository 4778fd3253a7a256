"""A pixel's samples with every solver's fit, its numbers as a table, and the histograms of the errors."""

from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.charts import COLOURS
from studio.results.pixel import Numbers, Pixel, shade_of
from studio.results.result_maps import Results, Source
from studio.widgets import plain

BINS = 60
SAMPLES = (
    ("sample", {"symbol": "circle", "color": "#202124", "size": 7}),
    ("shadowed", {"symbol": "x-thin-open", "color": "#80868b", "size": 8, "line": {"width": 2}}),
    ("clipped", {"symbol": "triangle-up-open", "color": "#d93025", "size": 10, "line": {"width": 2}}),
)


def pixel_chart(pixel: Pixel, reference: str | None = None) -> Any:
    """Return a pixel's samples and the solvers' fits as a plotly figure.

    reference: Whose n . l is the x axis: a method's, or `truth`; None: the light's number, from 1. Raises SceneError:
    the reference has no normal here.
    """
    x = np.arange(1.0, len(pixel.gray) + 1) if reference is None else shade_of(pixel, reference)
    figure, order = _figure(), np.argsort(x, kind="stable")
    for number, fit in enumerate(pixel.fits):
        if np.isfinite(fit.gray).any():
            figure.add_scatter(
                x=x[order],
                y=fit.gray[order],
                name=fit.source.method,
                mode="lines+markers",
                # Where two agree, the one below is seen on both sides of the other.
                line={"color": COLOURS[number % len(COLOURS)], "width": 1.5 + 2 * min(2, len(pixel.fits) - 1 - number)},
                marker={"size": 4},
                hovertemplate="%{y:.4f}",
            )
    groups = (~(pixel.clipped | pixel.shadowed), pixel.shadowed & ~pixel.clipped, pixel.clipped)
    for (name, marker), chosen in zip(SAMPLES, groups, strict=True):
        if chosen.any():
            figure.add_scatter(
                x=x[chosen],
                y=pixel.gray[chosen],
                name=name,
                mode="markers",
                marker=marker,
                cliponaxis=False,
                text=[f"{i + 1} {escape(pixel.names[i])}" for i in np.flatnonzero(chosen)],
                hovertemplate="%{text}: %{y:.4f}",
            )
    by = "light" if reference is None else f"n · l, n of {'the ground truth' if reference == 'truth' else reference}"
    figure.update_xaxes(title=by)
    figure.update_yaxes(title="gray / light's intensity", rangemode="tozero")
    return figure


def notes_of(pixel: Pixel) -> str:
    """Return, as Markdown, which fits are not quite their solver's own prediction, and who has none here."""
    lines = [f"- {plain(fit.source.method)}: drawn {fit.note}." for fit in pixel.fits if fit.note]
    silent = [fit.source.method for fit in pixel.fits if not np.isfinite(fit.gray).any()]
    return "\n".join([*lines, *([f"- no fit at this pixel: {plain(', '.join(silent))}."] if silent else [])])


def numbers_table(rows: list[Numbers]) -> str:
    """Return a pixel's numbers as an HTML table; a dash where one is not known."""
    head = "".join(f"<th>{word}</th>" for word in ("", "error °", "sigma °", "normal x y z", "albedo R G B"))
    body = "".join(
        f"<tr><td>{escape(row.source.label)}</td><td>{_number(row.error_deg)}</td><td>{_number(row.sigma_deg)}</td>"
        f"<td>{_numbers(row.normal)}</td><td>{_numbers(row.albedo)}</td></tr>"
        for row in rows
    )
    style = "font-size:11.5px;border-collapse:collapse;width:100%;text-align:left;font-variant-numeric:tabular-nums"
    return f'<table style="{style}"><tr>{head}</tr>{body}</table>'


def shares(errors: NDArray[np.float64], end_deg: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the histogram's edges (B + 1,), degrees, and the share of the errors in each bin and beyond (B + 1,)."""
    edges = np.linspace(0, end_deg, BINS + 1)
    return edges, np.histogram(errors, np.append(edges, np.inf))[0] / len(errors)


def error_chart(results: Results, methods: list[str]) -> tuple[Any, str]:
    """Return the histograms of some methods' errors, photographs and twin, and what lies beyond the scale in words."""
    figure, end, lines = _figure(), results.error_end_deg, []
    for number, method in enumerate(dict.fromkeys(methods)):
        for source in (Source(method), Source(method, "twin")):
            errors = results.known_errors.get(source)
            if errors is None:
                lines.append(f"- {plain(source.label)}: no errors are known.")
                continue
            edges, share = shares(errors, end)
            figure.add_scatter(
                x=edges,
                y=100 * np.append(share[:-1], share[-2]),
                name=source.label,
                mode="lines",
                line={
                    "shape": "hv",
                    "width": 1.5,
                    "color": COLOURS[number % len(COLOURS)],
                    "dash": "solid" if source.side == "photographs" else "dot",
                },
                hovertemplate="%{y:.2f} %",
            )
            beyond = f", {share[-1]:.1%} beyond {end:g}°" if share[-1] else ""
            lines.append(f"- {plain(source.label)}: median {np.median(errors):.2f}°{beyond}")
    every = results.some_pixels[2]
    if every > 1:
        lines.append(f"- One pixel in {every} under the mask is counted.")
    figure.update_xaxes(title="angle to the ground truth, degrees", range=[0, end])
    figure.update_yaxes(title="pixels, %", rangemode="tozero")
    return figure, "\n".join(lines)


def _figure() -> Any:
    import plotly.graph_objects as go

    figure = go.Figure()
    figure.update_layout(
        margin={"l": 52, "r": 8, "t": 44, "b": 44},
        template="plotly_white",
        font={"size": 11},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0, "font": {"size": 10}},
    )
    return figure


def _number(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "–"


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(f"{value:.3f}" for value in values) if np.isfinite(values).all() else "–"

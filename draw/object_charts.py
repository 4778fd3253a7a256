"""What was found of the object: histograms of the errors, a map with its pixels counted at the axes."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from draw.readable import readable
from draw.svg import COLOURS, Axis, Drawing, Frame, axes, legend, line, shape, svg, text

PANEL = Frame(0, 0, 208, 150)
STEP = (230, 200)
"""From one panel's corner to the next one's, right and down, pixels."""
PANELS_ABREAST = 4
MAP_WIDTH = 640


def error_histograms(compared: dict[str, Any], names: Sequence[str]) -> Drawing | None:
    """Return a panel a method: the share of pixels by error, photographs filled, twin a line, all on one scale.

    What lies beyond the scale would flatten the rest: it is written into the panel. None where no method has an error.

    Parameters
    ----------
    compared : dict
        Of it `histogram_edges_deg`, and each method's `histogram`: pixels by bin of real and twin, the last beyond.
    names : sequence of str
        The methods, in the order of the panels.
    """
    found = {name: compared["methods"][name].get("histogram") or {} for name in names}
    shares = {name: {kind: 100 * np.array(each) / sum(each) for kind, each in kinds.items() if sum(each)}
              for name, kinds in found.items()}  # fmt: skip
    shares = {name: kinds for name, kinds in shares.items() if kinds}
    if not shares:
        return None
    edges = compared["histogram_edges_deg"]
    top = max(float(share[:-1].max()) for kinds in shares.values() for share in kinds.values()) or 1.0
    parts = []
    for index, (name, kinds) in enumerate(shares.items()):
        right, down = index % PANELS_ABREAST, index // PANELS_ABREAST
        left, upper = 52 + right * STEP[0], 30 + down * STEP[1]
        frame = Frame(left, upper, left + PANEL.right, upper + PANEL.bottom)
        x = Axis(0, edges[-1], frame.left, frame.right, False, [(end, f"{end:g}°") for end in (0, edges[-1])])
        y = Axis(0, 1.05 * top, frame.bottom, frame.top, False, [(top, f"{readable(top, 1)} %")] if not right else [])
        parts += [*axes(x, y, frame), text(left + PANEL.right / 2, upper - 8, name, fill="#000")]
        for row, (kind, share) in enumerate(kinds.items()):
            steps = zip(np.repeat(edges, 2)[1:-1], np.repeat(share[:-1], 2), strict=True)
            outline = [(x.at(a), y.at(b)) for a, b in ((0, 0), *steps, (edges[-1], 0))]
            paint = {"fill": COLOURS[4]} if kind == "real" else {}
            parts.append(line(outline, "none" if paint else "#000", **paint))
            beyond = f"{kind} beyond: {readable(float(share[-1]), 1)} %"
            parts.append(text(frame.right - 4, upper + 16 * (row + 1), beyond, "end", 11))
    columns, rows = min(len(shares), PANELS_ABREAST), -(-len(shares) // PANELS_ABREAST)
    label = "Histogram of the angular error of each method; filled: photographs, line: twin"
    return svg(52 + columns * STEP[0], 30 + rows * STEP[1], parts, label=label)


def map_chart(
    picture: str, *, width: int, height: int, label: str, outlines: Mapping[str, Iterable[tuple[float, float]]]
) -> Drawing:
    """Return a map of the object, its columns and rows counted at the axes, and outlines on it.

    Parameters
    ----------
    picture : str
        The map's picture, perhaps smaller than the map, as a data URI.
    width, height : int
        Size of the map in pixels: what the axes count.
    label : str
        What it is, for who cannot see it.
    outlines : mapping
        By name, points (column, row).
    """
    frame = Frame(64, 12, 64 + MAP_WIDTH, 12 + MAP_WIDTH * height / width)
    # The middle of the first pixel is at 0: the picture begins half a pixel before it.
    x, y = (
        Axis(-0.5, size - 0.5, start, end, False, Axis.over([[0.0, size - 1.0]], 0, 1, log=False).ticks)
        for size, start, end in ((width, frame.left, frame.right), (height, frame.top, frame.bottom))
    )
    parts = axes(x, y, frame, x_title="column (px)", y_title="row (px)")
    place = {"x": frame.left, "y": frame.top, "width": MAP_WIDTH, "height": frame.bottom - frame.top}
    parts.append(shape("image", **place, preserveAspectRatio="none", href=picture))
    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(outlines)}
    for name, points in outlines.items():
        parts.append(line(((x.at(u), y.at(v)) for u, v in points), colours[name], name, stroke_width=2))
    parts += legend(colours, frame.right + 14, frame.top + 14)
    return svg(frame.right + (170 if outlines else 14), round(frame.bottom + 52), parts, label=label)

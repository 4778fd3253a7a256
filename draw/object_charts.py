"""Histograms of the errors."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from draw.readable import readable
from draw.svg import COLOURS, Axes, Axis, Drawing, svg, text

PANEL = (208, 150)
"""Width and height, pixels."""
STEP = (230, 200)
"""From one panel's corner to the next one's, right and down, pixels."""
PANELS_ABREAST = 4


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
        x = Axis(0, edges[-1], left, left + PANEL[0], False, [(end, f"{end:g}°") for end in (0, edges[-1])])
        ticks = [(top, f"{readable(top, 1)} %")] if not right else []
        on = Axes(x, Axis(0, 1.05 * top, upper + PANEL[1], upper, False, ticks))
        parts += [*on.drawn(), text(left + PANEL[0] / 2, upper - 8, name, fill="#000")]
        for row, (kind, share) in enumerate(kinds.items()):
            steps = zip(np.repeat(edges, 2)[1:-1], np.repeat(share[:-1], 2), strict=True)
            paint = {"fill": COLOURS[4]} if kind == "real" else {}
            parts.append(on.line([(0, 0), *steps, (edges[-1], 0)], "none" if paint else "#000", **paint))
            beyond = f"{kind} beyond: {readable(float(share[-1]), 1)} %"
            parts.append(text(x.end - 4, upper + 16 * (row + 1), beyond, "end", 11))
    columns, rows = min(len(shares), PANELS_ABREAST), -(-len(shares) // PANELS_ABREAST)
    label = "Histogram of the angular error of each method; filled: photographs, line: twin"
    return svg(52 + columns * STEP[0], 30 + rows * STEP[1], parts, label=label)

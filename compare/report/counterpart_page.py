"""The page of two captures compared: the verdict, each method's difference and likeness, error maps side by side."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from numpy.typing import NDArray

from compare.report import page, pictures
from compare.report.pictures import PixelBox
from compare.report.verdict import LIKENESS

MAP_WIDTH = 360


def counterpart_page(found: dict[str, Any], errors: Mapping[str, Mapping[str, NDArray]]) -> str:
    """Return the page, one file that fetches nothing.

    Parameters
    ----------
    found : dict
        What `experiments.compare_folders.compare_folders` returns.
    errors : mapping
        By capture (real, twin), then by method: error map (H, W), degrees, NaN where unknown.
    """
    badges = {**LIKENESS, "not known": "unknown"}
    rows = [
        {**row, "name": name, "badge": page.badge(badges[row["likeness"]], row["likeness"])}
        for name, row in found["methods"].items()
    ]
    names = {
        kind: Markup("{} <small>{}</small>").format(one["name"], one["kind"]) for kind, one in found["captures"].items()
    }
    verdict = Markup('<p><span class="badge {} big">{}</span> {} against {}: {}</p>').format(
        badges[found["verdict"]],
        found["verdict"].capitalize(),
        names["real"],
        names["twin"],
        page.say("two", "verdict", **rows[0]),
    )
    methods = Markup(page.table_of("two", rows, caption=page.say("two", "table")))
    if not found["laid_over"]:
        methods += page.pieces().absent(page.words("two")["apart"])
    if left_out := ", ".join(found["left_out"]):
        methods += page.pieces().absent(f"Left out, without a known error on one of the two: {left_out}.")
    spread = [np.nanquantile(maps[name], 0.95) for maps in errors.values() for name in found["methods"]]
    end = pictures.colour_scale_end(float(np.median(spread)))
    where = Markup(page.colour_scale(end))
    for name, row in found["methods"].items():
        pair = Markup()
        for kind, maps in errors.items():
            median = Markup(page.number(row[kind]["median_deg"], 2, "°"))
            caption = Markup("<b>{}</b>, {}: median {}").format(name, names[kind], median)
            pair += Markup(page.picture(_map(maps[name], end), f"error map, {name}, {kind}", caption, kind="map"))
        where += Markup('<div class="pair">{}</div>').format(pair)
    chapters = {
        "Verdict": page.section("verdict", "Do they fail alike?", verdict),
        "Methods": page.section("methods", "Method by method", methods),
        "Where": page.section("errors", "Where the errors are", where, page.say("maps", "errors", end=end)),
    }
    subtitle = escape(f"{found['created']} · rgbn {found['versions'].get('rgbn', '')}")
    return page.whole_page(found["name"], "Two captures compared", subtitle, chapters)


def _map(error: NDArray, end: float) -> NDArray[np.uint8]:
    """Return an error map's colours, cut to what is known and enlarged."""
    box = PixelBox.of_mask(np.isfinite(error), margin=0.03)
    image = pictures.error_picture(pictures.shrink(box.of(error), MAP_WIDTH), end)
    return pictures.enlarged(image, max(1, MAP_WIDTH // image.shape[1]))

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
CHAPTERS = {"Verdict": "verdict", "Methods": "methods", "Where": "errors"}
"""The sections of counterpart.html by their names in the row of links."""


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
    spread = [np.nanquantile(maps[name], 0.95) for maps in errors.values() for name in found["methods"]]
    end = pictures.colour_scale_end(float(np.median(spread)))
    facts = {
        "found": found, "badges": badges, "rows": rows, "end": end,
        "names": {
            kind: Markup("{} <small>{}</small>").format(one["name"], one["kind"])
            for kind, one in found["captures"].items()
        },
        "maps": {
            name: {kind: _map(maps[name], end) for kind, maps in errors.items()} for name in found["methods"]
        },
    }  # fmt: skip
    module = page.template("counterpart.html").make_module(facts)
    chapters = {words: str(getattr(module, name)()).strip() for words, name in CHAPTERS.items()}
    subtitle = escape(f"{found['created']} · rgbn {found['versions'].get('rgbn', '')}")
    return page.whole_page(found["name"], "Two captures compared", subtitle, chapters)


def _map(error: NDArray, end: float) -> NDArray[np.uint8]:
    """Return an error map's colours, cut to what is known and enlarged."""
    box = PixelBox.of_mask(np.isfinite(error), margin=0.03)
    image = pictures.error_picture(pictures.shrink(box.of(error), MAP_WIDTH), end)
    return pictures.enlarged(image, max(1, MAP_WIDTH // image.shape[1]))

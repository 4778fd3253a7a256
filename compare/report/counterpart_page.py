"""The page of two captures compared: the verdict, each method's difference and likeness, error maps side by side."""

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report import page, pictures
from compare.report.maps import colour_scale
from compare.report.pictures import Box

MAP_WIDTH = 360
LEVELS = {"alike": "good", "alike in part": "care", "not alike": "bad", "not known": "unknown"}


def counterpart_page(found: dict[str, Any], errors: Mapping[str, Mapping[str, NDArray]]) -> str:
    """Return the page, one file that fetches nothing.

    Parameters
    ----------
    found : dict
        What `experiments.compare_folders.compare_folders` returns.
    errors : mapping
        By capture (real, twin), then by method: error map (H, W), degrees, NaN where unknown.
    """
    names = {
        kind: f"{escape(one['name'])} <small>{escape(one['kind'])}</small>" for kind, one in found["captures"].items()
    }
    rows = [
        {**row, "name": name, "badge": page.badge(LEVELS[row["likeness"]], row["likeness"])}
        for name, row in found["methods"].items()
    ]
    badge = page.badge(LEVELS[found["verdict"]], found["verdict"])
    first = page.say("two", "verdict", **rows[0])
    lines = [(f"Real and twin {badge}", f"{' against '.join(names.values())}: {first}")]
    table = page.table_of("two", rows, caption=page.say("two", "table"))
    if not found["laid_over"]:
        table += page.absent(page.words("two")["apart"])
    if found["left_out"]:
        table += page.absent(f"Left out, without a known error on one of the two: {', '.join(found['left_out'])}.")
    chapters = {
        "Verdict": page.verdict_section("Do they fail alike?", lines),
        "Methods": page.section("methods", "Method by method", table),
        "Where": _maps(found, errors, names),
    }
    subtitle = f"{found['created']} · rgbn {found['versions'].get('rgbn', '')}"
    return page.whole_page(found["name"], "Two captures compared", escape(subtitle), chapters)


def _maps(found: dict[str, Any], errors: Mapping[str, Mapping[str, NDArray]], names: dict[str, str]) -> str:
    """Return both captures' error maps, a pair a method, on one scale."""
    spread = [np.nanquantile(errors[kind][name], 0.95) for kind in names for name in found["methods"]]
    end, pairs = pictures.colour_scale_end(float(np.median(spread))), ""
    for name, row in found["methods"].items():
        cells = ""
        for kind, of in names.items():
            error = errors[kind][name]
            box = Box.of_mask(np.isfinite(error), margin=0.03)
            image = pictures.error_picture(pictures.shrink(box.of(error), MAP_WIDTH), end)
            image = pictures.enlarged(image, max(1, MAP_WIDTH // image.shape[1]))
            caption = f"<b>{escape(name)}</b>, {of}: median {page.number(row[kind]['median_deg'], 2, '°')}"
            cells += page.picture(image, f"error map, {name}, {kind}", caption, kind="map")
        pairs += f'<div class="errors">{cells}</div>'
    many = " many" if len(found["methods"]) > 1 else ""
    body = f'{colour_scale(end)}<div class="error-pairs{many}">{pairs}</div>'
    return page.section("errors", "Where the errors are", body, page.say("maps", "errors", end=end))

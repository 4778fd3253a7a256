"""The report's section on which normals to believe: predicted errors, beside the true ones where they are known."""

from html import escape
from typing import Any

from compare.report import page, pictures
from compare.report.facts import Material, Summary
from compare.report.maps import colour_scale, map_box

WORSE = 3.0
"""Times as much unexplained, and as large a predicted error, from which on a method is not to be used."""


def trust_sentence(found: dict[str, Any]) -> str:
    """Return which method to take, how far it is off by prediction, and which not to use."""
    methods = {name: row for name, row in found["methods"].items() if name != "best"}
    recommended, best = found["recommended"], found["methods"]["best"]
    first = methods[recommended]
    text = f"{recommended}, {first['mean_deg']:.1f} ± {found['doubt_deg']:.1f} degrees off (mean, predicted)"
    level = [
        name
        for name, row in methods.items()
        if name != recommended and row["mean_deg"] - first["mean_deg"] <= found["doubt_deg"]
    ]
    if level:
        text += f"; {', '.join(level)} {'is' if len(level) == 1 else 'are'} level with it"
    text += f". All answers joined (best): {best['mean_deg']:.1f} degrees."
    bad = [f"{name} ({row['explains']:.0f} times)" for name, row in methods.items() if _is_bad(row, first)]
    if bad:
        text += f" Do not use what explains the photographs so much worse: {', '.join(bad)}."
    return text


def _is_bad(row: dict[str, Any], first: dict[str, Any]) -> bool:
    """Whether both photographs and prediction speak against a method."""
    worse = row["explains"] is not None and row["explains"] > WORSE
    return worse and row["mean_deg"] > WORSE * first["mean_deg"]


def trust_section(material: Material, summary: Summary) -> str:
    """Return the predicted errors as a table and as maps, and what to take; nothing where they were not asked for."""
    found = summary.get("trust")
    if not found:
        return ""
    known = any("true" in row for row in found["methods"].values())
    heads = ["method", "median", "mean", "90 %", "unexplained"] + (["true mean", "within 2 sigma"] if known else [])
    rows = []
    for name, row in sorted(found["methods"].items(), key=lambda pair: pair[1]["mean_deg"]):
        cells = [escape(name), *(page.number(row[key], 1, "°") for key in ("median_deg", "mean_deg", "p90_deg"))]
        cells.append("–" if row["explains"] is None else f"× {row['explains']:.1f}")
        if true := row.get("true"):
            cells += [page.number(true["mean_deg"], 1, "°"), f"{true['within_2_sigma']:.0%}"]
        rows.append(tuple(cells))
    box, width = map_box(material)
    names = list(dict.fromkeys((found["recommended"], "best")))
    end = max(5.0, 2 * max(found["methods"][name]["p90_deg"] for name in names))
    figures = "".join(
        page.picture(
            pictures.error_picture(pictures.shrink(box.of(predicted), width), end),
            f"predicted error, {name}",
            f"{escape(name)}: predicted error",
            kind="map",
        )
        for name in names
        if (predicted := material.map_of("trust", name)) is not None
    )
    body = page.table(tuple(heads), rows, caption=page.say("trust", "table"))
    if figures:
        body += f'{colour_scale(end)}<div class="gallery">{figures}</div>'
    return page.section("trust", "Which normals to believe", body, escape(f"Take {trust_sentence(found)}"))

"""The page of two captures compared: the verdict and why, error maps side by side, statistics, the methods' order."""

from html import escape
from typing import Any

import numpy as np

from compare.report import page, pictures
from compare.report.maps import colour_scale
from compare.report.pictures import Box
from compare.statistics.counterpart_draws import Capture
from compare.statistics.counterpart_verdict import ALIKE_FROM, MARGIN_DEG, MARGIN_SHARE, STRUCTURED
from draw.line_chart import interval_chart

Found = dict[str, Any]

MAP_WIDTH = 360
STATISTICS = {"mean_deg": "mean", "median_deg": "median", "q1_deg": "Q1", "q3_deg": "Q3"}
LEVELS = {"alike": "good", "not shown": "unknown", "differ": "bad"}
TOPICS = {"level": "How large", "pattern": "Where", "order": "Which method"}


def counterpart_page(found: Found, real: Capture, twin: Capture, title: str, subtitle: str) -> str:
    """Return the page, one file that fetches nothing, of what `compare_counterparts` found of two captures."""
    bars = {"alike_from": ALIKE_FROM, "structured_percent": 100 * STRUCTURED}
    terms = [(term, text.format(**bars)) for term, text in page.words("counterparts", "how_to_read").items()]
    chapters = {
        "Verdict": _verdict(found),
        "Where": _maps(found, {"real": real, "twin": twin}),
        "How large": _statistics(found),
        "Patterns": _patterns(found),
        "Order of the methods": _order(found),
        "What sigma holds": _carried(found),
        "How to read": page.section("how-to-read", "How to read this page", page.definitions(terms)),
    }
    return page.whole_page(title, "Two captures compared", escape(subtitle), chapters)


def badge_of(answer: str) -> str:
    """Return an answer as a word in a coloured frame."""
    return page.badge(LEVELS[answer], answer)


def _names_of(found: Found) -> dict[str, str]:
    """Return what the two captures are called, as HTML."""
    return {
        kind: f"{escape(one['name'])} <small>{escape(one['kind'])}</small>" for kind, one in found["captures"].items()
    }


def _in_order(found: Found) -> dict[str, Found]:
    """Return the methods' rows, the smallest median error of the photographs first."""
    return {name: found["methods"][name] for name in found["order"]["order"]["real"]}


def _with_sigma(deg: float, sigma_deg: float, *, bold: bool = False) -> str:
    text = f"{page.number(deg, 2)} ± {page.number(sigma_deg, 2)}"
    return f"<b>{text}</b>" if bold else text


def _verdict(found: Found) -> str:
    lines = [(f"Real and twin {badge_of(found['verdict'])}", f"{' against '.join(_names_of(found).values())}.")]
    for question, answer in found["reasons"].items():
        text = page.words("counterparts", question)[answer] + _because(found, question)
        lines.append((f"{TOPICS[question]} {badge_of(answer)}", text))
    return page.verdict_section("Do they fail alike?", lines)


def _because(found: Found, question: str) -> str:
    methods, order = found["methods"], found["order"]
    if question == "level":
        worst = max(methods, key=lambda name: abs(methods[name]["difference"]["median_deg"]["deg"]))
        return page.say("two", "worst", name=worst, p=found["level"]["p"], **methods[worst]["difference"]["median_deg"])
    if question == "pattern":
        if not found["laid_over"]:
            return page.say("two", "apart")
        there = [name for name, row in methods.items() if page.is_number(row["pattern"].get("pearson"))]
        shown = ", ".join(f"{escape(name)} {page.number(methods[name]['pattern']['pearson'], 2)}" for name in there)
        return f" Pearson: {shown}." if shown else ""
    changed = "; ".join(f"{a} and {b}" for a, b in order["contradictions"])
    return page.say("two", "tau", **order) + (page.say("two", "changed", pairs=changed) if changed else "")


def _maps(found: Found, sides: dict[str, Capture]) -> str:
    names, methods, rows = _names_of(found), _in_order(found), []
    spread = [np.nanquantile(side.errors[name], 0.95) for side in sides.values() for name in methods]
    end = pictures.colour_scale_end(float(np.median(spread)))
    for name, row in methods.items():
        cells = ""
        for kind, side in sides.items():
            error = side.errors[name]
            box = Box.of_mask(np.isfinite(error), margin=0.03)
            image = pictures.error_picture(pictures.shrink(box.of(error), MAP_WIDTH), end)
            image = pictures.enlarged(image, max(1, MAP_WIDTH // image.shape[1]))
            caption = f"<b>{escape(name)}</b>, {names[kind]}: median {page.number(row[kind]['median_deg'], 2, '°')}"
            cells += page.picture(image, f"error map, {name}, {kind}", caption, kind="map")
        rows.append(cells)
    body = colour_scale(end) + error_pairs(rows, many=len(methods) > 1)
    return page.section("errors", "Where the errors are", body, page.say("maps", "errors", end=end))


def _statistics(found: Found) -> str:
    rows, medians = [], {}
    for name, row in _in_order(found).items():
        medians[name] = {kind: (row[kind]["median_deg"], row[kind]["sigma"]["median_deg"]) for kind in ("real", "twin")}
        for kind in ("real", "twin"):
            cells = [_with_sigma(row[kind][key], row[kind]["sigma"][key]) for key in STATISTICS]
            rows.append((f"{escape(name)} <small>{kind}</small>", *cells, ""))
        differences = (row["difference"][key] for key in STATISTICS)
        cells = [_with_sigma(one["deg"], one["sigma_deg"], bold=one["significant"]) for one in differences]
        rows.append((f"{escape(name)} <small>real − twin</small>", *cells, badge_of(row["level"])))
    head = ("method", *STATISTICS.values(), "as large?")
    body = page.table(head, rows, caption=page.say("two", "statistics"), kind="numbers")
    chart = interval_chart(medians, x_title="median angular error, degrees; bars: two sigma to either side")
    if found["left_out"]:
        body += page.absent(f"Left out, without a known error on one of the two: {', '.join(found['left_out'])}.")
    lead = f"As large: closer than {MARGIN_DEG:g}° or {100 * MARGIN_SHARE:.0f} % of their mean, whichever is more."
    return page.section("statistics", "How large the errors are", f'<div class="speed">{chart}</div>{body}', lead)


def _patterns(found: Found) -> str:
    if not found["laid_over"]:
        return page.section("patterns", "Patterns", page.absent("The two do not show the object at the same pixels."))
    rows = [
        {**row["pattern"], "name": name, "same": badge_of(row["pattern"]["verdict"])}
        for name, row in _in_order(found).items()
    ]
    body = page.table_of("patterns", rows, caption=page.say("two", "patterns"))
    return page.section("patterns", "Whether the errors lie at the same places", body)


def _order(found: Found) -> str:
    order, title, columns = found["order"], "The order of the methods", ""
    if len(found["methods"]) < 2:
        return page.section("order", title, page.absent("One method alone has no order."))
    for kind, name in _names_of(found).items():
        told = "".join(f"<li>{escape(text).replace('`', '')}</li>" for text in order["sentences"][kind])
        columns += f"<div><h3>{name}</h3><ol>{told}</ol></div>"
    rows = []
    for pair in order["pairs"]:
        both = (pair[kind] for kind in ("real", "twin"))
        cells = [_with_sigma(one["difference_deg"], one["sigma_deg"], bold=one["significant"]) for one in both]
        rows.append((f"{escape(pair['b'])} − {escape(pair['a'])}", *cells))
    caption = "Degrees ± one sigma; bold: significant."
    listed = page.table(("median error", "real", "twin"), rows, caption=caption, kind="numbers")
    body = f'<div class="pair">{columns}</div>' + page.folded("Every two methods", listed)
    return page.section("order", title, body, "Each method against the next better one, by median error.")


def _carried(found: Found) -> str:
    """Return what the sigmas hold, for each capture."""
    rows = []
    for kind, title in _names_of(found).items():
        one = found["captures"][kind]["carried"]
        text = escape(one.get("why", "nothing"))
        if one.get("moves"):
            moved = [page.say("moved", key, **one) for key in page.words("moved") if page.is_number(one.get(key))]
            text = ", ".join(moved) + page.say("two", "solved again", **one)
            if one.get("not_carried"):
                text += page.say("two", "not carried", names=", ".join(one["not_carried"]))
        rows.append((title, "blocks of pixels", text))
    lead = "Sigmas are medians of those in lights.json, and those in pose.json."
    return page.section(
        "carried", "What the sigmas hold", page.table(("capture", "drawn", "moved by one sigma"), rows), lead
    )


def error_pairs(rows: list[str], *, many: bool) -> str:
    """Return pairs of maps, real beside twin, one pair below or, if many, beside the other."""
    pairs = "".join(f'<div class="errors">{row}</div>' for row in rows)
    return f'<div class="error-pairs{" many" if many else ""}">{pairs}</div>'

"""The page of two captures compared: the verdict and why, error maps side by side, statistics, the methods' order."""

from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report import pictures
from compare.report.counterpart_words import ANSWERS, TOPICS, badge_of, carried_section, how_to_read_section, names_of
from compare.report.interval_chart import interval_chart
from compare.report.maps import colour_scale
from compare.report.page import absent, is_number, number, percent, picture, section, table
from compare.report.pictures import Box
from compare.statistics.counterpart_draws import Capture
from compare.statistics.counterpart_verdict import MARGIN_DEG, MARGIN_SHARE

Found = dict[str, Any]

MAP_WIDTH = 360


def counterpart_page(found: Found, real: Capture, twin: Capture, title: str, subtitle: str) -> str:
    """Return the page, one file that fetches nothing.

    Parameters
    ----------
    found : dict
        Of `compare.statistics.counterpart_verdict.compare_counterparts`.
    real, twin : Capture
        What it was made of.
    title, subtitle : str
    """
    here = Path(__file__).parent
    body = [
        _verdict(found),
        _maps(found, real, twin),
        _statistics(found),
        _patterns(found),
        _order(found),
        carried_section(found),
        how_to_read_section(),
    ]
    chapters = (
        ("verdict", "Verdict"),
        ("errors", "Where"),
        ("statistics", "How large"),
        ("patterns", "Patterns"),
        ("order", "Order of the methods"),
        ("carried", "What sigma holds"),
        ("how-to-read", "How to read"),
    )
    return Template((here / "report_template.html").read_text(encoding="utf-8")).substitute(
        title=escape(title),
        kind="Two captures compared",
        subtitle=escape(subtitle),
        chapters="".join(f'<a href="#{anchor}">{words}</a>' for anchor, words in chapters),
        style=(here / "report_style.css").read_text(encoding="utf-8"),
        plotly="",
        body="\n".join(body),
    )


def _verdict(found: Found) -> str:
    real, twin = names_of(found)
    head = f"<li><h3>Real and twin {badge_of(found['verdict'])}</h3><p>{real} against {twin}.</p></li>"
    rows = "".join(
        f"<li><h3>{TOPICS[question]} {badge_of(answer)}</h3><p>{_because(found, question, answer)}</p></li>"
        for question, answer in found["reasons"].items()
    )
    return f'<section id="verdict" class="verdict"><h2>Do they fail alike?</h2><ul>{head}{rows}</ul></section>'


def _because(found: Found, question: str, answer: str) -> str:
    text = ANSWERS[question][answer]
    methods, order = found["methods"], found["order"]
    if question == "level":
        worst = max(methods, key=lambda name: abs(methods[name]["difference"]["median_deg"]["deg"]))
        row = methods[worst]["difference"]["median_deg"]
        text += (
            f" The median differs most for <b>{escape(worst)}</b>: real − twin {number(row['deg'], 2, '°')}, sigma "
            f"{number(row['sigma_deg'], 2, '°')}. Were all errors as large on "
            f"both, chance would bring up so large a largest difference with {percent(found['level']['p'], 1)}."
        )
    elif question == "pattern" and not found["laid_over"]:
        text += " The two do not show the object at the same pixels, so maps cannot be laid over each other."
    elif question == "pattern":
        shown = [
            f"{escape(name)} {number(row['pattern']['pearson'], 2)}"
            for name, row in methods.items()
            if is_number(row["pattern"].get("pearson"))
        ]
        text += f" Pearson: {', '.join(shown)}." if shown else ""
    elif question == "order":
        text += (
            f" Kendall's tau {number(order['tau'], 2)}, {number(order['tau_low'], 2)} to "
            f"{number(order['tau_high'], 2)} (90 %)."
        )
        if order["contradictions"]:
            text += " Changed: " + "; ".join(f"{escape(a)} and {escape(b)}" for a, b in order["contradictions"]) + "."
    return text


def _maps(found: Found, real: Capture, twin: Capture) -> str:
    maps = {"real": real.errors, "twin": twin.errors}
    methods = _in_order(found)
    spread = [np.nanquantile(of[name], 0.95) for of in maps.values() for name in methods]
    end, rows = pictures.colour_scale_end(float(np.median(spread))), []
    names = dict(zip(maps, names_of(found), strict=True))
    for name in methods:
        cells = []
        for kind, of in maps.items():
            error = of[name]
            box = Box.of_mask(np.isfinite(error), margin=0.03)
            image = pictures.error_picture(pictures.shrink(error[box.rows, box.columns], MAP_WIDTH), end)
            row = found["methods"][name][kind]
            caption = f"<b>{escape(name)}</b>, {names[kind]}: median {number(row['median_deg'], 2, '°')}"
            uri = pictures.data_uri(_enlarged(image), photograph=False)
            cells.append(picture(uri, f"error map, {name}, {kind}", caption, kind="map"))
        rows.append(f'<div class="errors">{"".join(cells)}</div>')
    many = " many" if len(methods) > 1 else ""
    lead = f"One colour scale for all maps, 0° to {number(end, 0, '°')}; what is beyond has its last colour."
    return section(
        "errors",
        "Where the errors are",
        colour_scale(end) + f'<div class="error-pairs{many}">{"".join(rows)}</div>',
        lead,
    )


def _enlarged(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    # A browser smooths what it enlarges; pixels are to be seen.
    times = max(1, MAP_WIDTH // image.shape[1])
    return np.repeat(np.repeat(image, times, 0), times, 1)


def _in_order(found: Found) -> list[str]:
    return list(found["order"]["order"]["real"])


def _statistics(found: Found) -> str:
    keys = (("mean_deg", "mean"), ("median_deg", "median"), ("q1_deg", "Q1"), ("q3_deg", "Q3"))
    rows = []
    for name in _in_order(found):
        row = found["methods"][name]
        for kind in ("real", "twin"):
            cells = [f"{number(row[kind][key], 2)} ± {number(row[kind]['sigma'][key], 2)}" for key, _ in keys]
            rows.append((f"{escape(name)} <small>{kind}</small>", *cells, ""))
        cells = [
            ("<b>{}</b>" if one["significant"] else "{}").format(
                f"{number(one['deg'], 2)} ± {number(one['sigma_deg'], 2)}"
            )
            for one in (row["difference"][key] for key, _ in keys)
        ]
        rows.append((f"{escape(name)} <small>real − twin</small>", *cells, badge_of(row["level"])))
    caption = "Angular error, degrees ± one sigma. Bold: larger than chance, all methods and figures taken together."
    body = table(("method", *(words for _, words in keys), "as large?"), rows, caption=caption, kind="numbers")
    chart = interval_chart(
        {
            name: {kind: (row[kind]["median_deg"], row[kind]["sigma"]["median_deg"]) for kind in ("real", "twin")}
            for name, row in ((name, found["methods"][name]) for name in _in_order(found))
        },
        x_title="median angular error, degrees; bars: two sigma to either side",
    )
    if found["left_out"]:
        body += absent(f"Left out, without a known error on one of the two: {', '.join(found['left_out'])}.")
    lead = f"As large: closer than {MARGIN_DEG:g}° or {100 * MARGIN_SHARE:.0f} % of their mean, whichever is more."
    return section("statistics", "How large the errors are", f'<div class="speed">{chart}</div>{body}', lead)


def _patterns(found: Found) -> str:
    if not found["laid_over"]:
        return section("patterns", "Patterns", absent("The two do not show the object at the same pixels."))
    rows = []
    for name in _in_order(found):
        row = found["methods"][name]["pattern"]
        cells = [
            f"{number(row.get(key), 2)} <small>{number(row.get(f'{key}_low'), 2)} to "
            f"{number(row.get(f'{key}_high'), 2)}</small>"
            for key in ("pearson", "spearman")
        ]
        shares = [percent((row.get("structured") or {}).get(kind)) for kind in ("real", "twin")]
        rows.append((escape(name), *cells, *shares, number(row["pixels"]), badge_of(row["verdict"])))
    head = ("method", "Pearson", "Spearman", "no noise, real", "no noise, twin", "pixels in both", "same places?")
    caption = (
        "Correlation of the two error maps and its 95 % interval. “No noise”: share of a map's variance that "
        "neighbours a few pixels apart have in common."
    )
    return section(
        "patterns", "Whether the errors lie at the same places", table(head, rows, caption=caption, kind="numbers")
    )


def _order(found: Found) -> str:
    order = found["order"]
    if len(found["methods"]) < 2:
        return section("order", "The order of the methods", absent("One method alone has no order."))
    columns = []
    for kind, title in zip(("real", "twin"), names_of(found), strict=True):
        told = "".join(f"<li>{escape(text).replace('`', '')}</li>" for text in order["sentences"][kind])
        columns.append(f"<div><h3>{title}</h3><ol>{told}</ol></div>")
    rows = []
    for pair in order["pairs"]:
        cells = []
        for kind in ("real", "twin"):
            one = pair[kind]
            text = f"{number(one['difference_deg'], 2)} ± {number(one['sigma_deg'], 2)}"
            cells.append(f"<b>{text}</b>" if one["significant"] else text)
        rows.append((f"{escape(pair['b'])} − {escape(pair['a'])}", *cells))
    listed = table(
        ("median error", "real", "twin"), rows, caption="Degrees ± one sigma; bold: significant.", kind="numbers"
    )
    body = f'<div class="pair">{"".join(columns)}</div><details><summary>Every two methods</summary>{listed}</details>'
    lead = "Each method against the next better one, by median error."
    return section("order", "The order of the methods", body, lead)

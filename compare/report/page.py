"""The report's smallest pieces: numbers that can be traced, tables, figures, badges, sections; everything escaped."""

import functools
import json
import math
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from html import escape, unescape
from pathlib import Path
from string import Formatter, Template
from typing import Any, TypeGuard

from scene.map_pictures import Image, data_uri

HERE = Path(__file__).parent
UNKNOWN = '<span class="unknown">unknown</span>'

LEVELS = {"good": "good", "care": "take care", "bad": "do not rely on it", "unknown": "not known"}
"""What a verdict's badge says. Words, not colours alone: the page is also printed."""


@functools.cache
def words(*part: str) -> dict[str, Any]:
    """Return a part of report_words.toml by name."""
    found = tomllib.loads((HERE / "report_words.toml").read_text("utf-8"))
    for name in part:
        found = found[name]
    return found


def say(part: str, name: str, /, **values: Any) -> str:
    """Return a sentence of report_words.toml as HTML, its {names} filled in by `Sentence`."""
    return Sentence().vformat(words(part)[name], (), values)


class Sentence(Formatter):
    """Fills in texts escaped, {x:2px} by `number`, {x:1%} by `percent`, {x:html} as it is; missing is unknown."""

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        try:
            return super().get_field(field_name, args, kwargs)
        except (LookupError, TypeError):
            return None, field_name

    def format_field(self, value: Any, format_spec: str) -> str:
        decimals, unit = format_spec[:1], format_spec[1:]
        if isinstance(value, str):
            return value if format_spec == "html" else escape(value)
        return percent(value, int(decimals)) if unit == "%" else number(value, int(decimals or 0), unit)


def number(value: Any, decimals: int = 2, unit: str = "") -> str:
    """Return a number as HTML; its full value stays in data-value, where the tests look it up in the summary."""
    if not is_number(value):
        return UNKNOWN
    if isinstance(value, int):
        shown = f"{value:,}".replace(",", "\u202f")
    else:
        shown = f"{value:.{decimals}f}"
        # 0.003 must not be shown as 0.00, nor -0.00.
        if value and float(shown) == 0:
            shown = f"{value:.1g}" if abs(value) >= 1e-6 else f"{value:.0e}"
    return _tagged(value, shown.replace("-", "\u2212"), unit)


def round_number(value: float, unit: str = "") -> str:
    """Return a number that people chose, a bar, as HTML with as few digits as it has: 1, not 1.000."""
    return _tagged(value, f"{value:g}".replace("-", "\u2212"), unit)


def percent(share: Any, decimals: int = 0) -> str:
    """Return a share (0 to 1) as HTML, in percent."""
    if not is_number(share):
        return UNKNOWN
    shown = f"{100 * share:.{decimals}f}"
    if 0 < share < 1 and float(shown) in (0, 100):
        # All but a few pixels is not all of them.
        shown = "over 99.9" if share > 0.9995 else "under 0.1" if share < 0.0005 else f"{100 * share:.1f}"
    return _tagged(share, shown, "%")


def is_number(value: Any) -> TypeGuard[float]:
    """Tell whether the value can be shown as a number: not None, not NaN, not infinite."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _tagged(value: float, shown: str, unit: str) -> str:
    gap = "" if unit in {"", "°"} else "\u202f"
    return f'<span class="n" data-value="{value!r}">{shown}{gap}{escape(unit)}</span>'


def as_text(value: Any) -> str:
    """Return a setting as a short text."""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(as_text(item) for item in value)
    if isinstance(value, dict):
        return "; ".join(f"{key} {as_text(item)}" for key, item in value.items())
    return json.dumps(value, default=str)


def plain(html: str) -> str:
    """Return the text of a piece of HTML."""
    return unescape(re.sub(r"<[^>]+>", "", html))


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, caption: str = "", kind: str = "") -> str:
    """Return a table of cells that are HTML already; the first column is each row's heading."""
    lines = [f'<table class="{kind}">']
    if caption:
        lines.append(f"<caption>{caption}</caption>")
    lines.append("<thead><tr>" + "".join(f'<th scope="col">{cell}</th>' for cell in head) + "</tr></thead><tbody>")
    for first, *rest in rows:
        lines.append(f'<tr><th scope="row">{first}</th>' + "".join(f"<td>{cell}</td>" for cell in rest) + "</tr>")
    lines.append("</tbody></table>")
    name = escape(plain(caption) or "table", quote=True)
    return f'<div class="scroll" role="group" tabindex="0" aria-label="{name}">{"".join(lines)}</div>'


def table_of(name: str, rows: Iterable[Mapping[str, Any]], *, caption: str = "", kind: str = "numbers") -> str:
    """Return a table whose columns, (heading, sentence to be filled in), stand in report_words.toml."""
    columns, sentence = words("tables")[name], Sentence()
    lines = [[sentence.vformat(cell, (), row) for _, cell in columns] for row in rows]
    return table([head for head, _ in columns], lines, caption=caption, kind=kind)


def definitions(words: Iterable[tuple[str, str]]) -> str:
    """Return terms, each with what it means; both are plain text."""
    return f"<dl>{''.join(f'<dt>{escape(term)}</dt><dd>{escape(text)}</dd>' for term, text in words)}</dl>"


def folded(title: str, body: str) -> str:
    """Return what is shown when the reader asks for it."""
    return f"<details><summary>{title}</summary>{body}</details>"


def picture(
    image: Image, alt: str, caption: str = "", *, photograph: bool = False, overlay: str = "", kind: str = ""
) -> str:
    """Return a figure: an image, drawings that lie on it, and what is to be seen (HTML)."""
    below = f"<figcaption>{caption}</figcaption>" if caption else ""
    shown = f'<img src="{data_uri(image, photograph=photograph)}" alt="{escape(alt)}">'
    return f'<figure class="{kind}"><div class="stack">{shown}{overlay}</div>{below}</figure>'


def wiper(left: tuple[str, str], right: tuple[str, str], caption: str) -> str:
    """Return two pictures of one size on each other, and a slider that wipes or fades between them.

    `left`, `right`: the URI of a picture, and what it is. `caption` is HTML.
    """
    values: dict[str, str] = dict(
        zip(("left_uri", "left", "right_uri", "right"), map(escape, (*left, *right)), strict=True)
    )
    return Template((HERE / "report_wiper.html").read_text("utf-8")).substitute(values, caption=caption)


def drawing(width: int, height: int, shapes: str, *, label: str) -> str:
    """Return an SVG that lies over an image and counts in that image's full pixels from its corner."""
    return (
        f'<svg viewBox="0 0 {width} {height}" preserveAspectRatio="none" role="img" '
        f'aria-label="{escape(label)}">{shapes}</svg>'
    )


def polyline(points: Iterable[Sequence[float]], kind: str) -> str:
    """Return a closed line through pixels (K, 2)."""
    path = " ".join(f"{u:.1f},{v:.1f}" for u, v in points)
    return f'<polygon class="{kind}" points="{path}"/>'


def badge(level: str, words: str = "") -> str:
    """Return a verdict as a word in a coloured frame: the level's own, or another."""
    return f'<span class="badge {level}">{words or LEVELS[level]}</span>'


def chart(drawing: str, kind: str = "") -> str:
    """Return a drawing as a figure."""
    return f'<figure class="chart {kind}">{drawing}</figure>'


def absent(text: str) -> str:
    """Return the sentence that stands where a part would be: what is missing, and why."""
    return f'<p class="absent">{escape(text)}</p>'


def folded_section(html: str) -> str:
    """Return a section with all but its title folded away; a link to it opens it."""
    html = re.sub(r"(<section[^>]*>)<h2>(.*?)</h2>", r"\1<details><summary><h2>\2</h2></summary>", html, count=1)
    return html.removesuffix("</section>") + "</details></section>"


def section(anchor: str, title: str, body: str, lead: str = "") -> str:
    """Return a section; `body` and `lead` are HTML already."""
    lead = f'<p class="lead">{lead}</p>' if lead else ""
    return f'<section id="{anchor}"><h2>{escape(title)}</h2>{lead}{body}</section>'


def verdict_section(title: str, lines: Iterable[tuple[str, str]]) -> str:
    """Return the box on top: one line a topic, (heading, sentence), both HTML."""
    rows = "".join(f"<li><h3>{heading}</h3><p>{sentence}</p></li>" for heading, sentence in lines)
    return f'<section id="verdict" class="verdict"><h2>{title}</h2><ul>{rows}</ul></section>'


def whole_page(title: str, kind: str, subtitle: str, chapters: Mapping[str, str], *, script: str = "") -> str:
    """Return the page: `chapters` are sections by their names in the row of links; `subtitle` is HTML already."""
    anchors = [(re.search(r'<section id="([\w-]+)"', html), words) for words, html in chapters.items()]
    return Template((HERE / "report_template.html").read_text(encoding="utf-8")).substitute(
        title=escape(title),
        kind=kind,
        subtitle=subtitle,
        chapters="".join(f'<a href="#{found[1]}">{words}</a>' for found, words in anchors if found),
        style=(HERE / "report_style.css").read_text(encoding="utf-8"),
        script=script,
        body="\n".join(chapters.values()),
    )

"""Pages: numbers that can be traced, sentences, tables, figures and the templates around them; everything escaped."""

import functools
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from html import unescape
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from compare.report.pictures import error_scale_colours
from draw.readable import GAP, Readable, is_number

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


def say(part: str, name: str, /, **values: Any) -> Markup:
    """Return a sentence of report_words.toml as HTML, its {names} filled in by `Sentence`."""
    return Markup(Sentence().vformat(words(part)[name], (), values))


class Sentence(Readable):
    """Fills in texts escaped (`Markup` as it is) and numbers as HTML; what is missing is unknown.

    A part between [[ and ]] is left out where a value in it is missing.
    """

    def vformat(self, format_string: str, args: Any, kwargs: Any) -> str:
        parts = [super(Sentence, self).vformat(part, args, kwargs) for part in re.split(r"\[\[|]]", format_string)]
        return "".join(part for number, part in enumerate(parts) if number % 2 == 0 or UNKNOWN not in part)

    def get_field(self, field_name: str, args: Any, kwargs: Any) -> Any:
        try:
            return super().get_field(field_name, args, kwargs)
        except (LookupError, TypeError):
            return None, field_name

    def words(self, text: str) -> str:
        return escape(text)

    def missing(self) -> str:
        return UNKNOWN

    def number(self, value: float, shown: str, unit: str) -> str:
        """Return a number; its full value stays in data-value, where the tests look it up in the summary."""
        gap = "" if unit in {"", "°"} else GAP
        return f'<span class="n" data-value="{value!r}">{shown.replace("-", chr(0x2212))}{gap}{escape(unit)}</span>'


def number(value: Any, decimals: int | str = 2, unit: str = "") -> Markup:
    """Return a number as HTML; with the unit % a share (0 to 1), with g for decimals one that people chose."""
    return Markup(Sentence().format_field(value, f"{decimals}{unit}"))


def as_text(value: Any) -> str:
    """Return a setting as a short text."""
    if isinstance(value, dict):
        return "; ".join(f"{key} {as_text(item)}" for key, item in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(as_text, value))
    if isinstance(value, str | float):
        return value if isinstance(value, str) else f"{value:.6g}"
    return json.dumps(value, default=str)


def plain(html: str) -> str:
    """Return the text of a piece of HTML."""
    return unescape(re.sub(r"<[^>]+>", "", html))


def first_sentence(text: str) -> str:
    """Return a text's first sentence, whole."""
    found = re.match(r".*?[.?!](?=\s+[A-Z]|$)", text, re.DOTALL)
    return found[0] if found else text


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, caption: str = "", kind: str = "") -> str:
    """Return a table of cells that are HTML already; the first column is each row's heading."""
    name = plain(caption) or "table"
    lines = [[*map(Markup, row)] for row in rows]
    return pieces().table([*map(Markup, head)], lines, Markup(caption), kind, name)


Rows = Iterable[Mapping[str, Any]] | Mapping[str, Any]
"""Of a table: by name, or with the name in them; each has its number, from 1, too."""


def table_of(name: str, rows: Rows, *, caption: str = "", kind: str = "numbers") -> str:
    """Return a table as `cells_of` has it."""
    head, lines = cells_of(name, rows)
    return table(head, lines, caption=caption, kind=kind)


def cells_of(name: str, rows: Rows, fill: Callable[[str, Any], str] | None = None) -> tuple[list[str], list[list[str]]]:
    """Return a table's headings and cells: its columns, (heading, sentence to fill in), stand in report_words.toml."""
    columns, fill = words("tables")[name], fill or (lambda sentence, row: Sentence().vformat(sentence, (), row))
    named = [{"name": key, **row} for key, row in rows.items()] if isinstance(rows, Mapping) else rows
    counted = ({"number": str(number), **row} for number, row in enumerate(named, 1))
    return [head for head, _ in columns], [[fill(cell, row) for _, cell in columns] for row in counted]


def folded(title: str, body: str) -> Markup:
    """Return what is shown when the reader asks for it; both are HTML already."""
    return Markup(f"<details><summary>{title}</summary>{body}</details>")


def badge(level: str, words: str = "") -> Markup:
    """Return a verdict as a word in a coloured frame: the level's own, or another."""
    return Markup('<span class="badge {}">{}</span>').format(level, words or LEVELS[level])


def section(anchor: str, title: str, body: str, lead: str = "") -> str:
    """Return a section; `body` and `lead` are HTML already."""
    return pieces().section(anchor, title, Markup(lead), Markup(body))


def whole_page(title: str, kind: str, subtitle: str, body: str, *, script: str = "") -> str:
    """Return the page, its row of links to all sections of `body`; that and `subtitle` are HTML already."""
    sections = re.findall(r'<section id="([\w-]+)">(?:<details><summary>)?<h2(?: data-link="(.*?)")?>(.*?)<', body)
    style = (HERE / "report_style.css").read_text(encoding="utf-8")
    return environment().get_template("report_template.html").render(
        title=title, kind=kind, subtitle=Markup(subtitle), style=Markup(style), script=Markup(script),
        links=[(anchor, Markup(short or words)) for anchor, short, words in sections], body=Markup(body),
    )  # fmt: skip


@functools.cache
def environment() -> Any:
    """Return what templates are read by; what is put into one is escaped, and what is missing is nothing."""
    from jinja2 import ChainableUndefined, Environment, FileSystemLoader

    how = {"autoescape": True, "undefined": ChainableUndefined, "trim_blocks": True, "lstrip_blocks": True}
    made = Environment(loader=FileSystemLoader(HERE), **how)
    made.policies["json.dumps_kwargs"] = {"allow_nan": False}
    shown = (badge, error_scale_colours, first_sentence, folded, is_number, number, say, table, table_of, words)
    made.globals |= {function.__name__: function for function in shown}
    return made


@functools.cache
def pieces() -> Any:
    """Return the macros of pieces.html."""
    return environment().get_template("pieces.html").module

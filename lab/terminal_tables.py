"""Tables for a terminal, their columns and lines declared beside those of the report, in `tables` of its words.

A form, "{residual_px:2px}", is filled in with a row's values by `draw.readable`; what is not known is left out.
"""

from collections.abc import Mapping
from io import StringIO
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from compare.report import page
from draw.readable import Readable
from lab.progress import is_quiet, log


def filled(form: str, values: Mapping[str, Any]) -> str:
    """Return a form filled in; "–" where a value is not known."""
    try:
        return Readable().vformat(form, (), values)
    except (LookupError, TypeError):
        return "–"


def cells_of(name: str, rows: page.Rows) -> dict[str, list[str]]:
    """Return the cells of each column of a table by their heads; columns without any value are left out."""
    heads, lines = page.cells_of(name, rows, filled)
    cells = {head: [line[place] for line in lines] for place, head in enumerate(heads)}
    return {head: column for head, column in cells.items() if not lines or {*column} - {"–", ""}}


def number_table(title: str, name: str, rows: page.Rows, caption: str = "") -> Any:
    """Return a table; columns without any value are left out. Texts stand left, numbers right."""
    table = Table(title=Text(title, style="bold"), title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.caption, table.caption_justify = caption or None, "left"
    cells, forms = cells_of(name, rows), dict(page.words("tables")[name])
    for head in cells:
        table.add_column(head, justify="right" if ":" in forms[head] else "left")
    for row in zip(*cells.values(), strict=True):
        table.add_row(*map(Text, row))
    return table


def fact_table(title: str, lines: Mapping[str, str] | str, values: Mapping[str, Any] | None = None) -> Any:
    """Return facts, a line each, what and how much: texts by what they tell, or a table's forms filled in."""
    table = Table(title=Text(title, style="bold"), title_justify="left", box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column()
    if isinstance(lines, str):
        lines = {what: filled(form, values or {}) for what, form in page.words("tables")[lines]}
    for what, text in lines.items():
        if text != "–":
            table.add_row(what, Text(text))
    return table


def show(*tables: Any, hidden: bool = False) -> None:
    """Print tables on standard output, unless they are hidden or only warnings are wanted, and into the run's log."""
    # Numbers in texts are no more important than the words.
    console = Console(file=StringIO() if hidden or is_quiet() else None, highlight=False, record=True)
    for table in tables:
        console.print(table)
        console.print()
    log(console.export_text())

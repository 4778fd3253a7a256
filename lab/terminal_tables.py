"""Tables for a terminal, their columns and lines declared as forms.

A form, "{residual_px:2px}", is filled in with a row's values by `draw.readable`; what is not known is left out.
"""

from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from draw.readable import Readable
from lab.progress import is_quiet, log


def filled(form: str, values: Mapping[str, Any]) -> str:
    """Return a form filled in; "–" where a value is not known."""
    try:
        return Readable().vformat(form, (), values)
    except (LookupError, TypeError):
        return "–"


def cells_of(columns: Mapping[str, str], rows: Sequence[Mapping[str, Any]]) -> dict[str, list[str]]:
    """Return the cells of each column, forms by their heads; columns without any value are left out."""
    cells = {head: [filled(form, row) for row in rows] for head, form in columns.items()}
    return {head: column for head, column in cells.items() if not rows or {*column} - {"–", ""}}


def number_table(title: str, columns: Mapping[str, str], rows: Iterable[Mapping[str, Any]], caption: str = "") -> Any:
    """Return a table, forms by their heads; columns without any value are left out. Texts stand left, numbers right."""
    table = Table(title=Text(title, style="bold"), title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    table.caption, table.caption_justify = caption or None, "left"
    cells = cells_of(columns, list(rows))
    for head in cells:
        table.add_column(head, justify="right" if ":" in columns[head] else "left")
    for row in zip(*cells.values(), strict=True):
        table.add_row(*map(Text, row))
    return table


def fact_table(title: str, lines: Mapping[str, str], values: Mapping[str, Any] | None = None) -> Any:
    """Return facts, a line each, what and how much: forms, or with no values texts as they are."""
    table = Table(title=Text(title, style="bold"), title_justify="left", box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column()
    for what, form in lines.items():
        if (text := form if values is None else filled(form, values)) != "–":
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

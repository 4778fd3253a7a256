"""Tables for a terminal: of numbers, and of facts."""

from collections.abc import Iterable, Sequence
from typing import Any


def number_table(title: str, heads: Sequence[str], rows: Iterable[Sequence[str]], *, words: int = 0) -> Any:
    """Return a table for a terminal, whose first columns, `words`, are texts and the others numbers."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title, style="bold"), title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for place, head in enumerate(heads):
        table.add_column(head, justify="left" if place < words else "right")
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def fact_table(title: str, rows: Iterable[tuple[str, str]]) -> Any:
    """Return facts, a line each: what, and how much."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title, style="bold"), title_justify="left", box=None, show_header=False, pad_edge=False)
    table.add_column(no_wrap=True)
    table.add_column()
    for what, text in rows:
        table.add_row(what, Text(text))
    return table

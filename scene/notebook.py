"""What a notebook shows of a result: a small table, and the same rows as a pandas DataFrame."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas

MOST_ROWS = 12
"""Of a longer table the first rows are shown."""


def data_frame(rows: Sequence[dict[str, Any]]) -> "pandas.DataFrame":
    """Return rows as a DataFrame; a column of numbers stays one where values are None: NaN."""
    import pandas

    frame = pandas.DataFrame.from_records(rows)
    unknown = {name: float for name in frame if all(row[name] is None for row in rows)}
    return frame.astype(unknown)


def table_html(rows: Sequence[dict[str, Any]], caption: str) -> str:
    """Return rows as a small HTML table; numbers with four digits, None as a dash."""
    heads = "".join(f"<th>{escape(name)}</th>" for name in (rows[0] if rows else ()))
    lines = ("".join(f"<td>{escape(_cell(value))}</td>" for value in row.values()) for row in rows[:MOST_ROWS])
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    more = f"<p>and {len(rows) - MOST_ROWS} more</p>" if len(rows) > MOST_ROWS else ""
    return f"<p>{escape(caption)}</p><table><thead><tr>{heads}</tr></thead><tbody>{body}</tbody></table>{more}"


def _cell(value: Any) -> str:
    if value is None or value != value:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else str(value)

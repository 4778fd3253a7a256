"""Tables of results: small in a notebook, as a pandas DataFrame, as CSV, which every spreadsheet opens."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas

MOST_ROWS = 12
"""Of a longer table the first and the last rows are shown."""


def data_frame(rows: Sequence[dict[str, Any]]) -> "pandas.DataFrame":
    """Return rows as a DataFrame; a column of numbers stays one where values are None: NaN."""
    import pandas

    frame = pandas.DataFrame.from_records(rows)
    unknown = {name: float for name in frame if all(row[name] is None for row in rows)}
    return frame.astype(unknown)


def table_html(rows: Sequence[dict[str, Any]], caption: str) -> str:
    """Return rows as a small HTML table; numbers with four digits, None as a dash."""
    how = {"index": False, "border": 0, "max_rows": MOST_ROWS, "show_dimensions": True}
    frame = data_frame(rows).fillna(float("nan"))
    return f"<p>{escape(caption)}</p>{frame.to_html(**how, na_rep='–', float_format='{:.4g}'.format)}"


def csv_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows as CSV: the keys of the first in the first line, nothing where a value is None."""
    # Nine digits: what the numbers are worth, and more.
    return data_frame(rows).to_csv(index=False, float_format="%.9g", lineterminator="\n")

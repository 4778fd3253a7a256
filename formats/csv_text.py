"""Tables as CSV, which every spreadsheet opens."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any


def csv_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return rows as CSV: the keys of the first in the first line, nothing where a value is None."""
    lines = io.StringIO()
    writer = csv.DictWriter(lines, rows[0].keys() if rows else (), lineterminator="\n")
    writer.writeheader()
    # Nine digits: what the numbers are worth, and more.
    writer.writerows(
        {key: format(value, ".9g") if isinstance(value, float) else value for key, value in row.items()} for row in rows
    )
    return lines.getvalue()

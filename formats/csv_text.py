"""Tables as CSV, which every spreadsheet opens."""

from collections.abc import Sequence
from typing import Any

from scene.notebook import data_frame


def csv_text(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows as CSV: the keys of the first in the first line, nothing where a value is None."""
    # Nine digits: what the numbers are worth, and more.
    return data_frame(rows).to_csv(index=False, float_format="%.9g", lineterminator="\n")

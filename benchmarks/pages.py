"""Where benchmarks put what they measured: between the marks of a page in docs/."""

from collections.abc import Iterable
from pathlib import Path


def put(page: Path, name: str, text: str) -> None:
    """Replace what stands between `<!-- name -->` and `<!-- end of name -->`; `text` ends with a line's end.

    Raises
    ------
    ValueError
        The page has no such marks, or more than one pair.
    """
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    before, rest = page.read_text().split(begin)
    _, after = rest.split(end)
    page.write_text(f"{before}{begin}{text}{end}{after}")


def folded(summary: str, items: Iterable[str]) -> list[str]:
    """Return the lines of a list that the reader unfolds by a click on `summary`; none for no items."""
    rows = [f"- {item}" for item in items]
    return [f"<details><summary>{summary}</summary>", "", *rows, "", "</details>"] if rows else []

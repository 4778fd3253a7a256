"""Where benchmarks put what they measured: between the marks of a page in docs/."""

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

"""Names and messages in Markdown: whatever they hold is shown as it is, and none of it is taken for signs or HTML."""

import re


def plain(text: str) -> str:
    """Return a text with every sign that Markdown, its links or HTML could take for its own behind a backslash."""
    return re.sub(r"([\\`*_{}\[\]()<>#+\-.!|~&:/@=$^])", r"\\\1", " ".join(text.split()))


def code(text: str) -> str:
    """Return a text as a code span, in more backticks than it holds in a row."""
    inside = " ".join(text.split())
    fence = "`" * (1 + max((len(run) for run in re.findall("`+", inside)), default=0))
    padded = f" {inside} " if "`" in inside else inside
    return f"{fence}{padded}{fence}"

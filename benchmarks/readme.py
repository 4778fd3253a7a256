"""The figures that README quotes: each from `measured.json`, which says on which code it was measured."""

import json
from pathlib import Path
from typing import NamedTuple

from benchmarks.harness import MEASURED, ROOT, put

README = ROOT / "README.md"
AGREED = Path(__file__).with_name("agreed_commits.txt")
"""Commits that touched measured code and move no figure: a hash a line, and why."""


class Quoted(NamedTuple):
    """A line of README's table: what it is, its table, its cell with the figures' names in brackets, the anchor."""

    what: str
    table: str
    cell: str
    anchor: str = ""


QUOTED = (
    Quoted(
        "normals of DiLiGenT's cat by photographs that others made: least squares, the best method", "methods/table",
        "[DiLiGenT cat: ls, mean_deg]°, [DiLiGenT cat: reflectance, mean_deg]°",
    ),
)  # fmt: skip


def cell(quoted: Quoted, figures: dict[str, float]) -> str:
    """Return a cell with its figures in the place of their names: [name] with two digits, [name:.1%] as it says."""
    text = quoted.cell
    for name in sorted(figures, key=len, reverse=True):
        text = text.replace(f"[{name}]", f"{figures[name]:.2f}")
        for form in (".0f", ".1f", ".3f", ".0%", ".1%"):
            text = text.replace(f"[{name}:{form}]", format(figures[name], form))
    return text


def readme_table() -> str:
    """Return README's table as Markdown."""
    known = json.loads(MEASURED.read_text())
    lines = ["| judged by known truth | |", "|---|---|"]
    for one in QUOTED:
        page = one.table.split("/")[0]
        lines.append(
            f"| {one.what} | [{cell(one, known[one.table]['figures'])}](docs/evidence/{page}.md{one.anchor}) |"
        )
    return "\n".join(lines) + "\n"


def write_readme() -> None:
    """Put the table into README."""
    put(README, "figures", readme_table())

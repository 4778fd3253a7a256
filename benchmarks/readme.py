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


WASHINGTON = "Washington, chrome and gray ball, 12, against the gray ball's shading"
SCHOLAR = "Harvard, scholar, two chrome balls, 20, against these, refined by the set"
FITTED = "without Lsq, whose range was fitted"
QUOTED = (
    Quoted(
        "light direction in scenes rendered by Cycles; by Mitsuba, among clutter and beside a figurine",
        "calibration/lights",
        "[Cycles, handed out: direction_median_deg]°; [Mitsuba, balls among clutter: direction_median_deg]°, "
        "[path-traced bunny: direction_median_deg]°",
        "#balls-and-lights",
    ),
    Quoted(
        "light direction in real captures, against a gray ball's shading, highlights by hand",
        "real-captures/captures", f"[{WASHINGTON}: median_deg]°, [{SCHOLAR}: median_deg]°",
    ),
    Quoted(
        "scans found at their pose: sessions by others, photographs by others", "registration/poses",
        "[others' sessions: found:.0f] of [others' sessions: sessions:.0f], "
        "[others' photographs: found:.0f] of [others' photographs: sessions:.0f]",
    ),
    Quoted(
        "normals of DiLiGenT's ball and cat: least squares, the best method (means)", "methods/table",
        "[DiLiGenT ball: ls, mean_deg]°, [DiLiGenT ball: least, mean_deg]°; "
        "[DiLiGenT cat: ls, mean_deg]°, [DiLiGenT cat: least, mean_deg]°",
    ),
    Quoted(
        "mistakes that data can tell: noticed, harmful in silence; sound sessions warned", "faults/faults",
        "[noticed:.0%], [silent:.1%]; [sound warned:.0f] of [sound:.0f]",
    ),
    Quoted(
        "methods ordered without truth, rank correlation in one session, one own scene",
        "trust/trust", "[sessions: rank], [scenes: rank]",
    ),
    Quoted(
        "virtual series, photographs against twins: rank correlation of errors, correlation of error maps",
        "counterparts/series", "[rank correlation], [maps, ls]",
    ),
    Quoted(
        "mean errors against the benchmark's, rank correlation: without `ls`, which was fitted; all seven methods; its "
        "`ls` for all", "sweeps/agreement",
        f"[benchmark, default, {FITTED}: overall]; [benchmark, default, all seven: overall]; "
        "[benchmark, default, all seven: baseline]", "#beside-the-benchmark",
    ),
    Quoted(
        "light direction in own scenes, two chrome balls of 67 px", "calibration/lights",
        "[two chrome balls of 67 px, a white one: direction_median_deg:.3f]°", "#balls-and-lights",
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
    whole = sorted({one.table.split("/")[0] for one in QUOTED if known.get(one.table, {}).get("scale") == "full"})
    told = ", with the cases of `make gates`" + (f"; {', '.join(whole)}: all cases" if whole else "")
    lines = [f"| judged by known truth{told} | |", "|---|---|"]
    for one in QUOTED:
        page = one.table.split("/")[0]
        told = cell(one, known[one.table]["figures"]) if one.table in known else "not measured yet"
        lines.append(f"| {one.what} | [{told}](docs/evidence/{page}.md{one.anchor}) |")
    return "\n".join(lines) + "\n"


def write_readme() -> None:
    """Put the table into README."""
    put(README, "figures", readme_table())

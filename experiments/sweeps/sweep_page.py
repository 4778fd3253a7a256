"""A sweep's page: what breaks whom, the table of errors, a chart and pictures for each experiment."""

from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from compare.report.page import folded, section, table, whole_page
from draw.line_chart import line_chart
from draw.speed_chart import speed_chart
from experiments.stagings import SOLVERS, Experiment, experiments
from experiments.sweeps.sweep_statistics import (
    GROUP,
    STATES,
    STATISTICS,
    breaks,
    curves,
    levels,
    speed_points,
    statistics,
)
from experiments.tables import Results, Rows, results
from lab.options import Staging
from scene.files import write_text

QUANTITIES = {
    "normals": ("filled_deg", "default", "mean angular error, °"),
    "normals-seed": ("filled_deg", "seed", "mean angular error, plain readings, °"),
    "albedo": ("albedo_error_percent", "default", "albedo error, %"),
}
"""By the chart's name: what, with which profile, and the axis' title."""
HIGHEST_ALBEDO_PERCENT = 200.0
COLOURS = {"good": "#d3e5f2", "fair": "#7fb2d6", "flipped": "#b04c00", "broken": "#D55E00", "no answer": "#8a8f94"}
"""Of `STATES`: light to dark to another hue, told apart in gray, too."""
LETTERS = {"flipped": "x", "no answer": "–"}
WIDE = "grid-template-columns:repeat(auto-fill,minmax(min(420px,100%),1fr))"
"""Of the charts: two beside each other."""
BOX = "display:inline-block;width:1.1em;text-align:center;color:white;margin-right:1px"


def write_page(
    folder: Path, rows: Rows, found: list[dict[str, Any]], *, seconds: Rows, staging: Staging = "one-factor"
) -> None:
    """Write index.html, a chart EXPERIMENT-QUANTITY.svg each, and speed.svg.

    rows, seconds: of the two tables. found: the cells' files, for their pictures.
    """
    all_of = results(rows)
    failures, numbers = levels(all_of), statistics(all_of)
    there = [one for one in experiments(staging).values() if one.name in set(all_of["experiment"])]
    sections = [_failure_map(failures, there)]
    if points := speed_points(all_of, seconds):
        chart = speed_chart(points, kinds=("default", "profile seed"))
        write_text(folder / "speed.svg", chart)
        sections.append(section("speed", "Speed", chart))
    sections.append(_errors(numbers, there))
    for one in there:
        charts = {name: _chart(all_of, one, name) for name in QUANTITIES}
        for name, chart in charts.items():
            write_text(folder / f"{one.name}-{name}.svg", chart)
        lost = all_of[(all_of["experiment"] == one.name) & ~all_of["is_ok"]]
        drawn = "".join(f"<figure>{chart}</figure>" for chart in charts.values())
        body = f'{_pictures(found, one)}<div class="gallery" style="{WIDE}">{drawn}</div>{_without_result(lost)}'
        sections.append(section(one.name, one.label, body))
    silent = int((~all_of["is_ok"] & ~all_of["has_failed"]).sum())
    said = (
        f"{len(found)} cells, {len(rows)} results: {silent} without an answer, {int(all_of['has_failed'].sum())} "
        f"failed; shapes {escape(', '.join(dict.fromkeys(all_of['shape'])))}"
    )
    write_text(folder / "index.html", whole_page("Where each method fails", "sweeps", said, "".join(sections)))


def _failure_map(failures: Results, there: list[Experiment]) -> str:
    """Return the table of methods against experiments: a box a level, and where the method breaks."""
    by_place = dict(iter(failures.groupby(GROUP, sort=False)))
    lines = []
    for solver, profile in dict.fromkeys((solver, profile) for _, solver, profile in by_place):
        cells = [by_place.get((one.name, solver, profile)) for one in there]
        shown = ["" if one is None else _strip(one) for one in cells]
        lines.append((escape(f"{SOLVERS.get(solver, solver)}, {profile}"), *shown))
    legend = "".join(f"{_box(state)} {escape(words)}; " for state, words in STATES.items())
    lead = (
        "Of each level the median over shapes and draws, in the experiment's own order. "
        f"{legend}underlined: the method itself had doubted it."
    )
    return section("failures", "What breaks whom", table(("", *(escape(one.label) for one in there)), lines), lead)


def _strip(failures: Results) -> str:
    rows = failures.to_dict("records")
    boxes = (
        _box(
            row["state"],
            f"{row['label']}: median {row['median_deg']:.1f}°, {row['broken_cells']} of {row['cells']} cells broken",
            "underline" if row["doubted"] else "none",
        )
        for row in rows
    )
    words = breaks([row["label"] for row in rows], [row["state"] for row in rows])
    return f"<span style='white-space:nowrap'>{''.join(boxes)}</span><br>{escape(words.replace('_', ' '))}"


def _box(state: str, title: str = "", line: str = "none") -> str:
    style = f"{BOX};background:{COLOURS[state]};text-decoration:{line}"
    return f'<span style="{style}" title="{escape(title)}">{LETTERS.get(state, "&nbsp;")}</span>'


def _errors(numbers: Results, there: list[Experiment]) -> str:
    """Return the table in the benchmark's layout; each field: default, seed profile."""
    known, solvers = numbers.to_dict("index"), list(dict.fromkeys(numbers.index.get_level_values("solver")))
    lines = []
    for one in there:
        both = [[known.get((one.name, solver, profile), {}) for profile in ("default", "seed")] for solver in solvers]
        for name in STATISTICS:
            fields = [" / ".join(_shown(each.get(name)) for each in pair) for pair in both]
            lines.append((f"{escape(one.label)}, {name}", *fields))
        lines.append(("cells, refused, failed, unanswered", *("<br>".join(map(_counts, pair)) for pair in both)))
    lead = (
        "Angular error in degrees, of each cell the mean: the methods as they are / their plain readings (profile "
        "seed). A pixel, or a cell, without an answer counts 90°; what failed is in no mean."
    )
    head = ("", *(escape(SOLVERS.get(name, str(name))) for name in solvers))
    return section("errors", "Errors", folded("The table", table(head, lines, kind="numbers")), lead)


def _shown(value: float | None) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.2f}"


def _counts(numbers: dict[str, float]) -> str:
    cells, silent, failed = (int(numbers.get(name, 0)) for name in ("cells", "no_answer", "failed"))
    return f"{cells}, {silent}, {failed}, {100 * np.nan_to_num(numbers.get('unanswered', 0.0)):.0f} %"


def _chart(all_of: Results, experiment: Experiment, name: str) -> str:
    quantity, profile, title = QUANTITIES[name]
    found = curves(all_of, experiment.name, profile, quantity)
    if quantity.startswith("albedo"):
        found = found.clip(upper=HIGHEST_ALBEDO_PERCENT)
    labels = all_of[all_of["experiment"] == experiment.name].groupby("level")["label"].first()
    lines, spreads = {}, {}
    for solver in dict.fromkeys(all_of["solver"]):
        one, label = found.xs(solver).reindex(labels.index), SOLVERS.get(solver, solver)
        places = [float(place) for place in range(len(labels))]
        lines[label], spreads[label] = (places, list(one[0.5])), (list(one[0.25]), list(one[0.75]))
    names = [label.replace("_", " ") for label in labels]
    return line_chart(lines, x_title=experiment.axis, y_title=title, spreads=spreads, x_names=names)


def _pictures(found: Iterable[dict[str, Any]], experiment: Experiment) -> str:
    """Return one picture a level, of the first shape and seed."""
    shown: dict[int, str] = {}
    for one in found:
        first = one["rows"][0]
        if first["experiment"] == experiment.name and one["picture"] and first["shape"] == experiment.shapes[0]:
            words = escape(first["label"].replace("_", " "))
            figure = f'<figure><img src="{one["picture"]}" alt=""><figcaption>{words}</figcaption></figure>'
            shown.setdefault(first["level"], figure)
    return f'<div class="sheet">{"".join(shown[level] for level in sorted(shown))}</div>'


def _without_result(lost: Results) -> str:
    counts = lost.groupby(["solver", "profile", "status"], sort=False).size()
    items = "".join(
        f"<li>{count} x {escape(f'{solver}, {profile}')}: {escape(status)}</li>"
        for (solver, profile, status), count in counts.items()
    )
    return f"<p>Without a result:</p><ul>{items}</ul>" if items else ""

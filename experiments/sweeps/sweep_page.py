"""A sweep's page: the benchmark's table with its own numbers beside ours, a chart and pictures for each experiment."""

from html import escape
from pathlib import Path
from typing import Any

from compare.report.page import table
from draw.line_chart import line_chart
from draw.speed_chart import speed_chart
from experiments.stagings import SOLVERS, Experiment, experiments
from experiments.sweeps.atlas import atlas
from experiments.sweeps.benchmark_section import beside_the_benchmark
from experiments.sweeps.findings import answers
from experiments.sweeps.perturbation import PERTURBATIONS
from experiments.sweeps.stability import stability, strips, tolerances
from experiments.sweeps.sweep_statistics import (
    MEASURES,
    agreement,
    curve,
    speed_points,
    statistics,
)
from experiments.tables import Rows, grouped, has_failed
from lab.options import Staging
from scene.files import write_json, write_text

QUANTITIES = {
    "normals": ("filled_deg", "default", "mean angular error, °"),
    "normals-seed": ("filled_deg", "seed", "mean angular error, plain readings, °"),
    "albedo": ("albedo_error_percent", "default", "albedo error, %"),
}
"""By the chart's name: what, with which profile, and the axis' title."""
HIGHEST_ALBEDO_PERCENT = 200.0
STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#1d2329}
table{border-collapse:collapse;font-size:13px}th,td{padding:2px 8px;text-align:right;border-bottom:1px solid #e3e7ea}
th:first-child{text-align:left}td span{display:block}.seed{color:#005a94}.theirs{color:#777}.scroll{overflow-x:auto}
.level{display:inline-block;text-align:center;font-size:12px;margin:0 4px 8px 0}.level img{display:block}
.charts{display:grid;grid-template-columns:1fr 1fr;gap:8px}.charts svg{width:100%}
figure{margin:0;max-width:760px}figcaption{font-size:13px;color:#555}
.findings th,.findings td{text-align:left;vertical-align:top}
.reproduced{color:#1b7837}.not{color:#b2182b}.depends{color:#8a6d00}
.atlas{width:min(1500px,96vw);margin-left:calc(50% - min(750px,48vw))}"""


def write_page(
    folder: Path, rows: Rows, found: list[dict[str, Any]], *, perturbed: Rows | None = None,
    seconds: Rows | None = None, staging: Staging = "one-factor", quick: bool = False,
) -> None:  # fmt: skip
    """Write index.html, a chart EXPERIMENT-QUANTITY.svg each, atlas.svg, speed.svg, statistics.json and stability.json.

    rows, perturbed, seconds: of the three tables. found: the cells' files, for their pictures.
    """
    perturbed, seconds = perturbed or [], seconds or []
    ours = {measure: statistics(rows, measure) for measure in MEASURES}
    there = [one for one in experiments(staging).values() if any(row["experiment"] == one.name for row in rows)]
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    # A first look has other levels: its means are not compared.
    alike = {} if quick else {(p, m): agreement(rows, p, m) for p in ("default", "seed") for m in MEASURES}
    parts = [
        "<!doctype html><html lang='en'><meta charset='utf-8'><title>Sweeps</title>",
        f"<style>{STYLE}</style><h1>Where photometric stereo fails</h1>",
        f"<p>{len(found)} cells, {len(rows)} results: {sum(row['status'].startswith('no answer') for row in rows)} "
        f"without an answer, {sum(map(has_failed, rows))} failed.</p>",
        *_stability(folder, rows, perturbed),
        _speed(folder / "speed.svg", rows, seconds, there),
        *beside_the_benchmark(answers(rows), alike, ours, there, solvers),
    ]
    for one in there:
        charts = []
        for name in QUANTITIES:
            chart = _chart(rows, one, solvers, name)
            write_text(folder / f"{one.name}-{name}.svg", chart)
            charts.append(chart)
        charts.append(_speed(folder / f"{one.name}-speed.svg", rows, seconds, [one]))
        heading = f"<h2 id='{one.name}'>{escape(one.label)}</h2>{_pictures(found, one)}"
        parts.append(f"{heading}<div class='charts'>{''.join(charts)}</div>")
        parts.append(_without_result(rows, one.name))
    write_text(folder / "index.html", "\n".join(parts))
    write_json(
        folder / "statistics.json",
        {
            "agreement": [{"profile": p, "measure": m, **one._asdict()} for (p, m), one in alike.items()],
            "statistics": [
                {"experiment": experiment, "solver": solver, "profile": profile, "measure": measure, **numbers}
                for measure, found in ours.items()
                for (experiment, solver, profile), numbers in found.items()
            ],
        },
    )


def _stability(folder: Path, rows: Rows, perturbed: Rows) -> list[str]:
    """Write atlas.svg and stability.json; return the page's section on them."""
    found = stability(rows, perturbed)
    picture = atlas(strips(rows), tolerances(perturbed))
    write_text(folder / "atlas.svg", picture)
    write_json(folder / "stability.json", found)
    shapes = ", ".join(dict.fromkeys(row["shape"] for row in rows))
    lines = [
        (
            escape(f"{one['solver']}, {one['profile']}"),
            _share(one["broken_doubted"], one["broken"]),
            _share(one["whole_doubted"], one["whole"]),
        )
        for one in found["doubts"]
    ]
    return [
        f"<h2>What breaks whom</h2><div class='atlas'>{picture}</div>"
        f"<p>Of each level the median over {escape(shapes)} "
        "(the experiment's own shapes) and draws. The smallest error of lights, intensities or ambient light: "
        "bisection of a random perturbation's strength on a matte pear under a dome; median and quartiles over "
        "draws.</p>",
        *(_without_result(perturbed, name) for name in PERTURBATIONS),
        "<details><summary>Do the methods know it? How often they doubt their results</summary>"
        f"{table(('', 'of the broken', 'of the others'), lines)}</details>",
    ]


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole} ({100 * part / whole:.0f} %)" if whole else "–"


def _speed(path: Path, rows: Rows, seconds: Rows, experiments: list[Experiment]) -> str:
    """Write a chart of speed against accuracy over some experiments; return it as a figure, nothing without times."""
    points = speed_points(rows, seconds, [one.name for one in experiments])
    if not points:
        return ""
    words = experiments[0].label if len(experiments) == 1 else "all experiments"
    label = f"Processor time against median angular error, {words}"
    chart = speed_chart(
        points, label=label, kinds=("default", "seed"), hollow="the same method, profile seed", is_twin_in_front=True
    )
    write_text(path, chart)
    return f"<figure><figcaption>{escape(label)}</figcaption>{chart}</figure>"


def _chart(rows: Rows, experiment: Experiment, solvers: list[str], name: str) -> str:
    quantity, profile, title = QUANTITIES[name]
    lines, spreads = {}, {}
    for solver in solvers:
        found = curve(rows, experiment.name, solver, profile, quantity)
        if quantity.startswith("albedo"):
            found |= {key: [min(v, HIGHEST_ALBEDO_PERCENT) for v in found[key]] for key in ("low", "middle", "high")}
        places = [float(place) for place in range(len(found["level"]))]
        label = SOLVERS.get(solver, solver)
        lines[label], spreads[label] = (places, found["middle"]), (found["low"], found["high"])
    labels = {row["level"]: row["label"] for row in rows if row["experiment"] == experiment.name}
    names = [labels[level].replace("_", " ") for level in sorted(labels)]
    return line_chart(lines, x_title=experiment.axis, y_title=title, spreads=spreads, x_names=names)


def _pictures(found: list[dict[str, Any]], experiment: Experiment) -> str:
    """Return one picture a level, of the first shape and seed."""
    shown: dict[int, str] = {}
    for one in found:
        first = one["rows"][0]
        if first["experiment"] == experiment.name and one["picture"] and first["shape"] == experiment.shapes[0]:
            words = escape(first["label"].replace("_", " "))
            picture = f"<img src='{one['picture']}' alt='{words}'>"
            shown.setdefault(first["level"], f"<div class='level'>{picture}{words}</div>")
    return "".join(shown[level] for level in sorted(shown))


def _without_result(rows: Rows, experiment: str) -> str:
    lost = [row for row in rows if row["experiment"] == experiment and row["status"] not in ("ok", "not told")]
    counts = grouped(lost, "solver", "profile", "status")
    if not counts:
        return ""
    items = "".join(
        f"<li>{len(group)} x {escape(f'{solver}, {profile}')}: {escape(status)}</li>"
        for (solver, profile, status), group in counts.items()
    )
    return f"<p>Without a result:</p><ul>{items}</ul>"

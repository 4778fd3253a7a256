"""The benchmark's experiments on real things, as series of virtual captures through `rgbn series`: who fails alike?"""

import contextlib
import io
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.harness import Figures, Scale, Table, markdown
from benchmarks.virtual_lab import CENTRE_MM, VIRTUAL_EXPERIMENTS, Experiment, lab_scene
from benchmarks.virtual_series import write_series
from compare.statistics.statistics import error_correlation
from draw.line_chart import line_chart
from experiments.stagings import SOLVERS
from scene.clock import now, since
from scene.errors import SceneError
from scene.normals import angular_error_deg, unit
from scene.store import Store

CHARTED = ("ls", "iterative", "hsh")
"""In the charts: each twice, photographs and twin."""


@dataclass(frozen=True)
class SeriesRow:
    """A method at one level of an experiment: errors of photographs and twin, and what was found on the way.

    `low_deg`, `high_deg`: 95 % interval of the difference of their medians. `pearson`: correlation of the two maps.
    `lights_off_deg`: median angle between the directions found and those held, at the object. `pose_off_mm`: of the
    object's middle.
    """

    experiment: str
    level: float | str
    method: str
    real_mean_deg: float
    twin_mean_deg: float
    real_median_deg: float
    twin_median_deg: float
    low_deg: float
    high_deg: float
    pearson: float
    lights_off_deg: float
    pose_off_mm: float
    processor_s: float


def _measured(name: str, levels: tuple, frames: int, methods: str) -> list[SeriesRow]:
    from experiments.series import series
    from lab.options import Place, Settings

    start, experiment = now(), _experiment(name)
    experiment = replace(experiment, levels=levels, base=replace(experiment.base, frames=frames))
    with tempfile.TemporaryDirectory() as place:
        parent, out = Path(place) / "series", Path(place) / "out"
        write_series(parent, experiment)
        silent = contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO())
        # A level that is refused is one that is not in the table.
        with silent[0], silent[1], contextlib.suppress(SceneError):
            series(parent, place=Place(out), said=Settings(method=methods))
        rows = [row for at, _ in enumerate(levels) for row in _rows(experiment, at, Store(out / str(at)))]
    spent = since(start)["processor_seconds"] / len(levels)
    return [replace(row, processor_s=spent) for row in rows]


def _experiment(name: str) -> Experiment:
    return next(one for one in VIRTUAL_EXPERIMENTS if one.name == name)


def _rows(experiment: Experiment, at: int, store: Store) -> list[SeriesRow]:
    """Return the rows of a level; none where its session was refused."""
    if not store.path("summary.json").exists():
        return []
    compared = store.read_json("summary.json")["compare"]["methods"]
    found, held = store.load_lights(), lab_scene(experiment.setups()[at]).lights
    kept = [held.names.index(name) for name in found.names]
    toward, expected = (unit(one.toward(CENTRE_MM[None])[:, 0]) for one in (found, held))
    off_deg = float(np.median(angular_error_deg(toward, expected[kept])))
    off_mm = float(np.linalg.norm(store.load_pose().apply(np.zeros((1, 3))) - CENTRE_MM))
    return [
        SeriesRow(
            experiment.name, experiment.levels[at], name, of["real"]["mean_deg"], of["twin"]["mean_deg"],
            of["real"]["median_deg"], of["twin"]["median_deg"], of["median_difference_low_deg"],
            of["median_difference_high_deg"], of["pearson"], off_deg, off_mm, 0.0,
        )
        for name, of in compared.items()
    ]  # fmt: skip


def _cases(scale: Scale) -> list[tuple]:
    methods = ",".join(SOLVERS)
    if scale == "small":
        # Of eight frames of the sphere two poses, 152 degrees apart, explain as much: chance decides.
        return [("cardboard", (90.0, 60.0), 12, "ls,iterative,ldr")]
    # All six take an hour and more.
    some = [_experiment(name) for name in ("ambient", "cardboard")] if scale == "gates" else VIRTUAL_EXPERIMENTS
    return [(one.name, one.levels, one.base.frames, methods) for one in some]


def _by_experiment(rows: Sequence[SeriesRow]) -> dict[str, list[SeriesRow]]:
    return {
        one.name: own for one in VIRTUAL_EXPERIMENTS if (own := [row for row in rows if row.experiment == one.name])
    }


def _ranked(rows: Sequence[SeriesRow]) -> float:
    """Return the rank correlation of the photographs' mean errors with the twins', over methods and levels."""
    real, twin = np.array([(row.real_mean_deg, row.twin_mean_deg) for row in rows]).T
    return error_correlation(real, twin)["spearman"]


def _summary(rows: Sequence[SeriesRow]) -> str:
    lines = []
    for name, own in _by_experiment(rows).items():
        within = [row.low_deg <= 0 <= row.high_deg for row in own]
        levels = {row.level: row for row in own}
        lines.append({
            "label": _experiment(name).label, "levels": f"{len(levels)} of {len(_experiment(name).levels)}",
            "rank": _ranked(own), "maps": float(np.nanmedian([row.pearson for row in own])),
            "apart": float(np.median([abs(row.real_median_deg - row.twin_median_deg) for row in own])),
            "within": float(np.mean(within)),
            "lights": float(np.median([row.lights_off_deg for row in levels.values()])),
            "pose": float(np.median([row.pose_off_mm for row in levels.values()])),
        })  # fmt: skip
    columns = {
        "series": "{label}", "levels": "{levels}", "rank correlation": "{rank:.2f}", "error maps": "{maps:.2f}",
        "medians apart": "{apart:.1f}°", "no difference": "{within:.0%}", "lights off": "{lights:.2f}°",
        "object off": "{pose:.1f} mm",
    }  # fmt: skip
    return markdown(columns, lines)


def _levels(one: Experiment, rows: Sequence[SeriesRow]) -> str:
    """Return an experiment's table, a line a level: mean errors, photographs / twin."""
    methods, lines = list(dict.fromkeys(row.method for row in rows)), []
    for level in dict.fromkeys(row.level for row in rows):
        own = {row.method: row for row in rows if row.level == level}
        cells = {name: f"{row.real_mean_deg:.1f}/{row.twin_mean_deg:.1f}" for name, row in own.items()}
        lines.append(
            {"level": level if isinstance(level, str) else f"{level:g}", **dict.fromkeys(methods, "–"), **cells}
        )
    return markdown({one.axis: "{level}"} | {name: f"{{{name}}}" for name in methods}, lines)


def _shown(rows: Sequence[SeriesRow]) -> str:
    results = _by_experiment(rows)
    parts = [_levels(_experiment(name), own) for name, own in results.items()]
    charts = [f"![{_experiment(name).label}](virtual-{name}.svg)\n" for name in _charted(results)]
    return "\n".join([_summary(rows), *parts, *charts])


def _figures(rows: Sequence[SeriesRow]) -> Figures:
    keys = ("lights_off_deg", "pose_off_mm")
    return {
        "rank correlation": _ranked(rows),
        "maps, ls": float(np.nanmedian([row.pearson for row in rows if row.method == "ls"])),
        **{key: float(np.median([getattr(row, key) for row in rows])) for key in keys},
    }


def _charted(results: dict[str, list[SeriesRow]]) -> list[str]:
    """Return the experiments of which there are charts: where all were measured."""
    return list(results) if len(results) == len(VIRTUAL_EXPERIMENTS) else []


def _charts(rows: Sequence[SeriesRow]) -> dict[str, str]:
    results, drawn = _by_experiment(rows), {}
    for name in _charted(results):
        one, lines = _experiment(name), {}
        names = [level for level in one.levels if isinstance(level, str)]
        for method in CHARTED:
            own = [row for row in results[name] if row.method == method]
            at = [float(one.levels.index(row.level)) if names else float(row.level) for row in own]
            lines[f"{method}, photographs"] = at, [row.real_mean_deg for row in own]
            lines[f"{method}, twin"] = at, [row.twin_mean_deg for row in own]
        drawn[f"virtual-{name}.svg"] = line_chart(
            lines, x_title=one.axis, y_title="mean angular error, degrees", log_x=one.log, x_names=names
        )
    return drawn


TABLES = (
    Table(
        "counterparts", "series", ("experiments.series", "lab.run", "twin.twin_session"), SeriesRow, _cases,
        _measured, _shown, _figures, _charts,
    ),
)  # fmt: skip

"""What a sweep's rows say: the benchmark's five statistics, its own beside them, how alike the two rank, and speed."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from compare.report.facts import family
from compare.report.speed_chart import SpeedPoint
from experiments.catalogue import CALIBRATED, EXPERIMENTS, SOLVERS
from experiments.tables import KEY, Rows, grouped, has_failed

STATISTICS = ("min", "max", "mean", "median", "std")
Statistics = dict[tuple[str, str, str], dict[str, float]]


def statistics(rows: Rows) -> Statistics:
    """Return, by (experiment, solver, profile), the statistics of the cells' mean angular errors, degrees.

    min, max, mean, median and std (of the population) over levels, shapes and seeds, as the benchmark's table has
    them: of each dataset one mean error. `cells` are those that count, `no_answer` those that a method refused,
    `failed` those that ended by a fault of ours: neither is in a mean; `unanswered`: the mean share of an object's
    pixels without a normal, which are in no mean either.
    """
    found: Statistics = {}
    for (experiment, solver, profile), group in grouped(rows, "experiment", "solver", "profile").items():
        good = [row for row in group if row["status"] == "ok"]
        errors, failed = np.array([row["mean_deg"] for row in good], float), sum(map(has_failed, group))
        numbers: dict[str, float] = {"cells": len(good), "no_answer": len(group) - len(good) - failed, "failed": failed}
        if good:
            numbers |= {name: float(getattr(np, name)(errors)) for name in STATISTICS}
            numbers["unanswered"] = float(np.mean([row["unanswered"] for row in good]))
        found[experiment, solver, profile] = numbers
    return found


def benchmark_statistics() -> dict[tuple[str, str], dict[str, float]]:
    """Return the benchmark's own table [Berkiten2016], by (experiment, solver): its five statistics."""
    names = {one.label: one.name for one in EXPERIMENTS.values()}
    found: dict[tuple[str, str], dict[str, float]] = {}
    with open(Path(__file__).parent / "benchmark_figure7.csv", newline="") as file:
        for row in csv.DictReader(file):
            for solver, label in SOLVERS.items():
                found.setdefault((names[row["experiment"]], solver), {})[row["statistic"]] = float(row[label])
    return found


def rank_correlation(
    ours: Statistics, profile: str, *, solvers: Iterable[str] = CALIBRATED, statistic: str = "mean"
) -> tuple[float, int]:
    """Return Spearman's rank correlation [Spearman1904] with the benchmark, NaN under three pairs, and their number.

    A pair: an experiment and one of the solvers.
    """
    from scipy.stats import spearmanr

    theirs = benchmark_statistics()
    keys = [(e, s) for e, s in theirs if s in set(solvers) and statistic in ours.get((e, s, profile), {})]
    if len(keys) < 3:
        return float("nan"), len(keys)
    pairs = np.array([[ours[(*key, profile)][statistic], theirs[key][statistic]] for key in keys])
    return float(spearmanr(pairs).statistic), len(keys)  # type: ignore[union-attr]


def curve(rows: Rows, experiment: str, solver: str, profile: str, quantity: str) -> dict[str, list[float]]:
    """Return, level by level, the median of the cells' `quantity` and its quartiles; NaN where none has a result."""
    rows = [row for row in rows if row["experiment"] == experiment]
    levels = sorted({row["level"] for row in rows})
    found: dict[str, list[float]] = {"level": [float(level) for level in levels], "low": [], "middle": [], "high": []}
    rows = [row for row in rows if (row["solver"], row["profile"], row["status"]) == (solver, profile, "ok")]
    for level in levels:
        values = [row[quantity] for row in rows if row["level"] == level and row[quantity] is not None]
        quartiles = np.quantile(values, [0.25, 0.5, 0.75]) if values else [np.nan] * 3
        for name, value in zip(("low", "middle", "high"), quartiles, strict=True):
            found[name].append(float(value))
    return found


def speed_points(rows: Rows, seconds: Rows, experiments: Sequence[str]) -> list[SpeedPoint]:
    """Return each method and profile once: `kind` "real" for default, "twin" for seed, as the chart draws them.

    Medians over the experiments' cells of the processor seconds for a million pixels of one frame, and of the median
    angular errors. A cell without a result is in neither.
    """
    taken = {tuple(row[key] for key in KEY): row["seconds"] for row in seconds}
    points = []
    good = [row for row in rows if row["experiment"] in experiments and row["status"] == "ok"]
    for (solver, profile), group in grouped(good, "solver", "profile").items():
        values = [
            (spent / (row["pixels"] / (1 - row["unanswered"]) / 1e6) / row["frames"], row["median_deg"])
            for row in group
            if (spent := taken.get(tuple(row[key] for key in KEY)))
        ]
        speed, error = np.median(values, axis=0) if values else (0.0, 0.0)
        if min(speed, error) > 0:
            kind = "real" if profile == "default" else "twin"
            points.append(SpeedPoint(solver, family(solver), kind, float(speed), float(error)))
    return points

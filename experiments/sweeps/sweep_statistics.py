"""What a sweep's rows say: the benchmark's five statistics, its own beside them, how alike the two rank, and speed."""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compare.report.facts import family
from draw.speed_chart import SpeedPoint
from experiments.stagings import CALIBRATED, ONE_FACTOR, SOLVERS
from experiments.tables import KEY, Rows, grouped, has_failed

STATISTICS = ("min", "max", "mean", "median", "std")
MEASURES = {
    "filled_deg": "a pixel without a normal counts 90°",
    "common_deg": "pixels that all methods answer",
    "mean_deg": "pixels that the method answers",
}
"""Columns of a cell's mean error, the one that flatters nobody first, and what they are over."""
DRAWS = 1000
Statistics = dict[tuple[str, str, str], dict[str, float]]
Interval = tuple[float, float, float]
"""A number, and the ends between which it lies in 90 % of the draws."""


class Agreement(NamedTuple):
    """How alike two tables of means rank: Spearman's rank correlations, each with its interval."""

    pairs: int
    overall: Interval
    within: Interval
    between: Interval


def statistics(rows: Rows, measure: str = "mean_deg") -> Statistics:
    """Return, by (experiment, solver, profile), the statistics of the cells' mean angular errors, degrees.

    measure: a key of `MEASURES`. min, max, mean, median and std (of the population) over levels, shapes and seeds, as
    the benchmark's table has them: of each dataset one mean error. `cells` are those that count, `no_answer` those that
    a method refused, `failed` those that ended by a fault of ours, which are in no mean; what was refused counts where
    gaps do. `unanswered`: the mean share of an object's pixels without a normal.
    """
    found: Statistics = {}
    for (experiment, solver, profile), group in grouped(rows, "experiment", "solver", "profile").items():
        good, failed = [row for row in group if row["status"] == "ok"], sum(map(has_failed, group))
        numbers: dict[str, float] = {"cells": len(good), "no_answer": len(group) - len(good) - failed, "failed": failed}
        errors = np.array([row[measure] for row in group if row.get(measure) is not None], float)
        if len(errors):
            numbers |= {name: float(getattr(np, name)(errors)) for name in STATISTICS}
        if good:
            numbers["unanswered"] = float(np.mean([row["unanswered"] for row in good]))
        found[experiment, solver, profile] = numbers
    return found


def three_means(three: Sequence[dict[str, float]]) -> str:
    """Return statistics by the three `MEASURES` in words: the means, once where they are alike; the share answered."""
    shown = [f"{numbers['mean']:.1f}" if "mean" in numbers else "–" for numbers in three]
    words = shown[0] if len(set(shown)) == 1 else " / ".join(shown)
    share = 100 * (1 - three[0].get("unanswered", np.nan))
    return f"{words}; {share:.0f} %" if np.isfinite(share) and share < 99.5 else words


def benchmark_statistics() -> dict[tuple[str, str], dict[str, float]]:
    """Return the benchmark's own table [Berkiten2016], by (experiment, solver): its five statistics."""
    names = {one.label: one.name for one in ONE_FACTOR.values()}
    found: dict[tuple[str, str], dict[str, float]] = {}
    with open(Path(__file__).parent / "benchmark_figure7.csv", newline="") as file:
        for row in csv.DictReader(file):
            for solver, label in SOLVERS.items():
                found.setdefault((names[row["experiment"]], solver), {})[row["statistic"]] = float(row[label])
    return found


def agreement(rows: Rows, profile: str, measure: str, *, solvers: Sequence[str] = CALIBRATED) -> Agreement:
    """Return how alike our mean errors and the benchmark's rank [Spearman1904].

    rows: of experiments that the benchmark has; compared are those in which every solver has a mean.

    Notes
    -----
    `overall` ranks all means together; `within` is the mean over the experiments of the rank correlation of the
    solvers, `between` the mean over the solvers of that of the experiments. The intervals are the 5 % and 95 %
    quantiles when each experiment's cells, its scenes, are drawn anew with replacement [Efron1993].
    """
    theirs, errors = benchmark_statistics(), _errors(rows, profile, measure, solvers)
    there = [name for name, found in errors.items() if np.isfinite(found).any(0).all()]
    if len(there) < 3:
        unknown = (np.nan, np.nan, np.nan)
        return Agreement(len(there) * len(solvers), unknown, unknown, unknown)
    wanted = np.array([[theirs[name, solver]["mean"] for solver in solvers] for name in there])
    generator, means = np.random.default_rng(len(there)), np.empty((DRAWS + 1, len(there), len(solvers)))
    for place, name in enumerate(there):
        found = errors[name]
        weights = generator.multinomial(len(found), np.full(len(found), 1 / len(found)), DRAWS)
        weights = np.concatenate([np.ones((1, len(found))), weights])
        known = np.isfinite(found)
        with np.errstate(invalid="ignore"):
            means[:, place] = weights @ np.where(known, found, 0) / (weights @ known)
    whole = _spearman(means.reshape(len(means), -1), wanted.reshape(1, -1))
    within, between = _spearman(means, wanted), _spearman(means.swapaxes(1, 2), wanted.T)
    return Agreement(wanted.size, _interval(whole[:, None]), _interval(within), _interval(between))


def _interval(found: NDArray[np.float64]) -> Interval:
    """Return the mean of correlations (1 + draws, N) as they are, and its quantiles over the draws; NaN left out."""
    known = np.isfinite(found)
    if not known[0].any():
        return np.nan, np.nan, np.nan
    means = np.where(known, found, 0).sum(1)[known.any(1)] / known.sum(1)[known.any(1)]
    low, high = np.quantile(means, [0.05, 0.95])
    return float(means[0]), float(low), float(high)


def _errors(rows: Rows, profile: str, measure: str, solvers: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Return, by experiment, the errors (cells, solvers); NaN where a cell has none."""
    rows = [row for row in rows if row["profile"] == profile and row["solver"] in solvers]
    found = {}
    for (name,), group in grouped(rows, "experiment").items():
        cells = grouped(group, "level", "shape", "seed")
        found[name] = np.full((len(cells), len(solvers)), np.nan)
        for line, cell in zip(found[name], cells.values(), strict=True):
            for row in cell:
                if row.get(measure) is not None:
                    line[solvers.index(row["solver"])] = row[measure]
    return found


def _spearman(ours: NDArray, theirs: NDArray) -> NDArray[np.float64]:
    """Return the rank correlation along the last axis; NaN where one of the two is constant."""
    from scipy.stats import rankdata

    a, b = (rankdata(values, axis=-1) for values in (ours, theirs))
    a, b = a - a.mean(-1, keepdims=True), b - b.mean(-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.sum(a * b, -1) / np.sqrt(np.sum(a * a, -1) * np.sum(b * b, -1))


def curve(rows: Rows, experiment: str, solver: str, profile: str, quantity: str) -> dict[str, list[float]]:
    """Return, level by level, the median of the cells' `quantity` and its quartiles; NaN where none has a result."""
    rows = [row for row in rows if row["experiment"] == experiment]
    levels = sorted({row["level"] for row in rows})
    found: dict[str, list[float]] = {"level": [float(level) for level in levels], "low": [], "middle": [], "high": []}
    rows = [row for row in rows if (row["solver"], row["profile"]) == (solver, profile) and not has_failed(row)]
    for level in levels:
        values = [row[quantity] for row in rows if row["level"] == level and row.get(quantity) is not None]
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

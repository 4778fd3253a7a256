"""What a sweep's rows say: the benchmark's five statistics, its own beside them, and how alike the two rank."""

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from experiments.sweeps.nine_experiments import CALIBRATED, EXPERIMENTS, SOLVERS

STATISTICS = ("min", "max", "mean", "median", "std")
Rows = list[dict[str, Any]]
Statistics = dict[tuple[str, str, str], dict[str, float]]


def statistics(rows: Rows) -> Statistics:
    """Return, by (experiment, solver, profile), the statistics of the cells' mean angular errors, degrees.

    Notes
    -----
    min, max, mean, median and std (of the population) over levels, shapes and seeds, as the benchmark's table has
    them: of each dataset one mean error. `cells` are those that count, `no_answer` those that a method refused,
    `failed` those that ended by a fault of ours: neither is in a mean; `unanswered`: the mean share of an object's
    pixels without a normal, which are in no mean either.
    """
    groups: dict[tuple[str, str, str], Rows] = {}
    for row in rows:
        groups.setdefault((row["experiment"], row["solver"], row["profile"]), []).append(row)
    found: Statistics = {}
    for key, group in groups.items():
        good = [row for row in group if row["status"] == "ok"]
        errors = np.array([row["mean_deg"] for row in good], float)
        failed = sum(has_failed(row) for row in group)
        numbers: dict[str, float] = {
            "cells": len(good), "no_answer": len(group) - len(good) - failed, "failed": failed
        }  # fmt: skip
        if len(good):
            numbers |= {name: float(getattr(np, name)(errors)) for name in STATISTICS}
            numbers["unanswered"] = float(np.mean([row["unanswered"] for row in good]))
        found[key] = numbers
    return found


def has_failed(row: dict[str, Any]) -> bool:
    """Tell whether a row is without a result by a fault of ours, and not by the method's own word."""
    return str(row["status"]).startswith("failed")


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
    """Return Spearman's rank correlation [Spearman1904] with the benchmark, and over how many pairs.

    Parameters
    ----------
    ours : Statistics
    profile : str
    solvers : iterable of str
        The pairs are experiment and solver; by default the calibrated ones.
    statistic : str

    Returns
    -------
    correlation : float
        NaN under three pairs.
    pairs : int
    """
    from scipy.stats import rankdata

    theirs = benchmark_statistics()
    keys = [(e, s) for e, s in theirs if s in set(solvers) and statistic in ours.get((e, s, profile), {})]
    if len(keys) < 3:
        return float("nan"), len(keys)
    a = rankdata([ours[(*key, profile)][statistic] for key in keys])
    b = rankdata([theirs[key][statistic] for key in keys])
    return float(np.corrcoef(a, b)[0, 1]), len(keys)


def curve(rows: Rows, experiment: str, solver: str, profile: str, quantity: str) -> dict[str, list[float]]:
    """Return, level by level, the median of the cells' `quantity` and its quartiles; NaN where none has a result."""
    levels = sorted({row["level"] for row in rows if row["experiment"] == experiment})
    found: dict[str, list[float]] = {"level": [float(level) for level in levels], "low": [], "middle": [], "high": []}
    for level in levels:
        values = [
            row[quantity]
            for row in rows
            if (row["experiment"], row["solver"], row["profile"]) == (experiment, solver, profile)
            and row["level"] == level
            and row["status"] == "ok"
            and row[quantity] is not None
        ]
        quartiles = np.quantile(values, [0.25, 0.5, 0.75]) if values else [np.nan] * 3
        for name, value in zip(("low", "middle", "high"), quartiles, strict=True):
            found[name].append(float(value))
    return found

"""What a sweep's table says: statistics, where each method breaks, and how fast it is; see `experiments.tables`."""

from collections.abc import Iterable, Sequence
from itertools import groupby

import numpy as np

from compare.report.facts import family
from draw.speed_chart import SpeedPoint
from experiments.tables import BREAKS_DEG, KEY, Results, Rows

GROUP = ["experiment", "solver", "profile"]
STATISTICS = ("min", "max", "mean", "median", "std")
GOOD_DEG = 5.0
STATES = {
    "good": f"median error up to {GOOD_DEG:g}°",
    "fair": f"up to {BREAKS_DEG:g}°",
    "flipped": "broken: convex taken for concave",
    "broken": f"broken: past {BREAKS_DEG:g}°, or half of the cells are",
    "no answer": "refused, or half of the object without a normal",
}
"""What a method can be at a level, over shapes and draws."""


def statistics(table: Results, measure: str = "filled_deg") -> Results:
    """Return the statistics of the cells' mean angular errors, degrees, by experiment, solver and profile.

    min, max, mean, median and std (of the population) over levels, shapes and seeds, as the RGBN benchmark's table has
    them: of each dataset one mean error. `cells` are those that have a result, `no_answer` those that a method refused,
    `failed` those that ended by a fault of ours, which are in no mean; what was refused counts where gaps do.
    `unanswered`: the mean share of an object's pixels without a normal.
    """
    from pandas import DataFrame

    groups = table.groupby(GROUP, sort=False)
    found = {name: groups[measure].agg(name) for name in STATISTICS[:-1]} | {"std": groups[measure].std(ddof=0)}
    cells, failed = groups["is_ok"].sum(), groups["has_failed"].sum()
    found |= {"cells": cells, "no_answer": groups.size() - cells - failed, "failed": failed}
    return DataFrame(found | {"unanswered": groups["unanswered"].mean()})


def curves(table: Results, experiment: str, profile: str, quantity: str) -> Results:
    """Return, by solver and level, the cells' quartiles (columns 0.25, 0.5, 0.75); NaN where none has a result."""
    one = table[(table["experiment"] == experiment) & (table["profile"] == profile)]
    return one.groupby(["solver", "level"], sort=False)[quantity].quantile([0.25, 0.5, 0.75]).unstack().sort_index()


def levels(table: Results) -> Results:
    """Return a row for each experiment, solver, profile and level, over shapes and draws, in the table's order.

    label; `cells`, those that failed by a fault of ours left out; `broken_cells`; `median_deg`, of the cells' median
    errors, inf where an answer that is worse than any is the median; `state`, a key of `STATES`; `doubted`: of a broken
    level, the method doubted itself, or refused, in half or more of the broken cells.
    """
    kept = table[~table["has_failed"]].copy()
    kept["error"] = kept["median_deg"].where(kept["is_ok"], np.inf)
    kept["is_silent"] = kept["is_broken"] & ~(kept["is_ok"] & (kept["unanswered"] <= 0.5))
    enough = (kept["median_deg"] / 2).clip(lower=BREAKS_DEG)
    kept["is_flipped"] = kept["is_broken"] & ~kept["is_silent"] & (kept["flip_deg"] <= enough)
    kept["has_doubt"] = kept["is_broken"] & (~kept["is_ok"] | (kept["doubts"].fillna("") != ""))
    groups = kept.groupby([*GROUP, "level"], sort=False)
    found = groups[["is_broken", "is_silent", "is_flipped", "has_doubt"]].sum()
    found = found.rename(columns={"is_broken": "broken_cells"})
    found["label"], found["cells"] = groups["label"].first(), groups.size()
    # The upper one of two: one without a result beside one that has some is not averaged.
    found["median_deg"] = groups["error"].quantile(0.5, interpolation="higher")
    half = found["broken_cells"] / 2
    is_broken = (found["median_deg"] > BREAKS_DEG) | (found["broken_cells"] >= found["cells"] / 2)
    kinds = [~is_broken & (found["median_deg"] <= GOOD_DEG), ~is_broken, found["is_silent"] > half,
             found["is_flipped"] > half]  # fmt: skip
    found["state"] = np.select(kinds, ["good", "fair", "no answer", "flipped"], "broken")
    found["doubted"] = is_broken & (found["has_doubt"] >= half)
    found = found.drop(columns=["is_silent", "is_flipped", "has_doubt"])
    return found.sort_index(level="level", sort_remaining=False, kind="stable")


def breaks(labels: Sequence[str], states: Iterable[str]) -> str:
    """Return where a method breaks over an experiment's levels: "holds", "from 0.35", "up to 4", "0.2 to 0.6"."""
    places = enumerate(state not in ("good", "fair") for state in states)
    runs = [[place for place, _ in run] for is_broken, run in groupby(places, lambda one: one[1]) if is_broken]
    words = []
    for first, last in ((run[0], run[-1]) for run in runs):
        if (first, last) == (0, len(labels) - 1):
            return "everywhere"
        if first == 0:
            words.append(f"up to {labels[last]}")
        elif last == len(labels) - 1:
            words.append(f"from {labels[first]}")
        else:
            words.append(labels[first] if first == last else f"{labels[first]} to {labels[last]}")
    return ", ".join(words) or "holds"


def speed_points(table: Results, seconds: Rows) -> list[SpeedPoint]:
    """Return each method and profile once: `kind` "real" for default, "twin" for seed, as the chart draws them.

    Medians over the cells of the processor seconds for a million pixels of one frame, and of the median angular errors.
    A cell without a result is in neither; without any there are no points.
    """
    from pandas import DataFrame

    if not seconds:
        return []
    both = table[table["is_ok"]].merge(DataFrame(seconds, columns=[*KEY, "seconds"]), on=[*KEY])
    both["speed"] = both["seconds"] / (both["pixels"] / (1 - both["unanswered"]) / 1e6) / both["frames"]
    found = both.groupby(["solver", "profile"], sort=False)[["speed", "median_deg"]].median()
    return [
        SpeedPoint(solver, family(solver), "real" if profile == "default" else "twin", float(speed), float(error))
        for (solver, profile), (speed, error) in found.T.items()
        if min(speed, error) > 0
    ]

"""Speed against accuracy of every method and profile, out of a sweep's tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from compare.report.facts import family
from compare.report.speed import SpeedPoint

Rows = list[dict[str, Any]]
NAME = ("experiment", "level", "shape", "seed", "solver", "profile")


def speed_points(rows: Rows, seconds: Rows, experiments: Sequence[str]) -> list[SpeedPoint]:
    """Return each method and profile once: `kind` "real" for default, "twin" for seed, as the chart draws them.

    Parameters
    ----------
    rows, seconds : list of dict
        Of results.parquet and seconds.parquet.
    experiments : sequence of str
        That count.

    Notes
    -----
    Medians over cells of the processor seconds for a million pixels of one frame, and of the median angular errors. A
    cell without a result is in neither.
    """
    taken = {tuple(row[key] for key in NAME): row["seconds"] for row in seconds}
    groups: dict[tuple[str, str], list[tuple[float, float]]] = {}
    for row in rows:
        spent = taken.get(tuple(row[key] for key in NAME))
        if row["experiment"] not in experiments or row["status"] != "ok" or not spent:
            continue
        megapixels = row["pixels"] / (1 - row["unanswered"]) / 1e6
        found = groups.setdefault((row["solver"], row["profile"]), [])
        found.append((spent / megapixels / row["frames"], row["median_deg"]))
    points = []
    for (solver, profile), values in groups.items():
        speed, error = np.median(values, axis=0)
        if min(speed, error) > 0:
            kind = "real" if profile == "default" else "twin"
            points.append(SpeedPoint(solver, family(solver), kind, float(speed), float(error)))
    return points

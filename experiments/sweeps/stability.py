"""Where each method breaks, how, and whether it had said so itself: read off a sweep's rows."""

from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from experiments.sweeps.perturbation import BREAKS_DEG, PERTURBATIONS
from experiments.sweeps.sweep_statistics import has_failed
from solve.solve import UNCALIBRATED

Rows = list[dict[str, Any]]

GOOD_DEG = 5.0
KINDS = {
    "no answer": "refused, or half of the object without a normal",
    "flipped": "convex taken for concave",
    "relief": "another member of the bas-relief family",
    "too flat": "normals lean toward the camera",
    "too steep": "normals lean away from the camera",
    "turned": "all normals turned alike",
    "scattered": "none of these: pixels disagree",
}
"""How a result can be broken, and what that means; tried in this order."""


@dataclass(frozen=True)
class Level:
    """One method and profile at one level of an experiment, over shapes and draws.

    Parameters
    ----------
    level : int
    label : str
    cells, broken_cells : int
        Those that failed by a fault of ours are neither.
    median_deg : float or None
        Median over cells of the median error, a cell without an answer counting as worse than any. None: that is none.
    is_broken : bool
        `median_deg` is past 10 degrees, or half of the cells are.
    how : str or None
        The key of `KINDS` that most broken cells have.
    foretold : bool or None
        The method doubted itself, or refused, in half or more of the broken cells. None: none is broken.
    """

    level: int
    label: str
    cells: int
    broken_cells: int
    median_deg: float | None
    is_broken: bool
    how: str | None
    foretold: bool | None


@dataclass(frozen=True)
class Strip:
    """One method and profile over the levels of an experiment, in their order."""

    experiment: str
    solver: str
    profile: str
    levels: tuple[Level, ...]

    @property
    def breaks(self) -> str:
        """Where it is broken, in words: "holds", "from 0.35", "up to 4", "0.2 to 0.6", "everywhere"."""
        broken = [level.is_broken for level in self.levels]
        if all(broken):
            return "everywhere"
        words, start = [], 0
        while start < len(broken):
            stop = start
            while stop < len(broken) and broken[stop] == broken[start]:
                stop += 1
            if broken[start]:
                first, last = self.levels[start].label, self.levels[stop - 1].label
                if start == 0:
                    words.append(f"up to {last}")
                elif stop == len(broken):
                    words.append(f"from {first}")
                else:
                    words.append(first if first == last else f"{first} to {last}")
            start = stop
        return ", ".join(words) or "holds"


def is_broken(row: dict[str, Any]) -> bool:
    """Tell whether a row has no answer, or a median error past 10 degrees, or no normal for half of the object."""
    return row["status"] != "ok" or row["median_deg"] > BREAKS_DEG or row["unanswered"] > 0.5


def kind_of(row: dict[str, Any]) -> str:
    """Return the key of `KINDS` that a broken row has.

    Notes
    -----
    A flip, a relief, a turn is the reason if without it the median error were under 10 degrees or under half of what it
    is. A relief: of methods that are not told the lights; of others it would be chance. Too flat, too steep: the median
    of the zenith angles' errors is farther from 0 than half the range between their quartiles.
    """
    if row["status"] != "ok" or row["unanswered"] > 0.5:
        return "no answer"
    enough = max(BREAKS_DEG, row["median_deg"] / 2)
    if row["flip_deg"] <= enough:
        return "flipped"
    if row["solver"] in UNCALIBRATED and row["relief_deg"] <= enough:
        return "relief"
    if abs(row["tilt_deg"]) > row["tilt_spread_deg"]:
        return "too flat" if row["tilt_deg"] < 0 else "too steep"
    return "turned" if row["turn_deg"] <= enough else "scattered"


def foretold(row: dict[str, Any]) -> bool:
    """Tell whether a method spoke against its own result, or gave none."""
    return row["status"] != "ok" or bool(row.get("doubts"))


def strips(rows: Rows) -> list[Strip]:
    """Return every method and profile over every experiment, in the rows' order."""
    groups: dict[tuple[str, str, str], dict[int, Rows]] = {}
    for row in (row for row in rows if not has_failed(row)):
        place = groups.setdefault((row["experiment"], row["solver"], row["profile"]), {})
        place.setdefault(row["level"], []).append(row)
    return [Strip(*key, tuple(_level(levels[i]) for i in sorted(levels))) for key, levels in groups.items()]


def _level(rows: Rows) -> Level:
    broken = [row for row in rows if is_broken(row)]
    errors = [row["median_deg"] if row["status"] == "ok" else np.inf for row in rows]
    # The upper one of two: one without a result beside one that has some is not averaged.
    median = float(np.quantile(errors, 0.5, method="higher"))
    how = Counter(kind_of(row) for row in broken).most_common(1)[0][0] if broken else None
    said = sum(foretold(row) for row in broken) >= len(broken) / 2 if broken else None
    first, is_bad = rows[0], median > BREAKS_DEG or 2 * len(broken) >= len(rows)
    shown = median if np.isfinite(median) else None
    return Level(first["level"], first["label"], len(rows), len(broken), shown, is_bad, how, said)


@dataclass(frozen=True)
class Tolerance:
    """How much of one perturbation a method and profile bear.

    Parameters
    ----------
    name : str
        A key of `PERTURBATIONS`.
    solver, profile : str
    breaks_at, low, high : float or None
        Median and quartiles over the draws of the smallest strength that breaks it; None: more than was tried.
    draws : int
        That count; with none failed, 0: the method is not told the quantity.
    failed : int
        Draws that ended by a fault of ours, and are in none of the numbers.
    how : str or None
        As in `Level`, at that strength.
    foretold : bool or None
        The method doubted itself in half or more of the draws, at that strength. None: it did not break.
    """

    name: str
    solver: str
    profile: str
    breaks_at: float | None
    low: float | None
    high: float | None
    draws: int
    failed: int
    how: str | None
    foretold: bool | None


def tolerances(perturbed: Rows) -> list[Tolerance]:
    """Return the perturbations that each method and profile bears."""
    groups: dict[tuple[str, str, str], Rows] = {}
    for row in perturbed:
        groups.setdefault((row["experiment"], row["solver"], row["profile"]), []).append(row)
    found = []
    for key, rows in groups.items():
        failed = sum(map(has_failed, rows))
        tried = [row for row in rows if row["status"] != "not told" and not has_failed(row)]
        strengths = [np.inf if row["breaks_at"] is None else row["breaks_at"] for row in tried]
        broken = [row for row in tried if row["breaks_at"] is not None]
        low, middle, high = (
            [_finite(float(np.quantile(strengths, q, method="higher"))) for q in (0.25, 0.5, 0.75)]
            if tried
            else [None] * 3
        )
        # An estimate that was refused has no error to look at.
        how = Counter(_kind_at_break(row) for row in broken).most_common(1)[0][0] if middle is not None else None
        said = sum(_foretold_at_break(row) for row in broken) >= len(broken) / 2 if middle is not None else None
        found.append(Tolerance(*key, middle, low, high, len(tried), failed, how, said))
    return found


def _kind_at_break(row: dict[str, Any]) -> str:
    return "no answer" if row.get("median_deg") is None else kind_of(row)


def _foretold_at_break(row: dict[str, Any]) -> bool:
    return row.get("median_deg") is None or foretold(row)


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def candour(rows: Rows) -> list[dict[str, Any]]:
    """Return, by method and profile, how many cells are broken, how many of those it doubted, and of the others."""
    found: dict[tuple[str, str], dict[str, Any]] = {}
    for row in rows:
        start = {"solver": row["solver"], "profile": row["profile"]}
        start |= dict.fromkeys(("broken", "broken_doubted", "whole", "whole_doubted", "failed"), 0)
        one = found.setdefault((row["solver"], row["profile"]), start)
        if has_failed(row):
            one["failed"] += 1
            continue
        which = "broken" if is_broken(row) else "whole"
        one[which] += 1
        one[f"{which}_doubted"] += foretold(row)
    return list(found.values())


def stability(rows: Rows, perturbed: Rows) -> dict[str, Any]:
    """Return stability.json: strips, tolerances, and how often the methods' doubts were right."""
    return {
        "breaks_deg": BREAKS_DEG,
        "how": KINDS,
        "experiments": [asdict(one) | {"breaks": one.breaks} for one in strips(rows)],
        "perturbations": [asdict(one) | {"unit": PERTURBATIONS[one.name].unit} for one in tolerances(perturbed)],
        "doubts": candour(rows),
    }

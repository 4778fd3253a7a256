"""Where each method breaks, how, and whether it had said so itself: read off a sweep's rows."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import Any

import numpy as np

from experiments.sweeps.perturbation import BREAKS_DEG, PERTURBATIONS
from experiments.tables import Row, Rows, grouped, has_failed
from solve.methods import UNCALIBRATED

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
    """One method and profile at one level of an experiment, over shapes and draws."""

    level: int
    label: str
    cells: int  # those that failed by a fault of ours do not count
    broken_cells: int
    median_deg: float | None  # over cells, of the median error; without an answer: worse than any. None: that is none
    is_broken: bool  # `median_deg` is past 10 degrees, or half of the cells are
    how: str | None  # the key of `KINDS` that most broken cells have
    foretold: bool | None  # the method doubted itself, or refused, in half or more of the broken cells


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
        runs = [(is_broken, list(run)) for is_broken, run in groupby(self.levels, lambda level: level.is_broken)]
        words = []
        for number, (is_broken, run) in enumerate(runs):
            first, last = run[0].label, run[-1].label
            if not is_broken:
                continue
            if len(runs) == 1:
                return "everywhere"
            if number == 0:
                words.append(f"up to {last}")
            elif number == len(runs) - 1:
                words.append(f"from {first}")
            else:
                words.append(first if first == last else f"{first} to {last}")
        return ", ".join(words) or "holds"


@dataclass(frozen=True)
class Tolerance:
    """How far one quantity may be off before a method and profile breaks, over draws."""

    name: str  # a key of `PERTURBATIONS`
    solver: str
    profile: str
    breaks_at: float | None  # median and quartiles over draws of the smallest strength; None: not even the greatest
    low: float | None
    high: float | None
    draws: int  # 0: the method is not told the quantity
    failed: int  # draws that ended by a fault of ours, and are in none of the numbers
    how: str | None  # as in `Level`, at that strength
    foretold: bool | None  # the method doubted itself in half or more of the draws there. None: it did not break


def is_broken(row: Row) -> bool:
    """Tell whether a row has no answer, or a median error past 10 degrees, or no normal for half of the object."""
    return row["status"] != "ok" or row["median_deg"] > BREAKS_DEG or row["unanswered"] > 0.5


def kind_of(row: Row) -> str:
    """Return the key of `KINDS` that a broken row has.

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


def foretold(row: Row) -> bool:
    """Tell whether a method spoke against its own result, or gave none."""
    return row["status"] != "ok" or bool(row.get("doubts"))


def strips(rows: Rows) -> list[Strip]:
    """Return every method and profile over every experiment, in the rows' order."""
    good, found = [row for row in rows if not has_failed(row)], []
    for (experiment, solver, profile), group in grouped(good, "experiment", "solver", "profile").items():
        levels = grouped(group, "level")
        found.append(Strip(experiment, solver, profile, tuple(_level(levels[place]) for place in sorted(levels))))
    return found


def _level(rows: Rows) -> Level:
    broken = [row for row in rows if is_broken(row)]
    errors = [row["median_deg"] if row["status"] == "ok" else np.inf for row in rows]
    # The upper one of two: one without a result beside one that has some is not averaged.
    median = float(np.quantile(errors, 0.5, method="higher"))
    first, is_bad = rows[0], median > BREAKS_DEG or 2 * len(broken) >= len(rows)
    how, said = _mostly(map(kind_of, broken)), _mostly_true(map(foretold, broken))
    return Level(first["level"], first["label"], len(rows), len(broken), _finite(median), is_bad, how, said)


def tolerances(perturbed: Rows) -> list[Tolerance]:
    """Return the perturbations that each method and profile bears."""
    found = []
    for (name, solver, profile), rows in grouped(perturbed, "experiment", "solver", "profile").items():
        failed = sum(map(has_failed, rows))
        tried = [row for row in rows if row["status"] != "not told" and not has_failed(row)]
        strengths = [np.inf if row["breaks_at"] is None else row["breaks_at"] for row in tried]
        quartiles = [float(np.quantile(strengths, q, method="higher")) for q in (0.25, 0.5, 0.75)] if tried else []
        low, middle, high = map(_finite, quartiles) if tried else (None, None, None)
        broken = [row for row in tried if row["breaks_at"] is not None] if middle is not None else []
        # An estimate that was refused has no error to look at.
        how = _mostly("no answer" if row.get("median_deg") is None else kind_of(row) for row in broken)
        said = _mostly_true(row.get("median_deg") is None or foretold(row) for row in broken)
        found.append(Tolerance(name, solver, profile, middle, low, high, len(tried), failed, how, said))
    return found


def _mostly(words: Iterable[str]) -> str | None:
    most = Counter(words).most_common(1)
    return most[0][0] if most else None


def _mostly_true(answers: Iterable[bool]) -> bool | None:
    answers = list(answers)
    return sum(answers) >= len(answers) / 2 if answers else None


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def candour(rows: Rows) -> list[Row]:
    """Return, by method and profile, how many cells are broken, how many of those it doubted, and of the others."""
    found = []
    for (solver, profile), group in grouped(rows, "solver", "profile").items():
        one: dict[str, int] = dict.fromkeys(("broken", "broken_doubted", "whole", "whole_doubted", "failed"), 0)
        for row in group:
            if has_failed(row):
                one["failed"] += 1
                continue
            which = "broken" if is_broken(row) else "whole"
            one[which] += 1
            one[f"{which}_doubted"] += foretold(row)
        found.append({"solver": solver, "profile": profile, **one})
    return found


def stability(rows: Rows, perturbed: Rows) -> dict[str, Any]:
    """Return stability.json: strips, tolerances, and how often the methods' doubts were right."""
    return {
        "breaks_deg": BREAKS_DEG,
        "how": KINDS,
        "experiments": [asdict(one) | {"breaks": one.breaks} for one in strips(rows)],
        "perturbations": [asdict(one) | {"unit": PERTURBATIONS[one.name].unit} for one in tolerances(perturbed)],
        "doubts": candour(rows),
    }

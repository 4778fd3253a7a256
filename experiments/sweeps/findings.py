"""What the benchmark's text states of the methods [Berkiten2016], and whether a sweep's rows say the same."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from experiments.stagings import CALIBRATED, SOLVERS
from experiments.tables import Rows
from solve.methods import UNCALIBRATED

Verdict = Literal["reproduced", "depends on the reading", "not reproduced"]
UNACCEPTABLE_DEG = 5.0
"""Mean error from which a result is called unacceptable."""
LITTLE_DEG = 2.0
"""Difference of mean errors below which it is said not to change much."""
MORE = 1.5
"""Factor from which an error is called greater."""
MOST = 4
"""Of seven methods."""


class Errors:
    """One profile's mean errors, gaps at 90 degrees, by experiment and method.

    rows: of one sweep; those that failed by a fault of ours are left out.
    """

    def __init__(self, rows: Rows, profile: str) -> None:
        self._rows = [row for row in rows if row["profile"] == profile and row.get("filled_deg") is not None]

    def has(self, experiment: str, solvers: Sequence[str]) -> bool:
        """Tell whether an experiment was run with these methods."""
        return set(solvers) <= {row["solver"] for row in self._rows if row["experiment"] == experiment}

    def levels(self, experiment: str) -> NDArray[np.float64]:
        """Return the levels' values, from the first to the last."""
        found = {row["level"]: row["value"] for row in self._rows if row["experiment"] == experiment}
        return np.array([found[level] for level in sorted(found)])

    def over(self, experiment: str, solver: str) -> NDArray[np.float64]:
        """Return the mean error at each level, over shapes and draws, degrees."""
        by_level: dict[int, list[float]] = {}
        for row in self._rows:
            if (row["experiment"], row["solver"]) == (experiment, solver):
                by_level.setdefault(row["level"], []).append(row["filled_deg"])
        return np.array([np.mean(by_level[level]) for level in sorted(by_level)], np.float64)

    def mean(self, experiment: str, solver: str) -> float:
        """Return the mean over the levels."""
        return float(self.over(experiment, solver).mean())

    def flipped(self, experiment: str) -> float:
        """Return the share of the results without known lights whose median error the flip at least halves."""
        rows = [
            row
            for row in self._rows
            if row["experiment"] == experiment and row["solver"] in UNCALIBRATED and row.get("flip_deg") is not None
        ]
        return float(np.mean([row["flip_deg"] < row["median_deg"] / 2 for row in rows])) if rows else np.nan


Judged = tuple[bool, str]
"""Whether it holds, and the numbers that say so."""


@dataclass(frozen=True)
class Finding:
    """A statement of the benchmark's text.

    section: of its supplement. claim: in our words. experiment, solvers: what tells. judge: takes the errors of one
    profile. rule: when it counts as true, in words.
    """

    section: str
    claim: str
    experiment: str
    rule: str
    judge: Callable[[Errors], Judged]
    solvers: tuple[str, ...] = tuple(SOLVERS)


def _ends(errors: Errors, experiment: str) -> str:
    words = (
        f"{SOLVERS[one]} " + " to ".join(f"{errors.over(experiment, one)[i]:.1f}" for i in (0, -1))
        for one in CALIBRATED
    )
    return ", ".join(words) + "°"


def _ambient(errors: Errors) -> Judged:
    levels = errors.levels("ambient")
    passes = [float(np.interp(0.1, levels, errors.over("ambient", one))) for one in CALIBRATED]
    words = ", ".join(f"{SOLVERS[one]} {error:.1f}" for one, error in zip(CALIBRATED, passes, strict=True))
    return min(passes) > UNACCEPTABLE_DEG, f"at a tenth of the flash {words}°"


def _interreflection(errors: Errors) -> Judged:
    curves = [errors.over("interreflection", one) for one in CALIBRATED]
    rises = all(curve[-1] > MORE * max(curve[0], 1) and np.mean(np.diff(curve) > 0) > 0.5 for curve in curves)
    return rises, _ends(errors, "interreflection")


def _images_three(errors: Errors) -> Judged:
    worse = [errors.over("images", one)[0] > MORE * errors.over("images", one)[-1] for one in SOLVERS]
    return sum(worse) >= MOST, f"{sum(worse)} of {len(worse)} methods are {MORE} times worse with the fewest"


def _images_ten(errors: Errors) -> Judged:
    levels = errors.levels("images")
    near = [
        np.interp(10, levels, curve) < MORE * curve[-1] for curve in (errors.over("images", one) for one in SOLVERS)
    ]
    return sum(near) >= MOST, f"{sum(near)} of {len(near)} methods are then within {MORE} times their error with all"


def _noise_little(errors: Errors) -> Judged:
    rises = [float(np.ptp(errors.over("noise", one)[[0, -1]])) for one in SOLVERS]
    kept = sum(rise < LITTLE_DEG for rise in rises)
    return kept >= MOST, f"{kept} of {len(rises)} methods change by less than {LITTLE_DEG:g}°"


def _noise_least_squares(errors: Errors) -> Judged:
    grown = {one: float(curve[-1] / max(curve[0], 1e-3)) for one in SOLVERS for curve in [errors.over("noise", one)]}
    others = float(np.median([grown[one] for one in SOLVERS if one not in ("ls", "iterative")]))
    words = (
        f"Lsq {grown['ls']:.1f} times, Iter Lsq {grown['iterative']:.1f} times, the others (median) {others:.1f} times"
    )
    return min(grown["ls"], grown["iterative"]) > others, words


def _ring_middle(errors: Errors) -> Judged:
    total = np.mean([errors.over("ring", one) for one in SOLVERS], 0)
    best = int(total.argmin())
    words = f"mean of all methods {total[0]:.1f}° at {errors.levels('ring')[0]:.3g}°, least {total[best]:.1f}° at "
    words += f"{errors.levels('ring')[best]:.3g}°, {total[-1]:.1f}° at {errors.levels('ring')[-1]:.3g}°"
    return 0 < best < len(total) - 1, words


def _ring_end(end: int) -> Callable[[Errors], Judged]:
    def judge(errors: Errors) -> Judged:
        curves = [errors.over("ring", one) for one in CALIBRATED]
        words = ", ".join(
            f"{SOLVERS[one]} {curve[end]:.1f} against {curve.min():.1f}"
            for one, curve in zip(CALIBRATED, curves, strict=True)
        )
        return all(curve[end] > MORE * curve.min() for curve in curves), words + "°"

    return judge


def _roughness_bump(errors: Errors) -> Judged:
    curve = errors.over("roughness", "ls")
    peak = int(curve.argmax())
    words = f"Lsq {curve[0]:.1f}, {curve[peak]:.1f} at {errors.levels('roughness')[peak]:.2g}, {curve[-1]:.1f}°"
    return 0 < peak < len(curve) - 1 and max(curve[0], curve[-1]) < 0.9 * curve[peak], words


def _best_of(experiment: str, solver: str, among: Sequence[str]) -> Callable[[Errors], Judged]:
    def judge(errors: Errors) -> Judged:
        means = {one: errors.mean(experiment, one) for one in among}
        order = sorted(means, key=lambda one: means[one])
        return order[0] == solver, ", ".join(f"{SOLVERS[one]} {means[one]:.1f}" for one in order) + "°"

    return judge


def _shadow_all(errors: Errors) -> Judged:
    return (
        all(errors.over("shadow", one)[-1] > 2 * UNACCEPTABLE_DEG for one in CALIBRATED),
        _ends(errors, "shadow"),
    )


def _shadow_flips(errors: Errors) -> Judged:
    share = errors.flipped("shadow")
    return share > 0.25, f"convex taken for concave in {100 * share:.0f} % of the results"


def _specularity_little(errors: Errors) -> Judged:
    spans = [float(np.ptp(errors.over("specularity", one))) for one in SOLVERS]
    kept = sum(span < LITTLE_DEG for span in spans)
    return kept >= MOST, f"{kept} of {len(spans)} methods stay within {LITTLE_DEG:g}°"


def _specularity_best(errors: Errors) -> Judged:
    first, words = _best_of("specularity", "iterative", CALIBRATED)(errors)
    second, others = _best_of("specularity", "ldr", UNCALIBRATED)(errors)
    return first and second, f"{words}; {others}"


FINDINGS: tuple[Finding, ...] = (
    Finding(
        "6.1", "Even a little light that was not subtracted makes the errors unacceptable.", "ambient",
        f"all calibrated methods pass {UNACCEPTABLE_DEG:g}° at a tenth of the flash", _ambient, CALIBRATED,
    ),
    Finding(
        "6.2", "Light from surface to surface matters to methods that leave it out.", "interreflection",
        f"all calibrated methods' errors rise with the cone, by {MORE} times or more", _interreflection, CALIBRATED,
    ),
    Finding(
        "6.4", "Three images are the least; in practice more are needed.", "images",
        f"most methods are {MORE} times worse with the fewest images (three to five) than with all", _images_three,
    ),
    Finding(
        "6.4", "With about ten images most methods do reasonably.", "images",
        f"most methods are then within {MORE} times their error with all", _images_ten,
    ),
    Finding(
        "6.5", "Most methods' normals hardly suffer from Poisson noise.", "noise",
        f"from the least to the greatest noise most change by less than {LITTLE_DEG:g}°", _noise_little,
    ),
    Finding(
        "6.5", "Least squares gets worse with noise more than the others do.", "noise",
        "both least squares grow by a greater factor than the others' median", _noise_least_squares,
    ),
    Finding("6.6", "A ring in between is best.", "ring", "the mean of all methods is least inside", _ring_middle),
    Finding(
        "6.6", "A ring near the camera gives too little variation.", "ring",
        f"every calibrated method is {MORE} times worse there than at its best", _ring_end(0), CALIBRATED,
    ),
    Finding(
        "6.6", "A ring near the ground gives too much shadow.", "ring",
        f"every calibrated method is {MORE} times worse there than at its best", _ring_end(-1), CALIBRATED,
    ),
    Finding(
        "6.7", "With the roughness errors first rise, then fall.", "roughness",
        "Lsq is worst inside, and 10 % better at both ends", _roughness_bump, ("ls",),
    ),
    Finding(
        "6.7", "Iterative least squares does best on any roughness.", "roughness",
        "it has the least mean of all seven", _best_of("roughness", "iterative", tuple(SOLVERS)),
    ),
    Finding(
        "6.8", "All calibrated methods suffer from heavy shadow.", "shadow",
        f"all pass {2 * UNACCEPTABLE_DEG:g}° on the highest waves", _shadow_all, CALIBRATED,
    ),
    Finding(
        "6.8", "A constant threshold on shadow does best of all.", "shadow",
        "Lsq has the least mean of all seven", _best_of("shadow", "ls", tuple(SOLVERS)),
    ),
    Finding(
        "6.8", "Methods without known lights decide unstably between convex and concave.", "shadow",
        "the flip halves the median error of more than a quarter of their results", _shadow_flips,
    ),
    Finding(
        "6.9", "More specularity does not change a method's mean error much.", "specularity",
        f"most methods stay within {LITTLE_DEG:g}°", _specularity_little,
    ),
    Finding(
        "6.9", "Iterative least squares and LDR do better than others there.", "specularity",
        "each has the least mean of its kind, calibrated or not", _specularity_best,
    ),
)  # fmt: skip
"""The sentences of section 6 that say something of the methods, in its order."""


@dataclass(frozen=True)
class Answer:
    """What a sweep says to a finding, by profile."""

    finding: Finding
    holds: dict[str, bool]
    numbers: dict[str, str]

    @property
    def verdict(self) -> Verdict:
        """Of all profiles."""
        return verdict_of(self.holds.values())


def verdict_of(holds: Iterable[bool]) -> Verdict:
    """Return the verdict of several readings of one statement."""
    found = list(holds)
    return "reproduced" if all(found) else "depends on the reading" if any(found) else "not reproduced"


def answers(rows: Rows, profiles: Sequence[str] = ("default", "seed")) -> list[Answer]:
    """Return what rows say to each finding whose experiment and methods are among them."""
    views = {profile: Errors(rows, profile) for profile in profiles}
    found = []
    for finding in FINDINGS:
        if not all(view.has(finding.experiment, finding.solvers) for view in views.values()):
            continue
        judged = {profile: finding.judge(view) for profile, view in views.items()}
        found.append(
            Answer(finding, {p: bool(one[0]) for p, one in judged.items()}, {p: one[1] for p, one in judged.items()})
        )
    return found

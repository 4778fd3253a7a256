"""What the benchmark states of the methods [Berkiten2016], in numbers and words, and whether a sweep says the same."""

import csv
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from experiments.stagings import CALIBRATED, ONE_FACTOR, SOLVERS
from experiments.tables import Results
from scene.method_names import UNCALIBRATED

UNACCEPTABLE_DEG = 5.0
"""Mean error from which a result is called unacceptable."""
LITTLE_DEG = 2.0
"""Difference of mean errors below which it is said not to change much."""
MORE = 1.5
"""Factor from which an error is called greater."""
MOST = 4
"""Of seven methods."""
DRAWS = 1000
"""Of the scenes, for the intervals of `agreement`."""

Verdict = Literal["reproduced", "depends on the reading", "not reproduced"]
Interval = tuple[float, float, float]
"""A number, and the ends between which it lies in 90 % of the draws."""
GAPS = "filled_deg"
"""Mean errors in which a pixel without a normal counts 90 degrees: who gives up where it is hard gains nothing."""


UNDEFINED = {("images", "hsh", "seed"), ("ring", "hsh", "seed")}
"""Experiment, method, profile: round-off decides, for the harmonics have no inverse; they are in no comparison."""


def benchmark_statistics() -> dict[tuple[str, str], dict[str, float]]:
    """Return the benchmark's own table, Fig. 7, by (experiment, solver): its five statistics."""
    names = {one.label: one.name for one in ONE_FACTOR.values()}
    found: dict[tuple[str, str], dict[str, float]] = {}
    with (Path(__file__).parent / "benchmark_figure7.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            for solver, label in SOLVERS.items():
                found.setdefault((names[row["experiment"]], solver), {})[row["statistic"]] = float(row[label])
    return found


class Agreement(NamedTuple):
    """How alike two tables of means rank: Spearman's rank correlations, each with its interval."""

    pairs: int
    overall: Interval
    within: Interval
    between: Interval


def agreement(table: Results, profile: str, *, solvers: Sequence[str] = CALIBRATED) -> Agreement:
    """Return how alike our mean errors and the benchmark's rank [Spearman1904].

    table: of `experiments.tables.results`. Compared are the benchmark's experiments in which every solver has a mean.

    Notes
    -----
    `overall` ranks all means together; `within` is the mean over the experiments of the rank correlation of the
    solvers, `between` the mean over the solvers of that of the experiments. The intervals are the 5 % and 95 %
    quantiles when each experiment's cells, its scenes, are drawn anew with replacement [Efron1993].
    """
    theirs = benchmark_statistics()
    mine = table[(table["profile"] == profile) & table["solver"].isin(solvers) & table["experiment"].isin(ONE_FACTOR)]
    cells = mine.pivot(index=["experiment", "level", "shape", "seed"], columns="solver", values=GAPS)
    errors = {str(name): one.reindex(columns=[*solvers]).to_numpy() for name, one in cells.groupby(level=0, sort=False)}
    errors = {name: one for name, one in errors.items() if np.isfinite(one).any(0).all()}
    if len(errors) < 3:
        unknown = (np.nan, np.nan, np.nan)
        return Agreement(len(errors) * len(solvers), unknown, unknown, unknown)
    wanted = np.array([[theirs[name, solver]["mean"] for solver in solvers] for name in errors])
    generator, means = np.random.default_rng(len(errors)), np.empty((DRAWS + 1, *wanted.shape))
    for place, found in enumerate(errors.values()):
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


def _spearman(ours: NDArray, theirs: NDArray) -> NDArray[np.float64]:
    """Return the rank correlation along the last axis; NaN where one of the two is constant."""
    a, b = (rankdata(values, axis=-1) for values in (ours, theirs))
    a, b = a - a.mean(-1, keepdims=True), b - b.mean(-1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.sum(a * b, -1) / np.sqrt(np.sum(a * a, -1) * np.sum(b * b, -1))


class Curves:
    """One experiment's mean errors, by level and method, over shapes and draws.

    rows: of one profile, of `experiments.tables.results`; levels in which a method has none are left out.
    """

    def __init__(self, rows: Results) -> None:
        means = rows.pivot_table(index="value", columns="solver", values=GAPS, sort=False)
        by_level = rows.groupby("value")["level"].first()
        self.errors = means.loc[sorted(means.index, key=lambda value: by_level[value])].dropna()
        known = rows[rows["solver"].isin(UNCALIBRATED) & rows["flip_deg"].notna()]
        # Of the results without known lights whose median error the flip at least halves.
        self.flipped = float((known["flip_deg"] < known["median_deg"] / 2).mean())

    def of(self, solvers: Iterable[str]) -> Results:
        """Return the curves of some methods, (levels, methods); without those that are undefined here."""
        return self.errors[[one for one in solvers if one in self.errors]]

    def at(self, value: float, solvers: Sequence[str]) -> NDArray[np.float64]:
        """Return the errors at a level that may lie between two."""
        places = self.errors.index.to_numpy(float)
        return np.array([np.interp(value, places, curve) for _, curve in self.of(solvers).items()])

    def best(self, solvers: Sequence[str]) -> str:
        """Return the method of the least mean."""
        return str(self.of(solvers).mean().idxmin())


def _rises(curves: Results) -> bool:
    last, first = curves.iloc[-1], curves.iloc[0].clip(lower=1)
    return bool(((last > MORE * first) & ((curves.diff().iloc[1:] > 0).mean() > 0.5)).all())


def _worse(end: Results, curves: Results) -> bool:
    return bool((end > MORE * curves.min()).all())


def _is_inside(curve: Results) -> bool:
    """Tell whether a curve's greatest value is neither the first nor the last."""
    return 0 < int(curve.to_numpy().argmax()) < len(curve) - 1


def _grows_most(curves: Results, methods: Sequence[str]) -> bool:
    grown = curves.iloc[-1] / curves.iloc[0].clip(lower=1e-3)
    return bool(grown[[*methods]].min() > grown.drop([*methods]).median())


def _has_bump(curve: Results) -> bool:
    return _is_inside(curve) and max(curve.iloc[0], curve.iloc[-1]) < 0.9 * curve.max()


@dataclass(frozen=True)
class Finding:
    """A statement of the benchmark's text.

    section: of its supplement. claim: in our words. rule: when it counts as true, in words. holds: whether it does.
    solvers: what tells.
    """

    section: str
    claim: str
    experiment: str
    rule: str
    holds: Callable[[Curves], Any]
    solvers: tuple[str, ...] = tuple(SOLVERS)


FINDINGS: tuple[Finding, ...] = (
    Finding(
        "6.1", "Even a little light that was not subtracted makes the errors unacceptable.", "ambient",
        f"all calibrated methods pass {UNACCEPTABLE_DEG:g}° at a tenth of the flash",
        lambda c: c.at(0.1, CALIBRATED).min() > UNACCEPTABLE_DEG, CALIBRATED,
    ),
    Finding(
        "6.2", "Light from surface to surface matters to methods that leave it out.", "interreflection",
        f"all calibrated methods' errors rise with the cone, by {MORE} times or more",
        lambda c: _rises(c.of(CALIBRATED)), CALIBRATED,
    ),
    Finding(
        "6.4", "Three images are the least; in practice more are needed.", "images",
        f"most methods are {MORE} times worse with the fewest images (three to five) than with all",
        lambda c: (c.of(SOLVERS).iloc[0] > MORE * c.of(SOLVERS).iloc[-1]).sum() >= MOST,
    ),
    Finding(
        "6.4", "With about ten images most methods do reasonably.", "images",
        f"most methods are then within {MORE} times their error with all",
        lambda c: (c.at(10, [*SOLVERS]) < MORE * c.of(SOLVERS).iloc[-1].to_numpy()).sum() >= MOST,
    ),
    Finding(
        "6.5", "Most methods' normals hardly suffer from Poisson noise.", "noise",
        f"from the least to the greatest noise most change by less than {LITTLE_DEG:g}°",
        lambda c: ((c.of(SOLVERS).iloc[-1] - c.of(SOLVERS).iloc[0]).abs() < LITTLE_DEG).sum() >= MOST,
    ),
    Finding(
        "6.5", "Least squares gets worse with noise more than the others do.", "noise",
        "both least squares grow by a greater factor than the others' median",
        lambda c: _grows_most(c.of(SOLVERS), ("ls", "iterative")),
    ),
    Finding(
        "6.6", "A ring in between is best.", "ring", "the mean of all methods is least inside",
        lambda c: _is_inside(-c.of(SOLVERS).mean(axis=1)),
    ),
    Finding(
        "6.6", "A ring near the camera gives too little variation.", "ring",
        f"every calibrated method is {MORE} times worse there than at its best",
        lambda c: _worse(c.of(CALIBRATED).iloc[0], c.of(CALIBRATED)), CALIBRATED,
    ),
    Finding(
        "6.6", "A ring near the ground gives too much shadow.", "ring",
        f"every calibrated method is {MORE} times worse there than at its best",
        lambda c: _worse(c.of(CALIBRATED).iloc[-1], c.of(CALIBRATED)), CALIBRATED,
    ),
    Finding(
        "6.7", "With the roughness errors first rise, then fall.", "roughness",
        "Lsq is worst inside, and 10 % better at both ends", lambda c: _has_bump(c.errors["ls"]), ("ls",),
    ),
    Finding(
        "6.7", "Iterative least squares does best on any roughness.", "roughness",
        "it has the least mean of all seven", lambda c: c.best(tuple(SOLVERS)) == "iterative",
    ),
    Finding(
        "6.8", "All calibrated methods suffer from heavy shadow.", "shadow",
        f"all pass {2 * UNACCEPTABLE_DEG:g}° on the highest waves",
        lambda c: (c.of(CALIBRATED).iloc[-1] > 2 * UNACCEPTABLE_DEG).all(), CALIBRATED,
    ),
    Finding(
        "6.8", "A constant threshold on shadow does best of all.", "shadow",
        "Lsq has the least mean of all seven", lambda c: c.best(tuple(SOLVERS)) == "ls",
    ),
    Finding(
        "6.8", "Methods without known lights decide unstably between convex and concave.", "shadow",
        "the flip halves the median error of more than a quarter of their results", lambda c: c.flipped > 0.25,
    ),
    Finding(
        "6.9", "More specularity does not change a method's mean error much.", "specularity",
        f"most methods stay within {LITTLE_DEG:g}°",
        lambda c: ((c.of(SOLVERS).max() - c.of(SOLVERS).min()) < LITTLE_DEG).sum() >= MOST,
    ),
    Finding(
        "6.9", "Iterative least squares and LDR do better than others there.", "specularity",
        "each has the least mean of its kind, calibrated or not",
        lambda c: (c.best(CALIBRATED), c.best(UNCALIBRATED)) == ("iterative", "ldr"),
    ),
)  # fmt: skip
"""The sentences of section 6 that say something of the methods, in its order."""


class Answer(NamedTuple):
    """What a sweep says to a finding in one profile: whether it holds, and the curves' ends that say so."""

    finding: Finding
    profile: str
    holds: bool
    numbers: str


def answers(table: Results, profiles: Sequence[str] = ("default", "seed")) -> list[Answer]:
    """Return what results say to each finding whose experiment and methods are among them; see `Curves`.

    What is `UNDEFINED` is in no count and no mean.
    """
    found, table = [], table[~table["has_failed"]]
    for finding in FINDINGS:
        groups = [table[(table["experiment"] == finding.experiment) & (table["profile"] == one)] for one in profiles]
        if not all(set(finding.solvers) <= set(rows["solver"]) for rows in groups):
            continue
        for profile, rows in zip(profiles, groups, strict=True):
            lost = [solver for name, solver, of in UNDEFINED if (name, of) == (finding.experiment, profile)]
            curves = Curves(rows[~rows["solver"].isin(lost)])
            words = (
                f"{SOLVERS[str(one)]} {curve.iloc[0]:.1f} to {curve.iloc[-1]:.1f}, "
                f"least {curve.min():.1f}, most {curve.max():.1f}"
                for one, curve in curves.of(finding.solvers).items()
            )
            found.append(Answer(finding, profile, bool(finding.holds(curves)), f"{'; '.join(words)}°"))
    return found


def verdict_of(holds: Iterable[bool]) -> Verdict:
    """Return the verdict of several readings of one statement."""
    found = list(holds)
    return "reproduced" if all(found) else "depends on the reading" if any(found) else "not reproduced"

"""The nine experiments in both stagings, against the benchmark's own numbers and statements; what breaks whom.

The sweeps lie in out/sweeps and go on there where they were stopped: the tables of one run share them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from pyarrow import parquet

from benchmarks.benchmark_findings import GAPS, UNDEFINED, agreement, answers, benchmark_statistics, verdict_of
from benchmarks.harness import ROOT, Figures, Scale, Table, markdown
from compare.statistics.statistics import error_correlation
from experiments.stagings import CALIBRATED, ONE_FACTOR, SOLVERS, TOLD_WRONGLY, experiments
from experiments.sweeps.cell import run_cell
from experiments.sweeps.sweep import sweep
from experiments.sweeps.sweep_statistics import GROUP, STATISTICS, breaks, levels, statistics
from experiments.tables import Results, results
from lab.options import Staging

OUT = ROOT / "out" / "sweeps"
STAGINGS: tuple[Staging, ...] = ("benchmark", "one-factor")
PROFILES = ("default", "seed")
SETS = {
    "the four calibrated": CALIBRATED,
    "without Lsq, whose range was fitted": tuple(one for one in CALIBRATED if one != "ls"),
    "all seven": tuple(SOLVERS),
}


@cache
def small(staging: Staging) -> Results:
    """Return the results of six small cells, of the first and the last level of three experiments."""
    cells = []
    for name in ("noise", "roughness", "specularity"):
        every = list(experiments(staging)[name].cells(methods=tuple(SOLVERS), quick=True))
        cells += [replace(cell, recipe=replace(cell.recipe, side=24)) for cell in (every[0], every[-1])]
    return results([row for cell in cells for row in run_cell(cell)["rows"]])


def swept(staging: Staging, scale: Scale) -> Results:
    """Return a sweep's results; at the scale of the gates a first look."""
    if scale == "small":
        return small(staging)
    folder = sweep("all", out=OUT, staging=staging, quick=scale == "gates")
    return results(parquet.read_table(folder / "results.parquet").to_pylist())


@dataclass(frozen=True)
class StatisticRow:
    """One method's errors in one experiment: a statistic over the mean errors of all levels, shapes and draws.

    nan: undefined, or of no cell. albedo_percent: the same of the albedo, in the profile default, which the benchmark
    does not tell. failed: cells without a result by a fault of ours; they are in no statistic.
    """

    staging: str
    experiment: str
    solver: str
    statistic: str
    default_deg: float
    seed_deg: float
    benchmark_deg: float
    albedo_percent: float
    failed: int


def _statistics(scale: Scale) -> list[StatisticRow]:
    theirs, found = benchmark_statistics(), []
    for staging in STAGINGS:
        table = swept(staging, scale)
        ours, albedo = (statistics(table, one).to_dict("index") for one in (GAPS, "albedo_error_percent"))
        for name, solver in dict.fromkeys(key[:2] for key in ours if key[0] in ONE_FACTOR):
            both = {profile: ours[name, solver, profile] for profile in PROFILES}
            failed = int(sum(one["failed"] for one in both.values()))
            for statistic in STATISTICS:
                default, seed = (
                    np.nan if (name, solver, profile) in UNDEFINED else float(one[statistic])
                    for profile, one in both.items()
                )
                others = theirs[name, solver][statistic], float(albedo[name, solver, "default"][statistic])
                found.append(StatisticRow(staging, name, solver, statistic, default, seed, *others, failed))
    return found


def _show_statistics(rows: Sequence[StatisticRow]) -> str:
    """Return a line for each experiment, a column for each method."""
    lines: dict[str, dict[str, str]] = {}
    for row in rows:
        if (row.staging, row.statistic) == (STAGINGS[0], "mean"):
            line = lines.setdefault(row.experiment, {"what": row.experiment})
            text = f"{row.default_deg:.1f} *{row.benchmark_deg:.1f}*".replace("nan", "undefined")
            line[row.solver] = text + f" ({row.failed} failed)" * bool(row.failed)
    columns = {"ours *the benchmark's*": "{what}"} | {SOLVERS[row.solver]: f"{{{row.solver}}}" for row in rows}
    ranks = [
        {"of": f"{staging}, {profile}", **{name: _rank(rows, staging, profile, name) for name in STATISTICS}}
        # The baseline is of the benchmark alone: the same in both stagings.
        for staging, profile in (*product(STAGINGS, PROFILES), (STAGINGS[0], "baseline"))
    ]
    forms = {name: f"{{{name}[0]:.2f}} / {{{name}[1]:.2f}}" for name in STATISTICS}
    return "\n".join([
        markdown(columns, lines.values()),
        "Rank correlation of each statistic: all methods / without Lsq.\n",
        markdown({"staging, profile": "{of}"} | forms, ranks),
    ])  # fmt: skip


def _rank(rows: Sequence[StatisticRow], staging: str, profile: str, statistic: str) -> tuple[float, float]:
    """Return the rank correlation of one statistic with the benchmark's [Spearman1904], with and without Lsq."""
    some = [row for row in rows if (row.staging, row.statistic) == (staging, statistic)]
    lsq = {row.experiment: row.benchmark_deg for row in some if row.solver == "ls"}

    def rank(some: Sequence[StatisticRow]) -> float:
        mine = [lsq[row.experiment] if profile == "baseline" else getattr(row, f"{profile}_deg") for row in some]
        return float(error_correlation(np.array(mine), np.array([row.benchmark_deg for row in some]))["spearman"])

    return rank(some), rank([row for row in some if row.solver != "ls"])


def _statistic_figures(rows: Sequence[StatisticRow]) -> Figures:
    """Return each method's median over the experiments of its means, and the rank correlations."""
    figures: Figures = {}
    for staging, profile in product(STAGINGS, PROFILES):
        some = [row for row in rows if row.staging == staging]
        for solver in dict.fromkeys(row.solver for row in some):
            means = [getattr(row, f"{profile}_deg") for row in some if (row.solver, row.statistic) == (solver, "mean")]
            figures[f"{staging}, {profile}: {solver}, mean_deg"] = float(np.nanmedian(means))
        for name in STATISTICS:
            figures[f"{staging}, {profile}: rank correlation of {name}"] = _rank(rows, staging, profile, name)[0]
    return figures


def _pictures(names: dict[str, str]) -> dict[str, str]:
    """Return pictures of the staging one-factor, names there by names beside the page; none where no sweep lies."""
    paths = {ours: OUT / "all" / theirs for ours, theirs in names.items()}
    return {name: path.read_text() for name, path in paths.items() if path.is_file()}


@dataclass(frozen=True)
class AgreementRow:
    """Spearman's rank correlation of mean errors with the benchmark's; low, high: 5 % and 95 % over scenes drawn anew.

    overall: of all means together. within: of the methods within an experiment, between: of the experiments for a
    method, means. baseline: what the benchmark's own Lsq mean of each experiment gives when it stands for all methods.
    """

    staging: str
    profile: str
    methods: str
    means: int
    overall: float
    low: float
    high: float
    within: float
    between: float
    baseline: float
    baseline_between: float


def _agreements(scale: Scale) -> list[AgreementRow]:
    theirs, found = benchmark_statistics(), []
    for staging in STAGINGS:
        rows = swept(staging, scale)
        rows = rows[rows["experiment"].isin(ONE_FACTOR)]
        for profile in PROFILES:
            for words, solvers in SETS.items():
                undefined = {name for name, solver, of in UNDEFINED if of == profile and solver in solvers}
                kept = rows[~rows["experiment"].isin(undefined)]
                ours = agreement(kept, profile, solvers=solvers)
                plain = kept.assign(**{GAPS: [theirs[name, "ls"]["mean"] for name in kept["experiment"]]})
                base = agreement(plain, profile, solvers=solvers)
                found.append(
                    AgreementRow(
                        staging, profile, words, ours.pairs, *ours.overall, ours.within[0], ours.between[0],
                        base.overall[0], base.between[0],
                    )
                )  # fmt: skip
    return found


def _show_agreement(rows: Sequence[AgreementRow]) -> str:
    lines: dict[str, dict[str, str]] = {}
    for row in rows:
        line = lines.setdefault(f"{row.staging}, {row.profile}", {"of": f"{row.staging}, {row.profile}"})
        line[row.methods] = f"{row.overall:.2f} ({row.low:.2f} to {row.high:.2f}); {row.baseline:.2f}"
    return markdown({"staging, profile": "{of}"} | {words: f"{{{words}}}" for words in SETS}, lines.values())


@dataclass(frozen=True)
class FindingRow:
    """A statement of the benchmark's text, and whether it holds in a staging and profile."""

    section: str
    claim: str
    rule: str
    staging: str
    profile: str
    holds: bool
    numbers: str


def _findings(scale: Scale) -> list[FindingRow]:
    return [
        FindingRow(
            one.finding.section, one.finding.claim, one.finding.rule, staging, one.profile, one.holds, one.numbers
        )
        for staging in STAGINGS
        for one in answers(swept(staging, scale))
    ]


def _show_findings(rows: Sequence[FindingRow]) -> str:
    lines = []
    for section, claim in dict.fromkeys((row.section, row.claim) for row in rows):
        holds = [row.holds for row in rows if (row.claim, row.staging) == (claim, STAGINGS[0])]
        told = " / ".join("yes" if one else "no" for one in holds)
        lines.append({"section": section, "claim": claim, "told": told, "verdict": verdict_of(holds)})
    columns = {"section": "{section}", "the benchmark says": "{claim}", " / ".join(PROFILES): "{told}"}
    return markdown(columns | {"verdict": "**{verdict}**"}, lines)


def _finding_figures(rows: Sequence[FindingRow]) -> Figures:
    groups = [(staging, profile) for staging in STAGINGS for profile in PROFILES]
    return {
        f"{staging}, {profile}: statements that hold": float(
            sum(row.holds for row in rows if (row.staging, row.profile) == (staging, profile))
        )
        for staging, profile in groups
    }


@dataclass(frozen=True)
class StabilityRow:
    """Where a method breaks in the staging one-factor, in words, experiment by experiment in the order of the sweep.

    The last four: cells of all experiments, and how many of them the method doubted.
    """

    solver: str
    profile: str
    experiments: tuple[str, ...]
    breaks: tuple[str, ...]
    broken: int
    broken_doubted: int
    whole: int
    whole_doubted: int


def _stability(scale: Scale) -> list[StabilityRow]:
    table = swept("one-factor", scale)
    by_place = dict(iter(levels(table).groupby(GROUP, sort=False)))
    kept, found = table[~table["has_failed"]], []
    for (solver, profile), cells in kept.groupby(["solver", "profile"], sort=False):
        there = {name: by_place[name, solver, profile] for name in dict.fromkeys(cells["experiment"])}
        words = tuple(breaks(list(one["label"]), one["state"]) for one in there.values())
        doubts, broken = ~cells["is_ok"] | (cells["doubts"].fillna("") != ""), cells["is_broken"]
        counts = (broken, broken & doubts, ~broken, ~broken & doubts)
        found.append(StabilityRow(solver, profile, tuple(there), words, *(int(one.sum()) for one in counts)))
    return found


def _show_stability(rows: Sequence[StabilityRow]) -> str:
    rows = [row for row in rows if row.profile == PROFILES[0]]
    lines = [vars(row) | dict(zip(row.experiments, row.breaks, strict=True)) for row in rows]
    columns = {"method": "`{solver}`"}
    columns |= {name: f"{{{name}}}" for name in (*ONE_FACTOR, *TOLD_WRONGLY) if name in rows[0].experiments}
    return markdown(columns, lines)


MEASURES = ("experiments.sweeps.sweep",)
TABLES = (
    Table(
        "sweeps", "stability", MEASURES, StabilityRow, lambda scale: [(scale,)], _stability, _show_stability,
        lambda rows: {f"{row.solver}, {row.profile}: cells broken": float(row.broken) for row in rows},
        lambda rows: _pictures({"sweeps-speed.svg": "speed.svg"}),
    ),
    Table(
        "sweeps", "agreement", MEASURES, AgreementRow, lambda scale: [(scale,)], _agreements,
        _show_agreement,
        lambda rows: {
            f"{row.staging}, {row.profile}, {row.methods}: {key}": getattr(row, key)
            for row in rows for key in ("overall", "within", "between", "baseline")
        },
    ),
    Table(
        "sweeps", "means", MEASURES, StatisticRow, lambda scale: [(scale,)], _statistics, _show_statistics,
        _statistic_figures,
        lambda rows: _pictures({f"sweeps-{name}.svg": f"{name}-normals.svg" for name in ONE_FACTOR}),
    ),
    Table(
        "findings", "findings", MEASURES, FindingRow, lambda scale: [(scale,)], _findings, _show_findings,
        _finding_figures,
    ),
)  # fmt: skip

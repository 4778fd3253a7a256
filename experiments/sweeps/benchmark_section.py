"""A sweep's page, the part that stands beside the benchmark: its statements, its ranks, its table."""

from collections.abc import Mapping, Sequence
from html import escape

from compare.report.page import table
from experiments.stagings import SOLVERS, Experiment
from experiments.sweeps.findings import Answer
from experiments.sweeps.sweep_statistics import (
    MEASURES,
    STATISTICS,
    Agreement,
    Statistics,
    benchmark_statistics,
    three_means,
)


def beside_the_benchmark(
    found: Sequence[Answer], alike: Mapping[tuple[str, str], Agreement], ours: Mapping[str, Statistics],
    there: list[Experiment], solvers: list[str],
) -> list[str]:  # fmt: skip
    """Return the section.

    found: what the rows say to its statements. alike: rank correlations by (profile, measure), none for a first look.
    ours: statistics by measure. there, solvers: the experiments and methods that were run.
    """
    return [
        _findings(found),
        _agreement_words(alike),
        _three_means(ours, there, solvers),
        _table(ours["filled_deg"], there, solvers),
    ]


def _findings(found: Sequence[Answer]) -> str:
    """Return the table of the benchmark's statements; each links the charts that tell."""
    rows = [
        (
            escape(one.finding.section),
            f"<a href='#{one.finding.experiment}'>{escape(one.finding.claim)}</a>",
            f"<b class='{one.verdict.split()[0]}'>{one.verdict}</b>",
            "".join(
                f"<span class='{'seed' if profile == 'seed' else ''}'>{'yes' if one.holds[profile] else 'no'}: "
                f"{escape(words)}</span>"
                for profile, words in one.numbers.items()
            ),
            escape(one.finding.rule),
        )
        for one in found
    ]
    head = (
        "section",
        "the benchmark says",
        "here",
        "numbers: default, <span class='seed'>seed</span>",
        "counts as so if",
    )
    return f"<h2>Finding by finding</h2><div class='findings'>{table(head, rows)}</div>" if rows else ""


def _agreement_words(alike: Mapping[tuple[str, str], Agreement]) -> str:
    if not alike:
        return ""
    rows = [
        (escape(f"{profile}; {MEASURES[measure]}"), str(one.pairs), *map(_interval_words, one[1:]))
        for (profile, measure), one in alike.items()
    ]
    head = ("profile; mean over", "pairs", "all means", "methods within an experiment", "between experiments")
    return (
        "<h2>Beside the benchmark</h2><p>Rank correlation (Spearman) of the calibrated methods' mean errors with the "
        f"benchmark's; 5 % to 95 % when the scenes are drawn anew.</p>{table(head, rows)}"
    )


def _interval_words(numbers: tuple[float, float, float]) -> str:
    middle, low, high = numbers
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def _three_means(ours: Mapping[str, Statistics], there: list[Experiment], solvers: list[str]) -> str:
    """Return the table of mean errors, each over three sets of pixels, and the share that was answered."""
    lines = []
    for one in there:
        for profile in ("default", "seed"):
            keys = [(one.name, solver, profile) for solver in solvers]
            fields = [three_means([ours[measure].get(key, {}) for measure in MEASURES]) for key in keys]
            lines.append((f"{escape(one.label)}, {profile}", *fields))
    words = " / ".join(MEASURES.values())
    return (
        f"<h2>Mean errors, three ways</h2><p>Degrees: {escape(words)}, one number where they are alike; share of the "
        "pixels that is answered, where it is not all. Who gives up where it is hard looks good in the third.</p>"
        f"{table(('', *(escape(SOLVERS.get(name, name)) for name in solvers)), lines)}"
    )


def _table(ours: Statistics, there: list[Experiment], solvers: list[str]) -> str:
    """Return the table in the benchmark's layout; each field: default, seed profile, the benchmark's own."""
    theirs, lines = benchmark_statistics(), []
    for one in there:
        found = [
            (
                ours.get((one.name, solver, "default"), {}),
                ours.get((one.name, solver, "seed"), {}),
                theirs.get((one.name, solver), {}),
            )
            for solver in solvers
        ]
        for name in STATISTICS:
            fields = [_spans(*(f"{each[name]:.2f}" if name in each else "–" for each in three)) for three in found]
            lines.append((f"{escape(one.label)}, {name}", *fields))
        counts = [_spans(_counts(default), _counts(seed)) for default, seed, _ in found]
        lines.append(("cells / without an answer / failed / pixels without one", *counts))
    return (
        "<p>Angular error in degrees, of each cell the mean. In each field: the methods as they are, "
        "<span class='seed'>their plain readings (profile seed)</span>, <span class='theirs'>the benchmark's own "
        "number</span>. A pixel, or a cell, without an answer counts 90°; what failed is in no mean.</p>"
        f"{table(('', *(escape(SOLVERS.get(name, name)) for name in solvers)), lines)}"
    )


def _spans(*values: str) -> str:
    kinds = ("", "seed", "theirs")[: len(values)]
    return "".join(f"<span class='{kind}'>{value}</span>" for kind, value in zip(kinds, values, strict=True))


def _counts(numbers: dict[str, float]) -> str:
    cells, silent, failed, share = (numbers.get(name, 0) for name in ("cells", "no_answer", "failed", "unanswered"))
    return f"{cells} / {silent} / {failed} / {100 * share:.0f} %"

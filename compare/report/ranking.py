"""Every method in one table, the best first: what its numbers say of it, and what it says of itself."""

from dataclasses import dataclass
from typing import Any

from compare.report.facts import by_error, doubts_of, family
from compare.report.page import badge, is_number, say, table_of

Summary = dict[str, Any]

MEDIAN_BARS_DEG = (5.0, 10.0)
"""Median error up to which normals are called good, and beyond which not to be relied on."""
COVERAGE_BAR = 0.9


@dataclass(frozen=True)
class Ranked:
    """One method's normals of the photographs: `row` is its part of the comparison, `level` a key of `page.LEVELS`."""

    name: str
    family: str
    level: str
    row: Summary
    doubts: list[str]


def level_of(value: Any, bars: tuple[float, float]) -> str:
    """Return a value's level between two bars; unknown where it is none."""
    if not is_number(value):
        return "unknown"
    return "good" if value <= bars[0] else "care" if value <= bars[1] else "bad"


def ranking(summary: Summary) -> list[Ranked]:
    """Return all methods, the smallest median error first; those without one last.

    A method that leaves more than a tenth of the object unknown, or that doubts itself, is not called good.
    """
    compared, ranked = summary.get("compare") or {}, []
    for name in by_error(compared):
        row, doubts = compared["methods"][name], doubts_of(summary, name)
        level, coverage = level_of((row.get("real") or {}).get("median_deg"), MEDIAN_BARS_DEG), row.get("coverage")
        if level == "good" and (doubts or (is_number(coverage) and coverage < COVERAGE_BAR)):
            level = "care"
        ranked.append(Ranked(name, family(name), level, row, doubts))
    return ranked


def ranking_table(summary: Summary) -> str:
    """Return the methods as a table for the top of the page; nothing where there are none."""
    ranked, compared = ranking(summary), summary.get("compare") or {}
    if not ranked:
        return ""
    name = "ranking" if any(method.row.get("real") for method in ranked) else "without truth"
    sigma = (compared.get("truth") or {}).get("sigma_deg_median")
    caption = say("ranking", name)
    if name == "ranking" and is_number(sigma):
        caption += say("ranking", "sigma", sigma=sigma)
    solved, rows = (summary.get("solve") or {}).get("methods") or {}, []
    for method in ranked:
        told = {
            "name": method.name,
            "family": "" if method.family == "calibrated" else f" <small>{method.family}</small>",
            "verdict": badge(method.level),
            "own_sigma": (solved.get(method.name) or {}).get("sigma_deg_median"),
            # Without the quotes that stand for code on a terminal.
            "doubts": " ".join(method.doubts).replace("`", "") or "–",
        }
        rows.append({**(method.row.get("real") or {}), **method.row, **told})
    return table_of(name, rows, caption=caption, kind="numbers ranking")

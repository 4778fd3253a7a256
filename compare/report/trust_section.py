"""The report's section on which normals to believe: how well each method predicts photographs."""

from html import escape
from typing import Any

from compare.report import page
from compare.report.facts import Summary

WORSE = 3.0
"""Times as much unexplained as by the recommended method, from which on another is not to be used."""


def trust_sentence(found: dict[str, Any]) -> str:
    """Return which method to take, which not to use, and why not to believe that."""
    methods, recommended, level = found["methods"], found["recommended"], found["level"]
    text = recommended
    if level:
        text += f"; {', '.join(level)} {'is' if len(level) == 1 else 'are'} level with it"
    least = max(methods[recommended]["unexplained"], 1e-9)
    bad = {name: row["unexplained"] / least for name, row in methods.items() if row["unexplained"] is not None}
    named = [f"{name} ({times:.0f} times)" for name, times in bad.items() if times > WORSE]
    if named:
        text += f". Do not use what explains them so much worse: {', '.join(named)}"
    return " ".join([f"{text}.", *(f"{doubt[0].upper()}{doubt[1:]}" for doubt in found["doubts"])])


def trust_section(summary: Summary) -> str:
    """Return how well each method predicts photographs, and what to take; nothing where it was not asked for."""
    found = summary.get("trust")
    if not found:
        return ""
    rows = [
        (
            escape(name),
            "–" if row["unexplained"] is None else f"{row['unexplained']:.1%}",
            page.number(row["apart_deg"], 1, "°"),
        )
        for name, row in found["methods"].items()
    ]
    heads = ("method", "unexplained", f"from {found['recommended']}")
    body = page.table(heads, rows, caption=page.say("trust", "table"))
    return page.section("trust", "Which normals to believe", body, escape(f"Take {trust_sentence(found)}"))

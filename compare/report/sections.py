"""The report's sections that hold words: warnings, known truth, provenance, how to read."""

import json
from html import escape
from typing import Any

from compare.report.facts import by_error, family
from compare.report.page import absent, definitions, is_number, number, round_number, section, table, words

Summary = dict[str, Any]


def warnings_section(warnings: list[tuple[str, str]]) -> str:
    """Return all warnings, each with its step."""
    if not warnings:
        return section("warnings", "Warnings", "<p>None of the steps gave a warning.</p>")
    rows = "".join(f"<li><b>{escape(step or 'session')}</b> {escape(text)}</li>" for step, text in warnings)
    return section("warnings", "Warnings", f'<ul class="warnings">{rows}</ul>')


def truth_check_section(summary: Summary) -> str:
    """Return known truth against what was found (the demo); nothing where none was supplied."""
    rows = []
    for label, row in (summary.get("truth_check") or {}).items():
        value, bar, unit = row.get("value"), row.get("bar"), str(row.get("unit") or "")
        unit = {"degrees": "°"}.get(unit, unit)
        mark = "" if not (is_number(value) and is_number(bar)) else "within" if value <= bar else "<b>over</b>"
        name = escape(str(row.get("text") or label)).replace("`", "")
        rows.append((name, number(value, 3, unit), round_number(bar, unit) if is_number(bar) else "", mark))
    if not rows:
        return ""
    columns = 4 if any(mark for *_, mark in rows) else 2
    lead = "This session's truth is known from elsewhere; none of the steps was given it."
    found = table(("quantity", "found", "bar", "verdict")[:columns], [row[:columns] for row in rows])
    return section("truth-check", "Against the known truth", found, lead)


def provenance_section(summary: Summary) -> str:
    """Return versions, arguments, camera, rendering and seconds: what is needed to get these numbers again."""
    parts = []
    if seconds := summary.get("seconds"):
        rows = [(escape(str(step)), number(value, 1, "s")) for step, value in seconds.items()]
        parts.append(table(("step", "time"), rows, caption="Seconds per step"))
    for key in ("versions", "arguments", "camera", "twin"):
        values = {name: value for name, value in (summary.get(key) or {}).items() if name != "warnings"}
        if values:
            rows = [(escape(str(name)), escape(as_text(value))) for name, value in values.items()]
            parts.append(table(("name", "value"), rows, caption=key.capitalize(), kind="plain"))
    notes = "".join(
        f"<li><b>{escape(step)}</b> {escape(str(text))}</li>"
        for step in ("calibrate", "align")
        for text in (summary.get(step) or {}).get("evidence") or ()
    )
    notes = f"<h3>What the steps decided, and on what evidence</h3><ul>{notes}</ul>" if notes else ""
    body = f'<div class="columns">{"".join(parts)}</div>{notes}' if parts or notes else absent("Nothing was recorded.")
    lead = "Every number of this page is in summary.json beside it; its full precision too."
    return section("provenance", "Where the numbers come from", body, lead)


def how_to_read_section(compared: Summary) -> str:
    """Return what the page's words mean, the families and the names of the methods that are there among them."""
    names = by_error(compared)
    families, known = {family(name) for name in names}, words("methods")
    terms = [
        *words("how_to_read").items(),
        *((f"{word.capitalize()} method", text) for word, text in words("families").items() if word in families),
        *((name, known[name].replace("`", "")) for name in names if name in known),
    ]
    return section("how-to-read", "How to read this page", definitions(terms))


def as_text(value: Any) -> str:
    """Return a setting as a short text."""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(as_text(item) for item in value)
    return json.dumps(value, default=str)

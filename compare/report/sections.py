"""The report's sections that hold words: verdict, warnings, provenance, how to read."""

import json
from html import escape
from typing import Any

from compare.report.method_words import method_words
from compare.report.page import absent, badge, is_number, number, round_number, section, table
from compare.report.verdict import Statement

Summary = dict[str, Any]

HOW_TO_READ = (
    (
        "Angular error",
        "the angle between an estimated normal and the ground truth's, 0° to 180°, at one pixel. It is never folded: "
        "a surface that comes out inside-out counts as wrong.",
    ),
    (
        "Median, quartiles",
        "half of the pixels are below the median, a quarter below Q1, three quarters below Q3. A mean far above the "
        "median says that few pixels are very wrong: shadows, edges, highlights.",
    ),
    (
        "Axes",
        "x to the right, y up, z toward the viewer; a light's direction points from the object to the light. "
        "0° from the camera's axis is a light right behind the camera, 90° one from the side.",
    ),
    (
        "Sigma",
        "one standard deviation. Directions: along one tangent axis. Intensities: relative. A sigma tells how far "
        "noise moves a result; a wrong model moves it further.",
    ),
    (
        "Twin",
        "the scanned object rendered under the measured camera and lights with the measured albedo, then given to the "
        "same methods. Where real and twin fail alike, shape, shadow and light explain the failure; where they "
        "differ, the material, the calibration or the registration has a part in it.",
    ),
    (
        "Pearson, Spearman",
        "correlation of the two error maps over the pixels known in both, by value and by rank; 1: the same "
        "pattern, 0: none in common. Neighbouring pixels are alike, so the number of pixels proves nothing by itself.",
    ),
    (
        "Common turn",
        "the one rotation of all normals that brings them closest to the truth. Errors that vanish with it come from "
        "lights or pose.",
    ),
    (
        "Badges",
        "normals: good up to 5° median error, not to be relied on beyond 10°; a method that doubts itself or leaves "
        "more than a tenth unknown is not called good. Light directions: 1° and 3° sigma. Registration: 1 and 3 px. "
        "Error patterns: alike from a Pearson correlation of 0.6, unlike below 0.3. These bars are habits of the "
        "trade, not laws: your purpose decides.",
    ),
)


def verdict_box(statements: list[Statement], warnings: int, methods: str) -> str:
    """Return the box on top: one line a topic, its badge, its sentence; the methods' table after the first."""
    lines = [f"<li><h3>{escape(s.topic)} {badge(s.level)}</h3><p>{s.html}</p></li>" for s in statements]
    rows = "".join([*lines[:1], f'<li class="wide">{methods}</li>' if methods else "", *lines[1:]])
    if warnings:
        counted = "1 warning" if warnings == 1 else f"{warnings} warnings"
        rows += (
            f'<li><h3>Warnings {badge("care")}</h3><p><a href="#warnings">{counted}</a>: read them before using '
            "the results.</p></li>"
        )
    else:
        rows += "<li><h3>Warnings</h3><p>No step gave a warning.</p></li>"
    return f'<section id="verdict" class="verdict"><h2>What was found</h2><ul>{rows}</ul></section>'


def warnings_section(warnings: list[tuple[str, str]]) -> str:
    """Return all warnings, each with its step."""
    if not warnings:
        return section("warnings", "Warnings", "<p>None of the steps gave a warning.</p>")
    rows = "".join(f"<li><b>{escape(step or 'session')}</b> {escape(text)}</li>" for step, text in warnings)
    return section("warnings", "Warnings", f'<ul class="warnings">{rows}</ul>')


def truth_check_section(summary: Summary) -> str:
    """Return known truth against what was found (the demo); nothing where none was supplied."""
    rows, judged = [], False
    for label, row in (summary.get("truth_check") or {}).items():
        value, bar, unit = row.get("value"), row.get("bar"), str(row.get("unit") or "")
        unit = {"degrees": "°"}.get(unit, unit)
        mark = "" if not (is_number(value) and is_number(bar)) else "within" if value <= bar else "<b>over</b>"
        judged = judged or bool(mark)
        words = escape(str(row.get("text") or label)).replace("`", "")
        rows.append((words, number(value, 3, unit), *((round_number(bar, unit), mark) if is_number(bar) else ("", ""))))
    if not rows:
        return ""
    if not judged:
        rows = [row[:2] for row in rows]
    lead = "This session's truth is known from elsewhere; none of the steps was given it."
    return section(
        "truth-check",
        "Against the known truth",
        table(("quantity", "found", "bar", "verdict")[: len(rows[0])], rows),
        lead,
    )


def provenance_section(summary: Summary) -> str:
    """Return versions, arguments, camera, rendering and seconds: what is needed to get these numbers again."""
    parts = []
    seconds = summary.get("seconds") or {}
    if seconds:
        rows = [(escape(str(step)), number(value, 1, "s")) for step, value in seconds.items()]
        parts.append(table(("step", "time"), rows, caption="Seconds per step"))
    for title, key in (("Versions", "versions"), ("Arguments", "arguments"), ("Camera", "camera"), ("Twin", "twin")):
        values = {name: value for name, value in (summary.get(key) or {}).items() if name != "warnings"}
        if values:
            rows = [(escape(str(name)), escape(word(value))) for name, value in values.items()]
            parts.append(table(("name", "value"), rows, caption=title, kind="plain"))
    evidence = [
        (step, text) for step in ("calibrate", "align") for text in (summary.get(step) or {}).get("evidence") or ()
    ]
    notes = "".join(f"<li><b>{escape(step)}</b> {escape(str(text))}</li>" for step, text in evidence)
    notes = f"<h3>What the steps decided, and on what evidence</h3><ul>{notes}</ul>" if notes else ""
    body = f'<div class="columns">{"".join(parts)}</div>{notes}' if parts or notes else absent("Nothing was recorded.")
    lead = "Every number of this page is in summary.json beside it; its full precision too."
    return section("provenance", "Where the numbers come from", body, lead)


def how_to_read_section(compared: Summary) -> str:
    """Return what the page's words mean, the methods' names among them."""
    words = [*HOW_TO_READ, *method_words(compared)]
    rows = "".join(f"<dt>{escape(term)}</dt><dd>{escape(text)}</dd>" for term, text in words)
    return section("how-to-read", "How to read this page", f"<dl>{rows}</dl>")


def word(value: Any) -> str:
    """Return a setting as a short text."""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(word(item) for item in value)
    return json.dumps(value, default=str)

"""The report's sections that hold words: warnings, known truth, provenance, how to read."""

import json
from html import escape
from typing import Any

from compare.report.facts import by_error, family
from compare.report.page import absent, definitions, is_number, number, round_number, section, table

Summary = dict[str, Any]

WORDS = {
    "ls": "least squares over the samples that are not in shadow; for matte surfaces.",
    "iterative": "least squares again and again, without what does not fit: gloss and cast shadows.",
    "position": "least squares over each pixel's middle samples by brightness.",
    "l1": "least absolute deviations: a few wrong samples do not steer it.",
    "sbl": "sparse Bayesian regression: each sample has a variance of its own.",
    "hsh": "hemispherical harmonics of order 2.",
    "rpca": "robust principal components: all samples as one low-rank matrix with sparse faults, then least squares.",
    "semicalibrated": "trusts the lights' directions and finds their intensities from the object; then `iterative`.",
    "near": "`iterative` and the surface's depth in turn, each flash as every pixel's place sees it.",
    "reflectance": "one table of how the whole object reflects, found together with the normals.",
    "ldr": "finds the lights too, from where a matte surface is brightest.",
    "entropy": "finds the lights too, by the relief whose albedo is plainest.",
    "tv": "finds the lights too, by the relief whose slopes balance.",
}
"""What each method's name stands for: who reads the report has not read the documentation."""
FAMILIES = {
    "calibrated": "is told the lights' directions and intensities.",
    "uncalibrated": "is not told the lights' directions; normals may be turned inside out or stretched as a relief.",
    "external": "another program, run by --external.",
}
HOW_TO_READ = {
    "Angular error": "the angle between an estimated normal and the ground truth's, 0° to 180°, at one pixel. It is "
    "never folded: a surface that comes out inside-out counts as wrong.",
    "Median, quartiles": "half of the pixels are below the median, a quarter below Q1, three quarters below Q3. A "
    "mean far above the median says that few pixels are very wrong: shadows, edges, highlights.",
    "Axes": "x to the right, y up, z toward the viewer; a light's direction points from the object to the light. 0° "
    "from the camera's axis is a light right behind the camera, 90° one from the side.",
    "Sigma": "one standard deviation. Directions: along one tangent axis. Intensities: relative. A sigma tells how "
    "far noise moves a result; a wrong model moves it further.",
    "Twin": "the scanned object rendered under the measured camera and lights with the measured albedo, then given to "
    "the same methods. Where real and twin fail alike, shape, shadow and light explain the failure; where they "
    "differ, the material, the calibration or the registration has a part in it.",
    "Pearson, Spearman": "correlation of the two error maps over the pixels known in both, by value and by rank; 1: "
    "the same pattern, 0: none in common. Neighbouring pixels are alike, so the number of pixels proves nothing by "
    "itself.",
    "Common turn": "the one rotation of all normals that brings them closest to the truth. Errors that vanish with it "
    "come from lights or pose.",
    "Badges": "normals: good up to 5° median error, not to be relied on beyond 10°; a method that doubts itself or "
    "leaves more than a tenth unknown is not called good. Light directions: 1° and 3° sigma. Registration: 1 and 3 "
    "px. Error patterns: alike from a Pearson correlation of 0.6, unlike below 0.3. These bars are habits of the "
    "trade, not laws: your purpose decides.",
}


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
        words = escape(str(row.get("text") or label)).replace("`", "")
        rows.append((words, number(value, 3, unit), round_number(bar, unit) if is_number(bar) else "", mark))
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
    families = {family(name) for name in names}
    words = [
        *HOW_TO_READ.items(),
        *((f"{word.capitalize()} method", text) for word, text in FAMILIES.items() if word in families),
        *((name, WORDS[name].replace("`", "")) for name in names if name in WORDS),
    ]
    return section("how-to-read", "How to read this page", definitions(words))


def as_text(value: Any) -> str:
    """Return a setting as a short text."""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(as_text(item) for item in value)
    return json.dumps(value, default=str)

"""The report's sections that hold words and numbers: verdict, warnings, statistics, time, provenance."""

import json
from html import escape
from typing import Any

from compare import charts
from compare.page import absent, badge, is_number, number, percent, round_number, section, table
from compare.verdict import Statement

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
        "normals: good up to 5° median error, not to be relied on beyond 10°. Light directions: 1° and 3° sigma. "
        "Registration: 1 and 3 px. Error patterns: alike from a Pearson correlation of 0.6, unlike below 0.3. "
        "These bars are habits of the trade, not laws: your purpose decides.",
    ),
)


def verdict_box(statements: list[Statement], warnings: int) -> str:
    """Return the box on top: one line a topic, its badge, its sentence."""
    rows = "".join(f"<li><h3>{escape(s.topic)} {badge(s.level)}</h3><p>{s.html}</p></li>" for s in statements)
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


def statistics_section(compared: Summary) -> str:
    """Return the table of angular errors, and that of how alike real and twin fail."""
    methods = compared.get("methods") or {}
    rows = []
    for name, row in methods.items():
        for kind in ("real", "twin"):
            if not (found := row.get(kind)):
                continue
            degrees = [
                number(found.get(f"{key}_deg"), 2) for key in ("min", "max", "mean", "median", "std", "q1", "q3")
            ]
            shares = [percent(found.get("under_5_deg"), 1), percent(found.get("under_10_deg"), 1)]
            covered = percent(row.get("coverage" if kind == "real" else "twin_coverage"), 1)
            rows.append((f"{escape(name)} <small>{kind}</small>", *degrees, *shares, number(found["pixels"]), covered))
    body = ""
    if rows:
        head = (
            "method",
            "min",
            "max",
            "mean",
            "median",
            "std",
            "Q1",
            "Q3",
            "&lt; 5°",
            "&lt; 10°",
            "pixels",
            "answered",
        )
        caption = "Angular error against the ground truth, degrees; “answered”: share of the true pixels."
        body += table(head, rows, caption=caption, kind="numbers")
        body += _correlations(methods)
    elif compared.get("has_truth"):
        body += absent("There is ground truth, but no method's normals share a pixel with it.")
    else:
        body += absent(
            "No ground truth: without a scan or given normals there is no error to count. What follows compares "
            "methods with each other, which tells where they disagree, not which is right."
        )
    pairs = compared.get("between_methods") or []
    if pairs:
        lines = [
            (
                f"{escape(p['a'])} – {escape(p['b'])}",
                *(number(p.get(f"{key}_deg"), 2) for key in ("mean", "median", "q1", "q3", "max")),
                number(p["pixels"]),
            )
            for p in pairs
        ]
        head = ("methods", "mean", "median", "Q1", "Q3", "max", "pixels")
        caption = "Angle between two methods' normals on the photographs, degrees."
        body += table(head, lines, caption=caption, kind="numbers")
    return section("statistics", "Statistics", body)


def _correlations(methods: Summary) -> str:
    rows = [
        (
            escape(name),
            number(row.get("pearson"), 3),
            number(row.get("spearman"), 3),
            number(row.get("median_difference_deg"), 2),
            number(row.get("correlation_pixels")),
            number(row.get("real_rotation_deg"), 2),
            number(row.get("real_median_unrotated_deg"), 2),
            number(row.get("twin_rotation_deg"), 2),
            number(row.get("twin_median_unrotated_deg"), 2),
        )
        for name, row in methods.items()
        if row.get("real") and row.get("twin")
    ]
    if not rows:
        return absent("No twin: whether a rendering fails like the object cannot be told.")
    head = (
        "method",
        "Pearson",
        "Spearman",
        "median real − twin, °",
        "pixels in both",
        "common turn real, °",
        "median without it, °",
        "common turn twin, °",
        "median without it, °",
    )
    return table(head, rows, caption="Do real and twin fail alike, and how much is one common turn?", kind="numbers")


def time_section(summary: Summary) -> str:
    """Return the time-against-error chart with its numbers."""
    compared, solved = summary.get("compare") or {}, (summary.get("solve") or {}).get("methods") or {}
    points, rows = [], []
    for name, row in solved.items():
        row = row or {}
        errors = (compared.get("methods") or {}).get(name) or {}
        seconds, twin_seconds = row.get("seconds_per_megapixel_image"), row.get("twin_seconds")
        images = row.get("megapixels"), row.get("frames")
        work = images[0] * images[1] if is_number(images[0]) and is_number(images[1]) else 0
        times = {"real": seconds, "twin": twin_seconds / work if is_number(twin_seconds) and work else None}
        for kind, time in times.items():
            median = (errors.get(kind) or {}).get("median_deg")
            if is_number(time) and is_number(median) and time > 0 and median > 0:
                points.append({"method": name, "kind": kind, "seconds": time, "median_deg": median})
        settings = ", ".join(f"{key} {_word(value)}" for key, value in (row.get("settings") or {}).items())
        rows.append(
            (
                escape(name),
                number(row.get("seconds"), 2),
                number(seconds, 3),
                number(twin_seconds, 2) if is_number(twin_seconds) else "–",
                number((errors.get("real") or {}).get("median_deg"), 2),
                f"<small>{escape(settings) or '–'}</small>",
            )
        )
    if not rows:
        return section("time", "Time against error", absent("No method's time is in the summary."))
    chart = charts.time_against_error(points) if points else absent("No error is known, so only times are given.")
    head = (
        "method",
        "seconds",
        "s per megapixel-image",
        "seconds on twin",
        "median error, °",
        "<small>settings</small>",
    )
    lead = "Left and low is better. A megapixel-image is one million pixels of one frame."
    return section("time", "Time against error", chart + table(head, rows, kind="numbers"), lead)


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
            rows = [(escape(str(name)), escape(_word(value))) for name, value in values.items()]
            parts.append(table(("name", "value"), rows, caption=title, kind="plain"))
    evidence = [
        (step, text) for step in ("calibrate", "align") for text in (summary.get(step) or {}).get("evidence") or ()
    ]
    notes = "".join(f"<li><b>{escape(step)}</b> {escape(str(text))}</li>" for step, text in evidence)
    notes = f"<h3>What the steps decided, and on what evidence</h3><ul>{notes}</ul>" if notes else ""
    body = f'<div class="columns">{"".join(parts)}</div>{notes}' if parts or notes else absent("Nothing was recorded.")
    lead = "Every number of this page is in summary.json beside it; its full precision too."
    return section("provenance", "Where the numbers come from", body, lead)


def how_to_read_section() -> str:
    """Return what the page's words mean."""
    rows = "".join(f"<dt>{escape(term)}</dt><dd>{escape(text)}</dd>" for term, text in HOW_TO_READ)
    return section("how-to-read", "How to read this page", f"<dl>{rows}</dl>")


def _word(value: Any) -> str:
    """Return a setting as a short text."""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return ", ".join(_word(item) for item in value)
    return json.dumps(value, default=str)

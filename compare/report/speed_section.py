"""The report's chart of speed against accuracy, and its numbers."""

from html import escape
from typing import Any

from compare.report.facts import by_error
from compare.report.page import absent, is_number, number, section, table
from compare.report.sections import word
from compare.report.speed import speed_points
from compare.report.speed_chart import speed_chart

Summary = dict[str, Any]


def time_section(summary: Summary) -> str:
    """Return the time-against-error chart, what it could not show, and its numbers."""
    compared, solved = summary.get("compare") or {}, (summary.get("solve") or {}).get("methods") or {}
    if not solved:
        return section("time", "Speed against accuracy", absent("No method's time is in the summary."))
    points, missing = speed_points(summary)
    reasons: dict[str, list[str]] = {}
    for method, reason in missing:
        reasons.setdefault(reason, []).append(method)
    chart = f'<figure class="speed">{speed_chart(points)}</figure>' if points else ""
    chart += "".join(absent(f"Not in the chart: {', '.join(names)}: {reason}.") for reason, names in reasons.items())
    errors = compared.get("methods") or {}
    names = [name for name in by_error(compared) if name in solved]
    rows, settings = [], []
    for name in [*names, *(name for name in solved if name not in names)]:
        row, error = solved[name] or {}, errors.get(name) or {}
        medians = ((error.get(kind) or {}).get("median_deg") for kind in ("real", "twin"))
        rows.append(
            (
                escape(name),
                number(row.get("seconds"), 2),
                number(row.get("seconds_per_megapixel_image"), 3),
                number(row["twin_seconds"], 2) if is_number(row.get("twin_seconds")) else "–",
                *(number(median, 2) if is_number(median) else "–" for median in medians),
            )
        )
        options = ", ".join(f"{key} {word(value)}" for key, value in (row.get("settings") or {}).items())
        settings.append((escape(name), escape(options) or "–"))
    head = ("method", "seconds", "s per megapixel-image", "seconds, twin", "median error, °", "median error, twin, °")
    listed = table(("method", "settings"), settings, kind="plain")
    folded = f"<details><summary>The settings they ran with</summary>{listed}</details>"
    lead = "A megapixel-image is one million pixels of one frame; seconds are wall time on the machine that solved."
    if points:
        lead += (
            " Left and low is better. Methods above the dotted steps are beaten by another in both time and error; on "
            "another object they may not be."
        )
    return section("time", "Speed against accuracy", chart + table(head, rows, kind="numbers") + folded, lead)

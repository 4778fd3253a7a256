"""What each rendering engine would take for an error, on the scene of the report: why this one was taken."""

from typing import Any

from compare.report.line_chart import line_chart
from compare.report.page import is_number, number

Facts = dict[str, Any]


def engine_chart(facts: Facts) -> str:
    """Return the figure of seconds against error, by the twin's facts in the summary; empty if no pilot was run."""
    curves = facts.get("time_and_error") or {}
    lines = {
        name: ([100 * error for error, _ in points], [seconds for _, seconds in points])
        for name, points in curves.items()
        if len(points) > 1 and all(is_number(value) and value > 0 for point in points for value in point)
    }
    if not lines:
        return ""
    chart = line_chart(
        lines, x_title="error of the picture, % of its mean", y_title="seconds, the whole stack", log_x=True, log_y=True
    )
    told = (
        f"What the engines would take, by the pilot; {number(100 * facts['error'], 1, '%')} was asked for. Left and "
        "low is better. A line that turns upward without getting further left has nothing to gain from more samples: "
        "<code>direct</code> leaves out the light that goes on from surface to surface."
        if is_number(facts.get("error"))
        else "What the engines would take, by the pilot."
    )
    return f'<figure class="speed">{chart}<figcaption>{told}</figcaption></figure>'

"""A plan's drawings, as SVG: the top view with flashes, balls and object, and error against flashes and minutes."""

from html import escape
from typing import Any

import numpy as np

from draw.line_chart import Axis, Frame, axes, svg
from scene.figures import COLOURS

SIDE, EDGE = 560.0, 34.0
RINGS_DEG = (15, 30, 45, 60, 75)
NEW, THERE, CHROME, WHITE = "#0072B2", "#9aa5b0", "#59636e", "#fff"
FONT = 'font-size="12"'
HALO = 'font-size="12" font-weight="600" stroke="white" stroke-width="3" paint-order="stroke"'
CHART = Frame(56.0, 16.0, 540.0, 236.0)
TICKS = (4, 6, 8, 12, 16, 24, 36, 48, 60, 100, 150, 200)


def top_view(facts: dict[str, Any]) -> str:
    """Return the plan as the camera sees it, to scale: rings are degrees from its axis at the flashes' distance."""
    reach, size = facts["reach"]["distance_mm"], facts["object"]["size_mm"]
    rows = facts["flashes"]
    far = max(
        [row["aside_mm"] for row in rows]
        + [0.75 * size, *(np.hypot(b["right_mm"], b["up_mm"]) for b in facts["balls"])]
    )
    scale = (SIDE / 2 - EDGE) / far
    middle = SIDE / 2

    def at(x: float, y: float) -> tuple[float, float]:
        return middle + scale * x, middle - scale * y

    parts = []
    for degrees in RINGS_DEG:
        radius = scale * reach * np.sin(np.radians(degrees))
        if radius < SIDE / 2 - 8:
            parts.append(f'<circle cx="{middle}" cy="{middle}" r="{radius:.1f}" fill="none" stroke="#e3e7ea"/>')
            parts.append(
                _text(middle + 3, middle - radius - 3, f"{degrees}°", "start", 'fill="#8a949e" font-size="11"')
            )
    (left, top), (right, bottom) = (at(*corner) for corner in facts["camera"]["field_mm"])
    parts.append(
        f'<rect x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}" fill="none" '
        'stroke="#b9c6d1" stroke-dasharray="6 4"/>'
    )
    if top > 4:
        parts.append(_text(left + 4, top + 13, "the picture", "start", 'fill="#8a949e" font-size="11"'))
    outline = " ".join(f"{u:.1f},{v:.1f}" for u, v in (at(*corner) for corner in facts["object"]["outline_mm"]))
    parts.append(f'<polygon points="{outline}" fill="#f3e3c3" stroke="#b08d4a"/>')
    for row in rows:
        x, y, _ = row["direction"]
        u, v = at(row["distance_mm"] * x, row["distance_mm"] * y)
        paint = THERE if row["is_there"] else NEW
        words = escape(
            f"flash {row['number']}: {row['from_axis_deg']:.0f} degrees from the axis, {row['clock']} o'clock"
        )
        parts.append(f'<g><title>{words}</title><circle cx="{u:.1f}" cy="{v:.1f}" r="10" fill="{paint}"/>')
        parts.append(_text(u, v + 4, str(row["number"]), "middle", 'fill="#fff" font-size="11" font-weight="600"'))
        parts.append("</g>")
        parts.append(_text(u, v + 22, f"{row['height_mm'] / 10:.0f}", "middle", f'fill="{paint}" font-size="10"'))
    for number, ball in enumerate(facts["balls"], 1):
        u, v = at(ball["right_mm"], ball["up_mm"])
        radius = max(scale * ball["diameter_mm"] / 2, 4.0)
        paint = CHROME if ball["kind"] == "chrome" else WHITE
        parts.append(f'<circle cx="{u:.1f}" cy="{v:.1f}" r="{radius:.1f}" fill="{paint}" stroke="#1d2329"/>')
        parts.append(_text(u, v - radius - 4, f"{'C' if ball['kind'] == 'chrome' else 'W'}{number}", "middle", HALO))
    for hour, (x, y) in {"12": (0, 1), "3": (1, 0), "6": (0, -1), "9": (-1, 0)}.items():
        parts.append(
            _text(
                middle + x * (middle - 9),
                middle - y * (middle - 9) + 4,
                hour,
                "middle",
                'fill="#8a949e" font-size="12"',
            )
        )
    return svg(SIDE, SIDE, parts, label="the flashes and balls as the camera sees them")


def error_chart(facts: dict[str, Any]) -> str:
    """Return the error that is to be expected against the number of flashes and the minutes that they take."""
    rows = [row for row in (*facts["flashes"], *facts["next_flashes"]) if row["error_median_deg"] is not None]
    numbers, errors = [row["number"] for row in rows], [row["error_median_deg"] for row in rows]
    wanted = [facts["accuracy_deg"]] if facts["accuracy_deg"] else []
    x = Axis.over([numbers], CHART.left, CHART.right, log=False)
    minutes = {row["number"]: row["minutes"] for row in rows}
    x.ticks[:] = [(float(n), f"{n}: {minutes[n]:.0f} min") for n in _spaced(numbers)]
    heights = [value for value in [*errors, *wanted] if value < 90] or [1.0]
    y = Axis.over([heights], CHART.bottom, CHART.top, log=True, unit="°")
    parts = axes(x, y, CHART, x_title="flashes, and the minutes that they take", y_title="median error of the normals")

    def shown(value: float) -> float:
        return y.at(min(max(value, 10**y.low), 10**y.high))

    line = " ".join(f"{x.at(n):.1f},{shown(error):.1f}" for n, error in zip(numbers, errors, strict=True))
    parts.append(f'<polyline points="{line}" fill="none" stroke="{COLOURS[0]}" stroke-width="2.5"/>')
    last = facts["flashes"][-1]
    if last["error_median_deg"] is not None:
        u, v = x.at(last["number"]), shown(last["error_median_deg"])
        parts.append(f'<circle cx="{u:.1f}" cy="{v:.1f}" r="6" fill="{COLOURS[0]}"/>')
    if wanted:
        parts.append(
            f'<path d="M{CHART.left} {y.at(wanted[0]):.1f}H{CHART.right}" stroke="#a33c00" stroke-dasharray="6 4"/>'
        )
        parts.append(_text(CHART.right - 4, y.at(wanted[0]) - 5, "wanted", "end", 'fill="#a33c00" font-size="12"'))
    return svg(SIDE, 284, parts, label="error against flashes")


def _spaced(numbers: list[int]) -> list[int]:
    """Return at most six of the numbers, far enough from each other to be read."""
    found: list[int] = []
    for number in [n for n in TICKS if n in numbers]:
        if not found or number - found[-1] >= numbers[-1] / 7:
            found.append(number)
    return found


def _text(x: float, y: float, words: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{escape(words)}</text>'

"""A plan's drawings: the top view with flashes, balls and object, and error against flashes and minutes."""

from typing import Any

import numpy as np

from draw.light_charts import rings
from draw.svg import COLOURS, Axis, Drawing, Frame, axes, circle, line, svg, text

SIDE, EDGE = 560.0, 34.0
RINGS_DEG = (15, 30, 45, 60, 75)
NEW, THERE, CHROME, WHITE = "#0072B2", "#9aa5b0", "#59636e", "#fff"
SOFT, WANTED = "#8a949e", "#a33c00"
CHART = Frame(56.0, 16.0, 540.0, 236.0)
TICKS = (4, 6, 8, 12, 16, 24, 36, 48, 60, 100, 150, 200)


def top_view(facts: dict[str, Any]) -> Drawing:
    """Return the plan as the camera sees it, to scale: rings are degrees from its axis at the flashes' distance."""
    reach, size, rows = facts["reach"]["distance_mm"], facts["object"]["size_mm"], facts["flashes"]
    balls = [np.hypot(ball["right_mm"], ball["up_mm"]) for ball in facts["balls"]]
    far = max([row["aside_mm"] for row in rows] + [0.75 * size, *balls])
    scale, middle = (SIDE / 2 - EDGE) / far, SIDE / 2

    def at(x: float, y: float) -> tuple[float, float]:
        return middle + scale * x, middle - scale * y

    radii = ((degrees, scale * reach * np.sin(np.radians(degrees))) for degrees in RINGS_DEG)
    parts = rings(middle, ((degrees, radius) for degrees, radius in radii if radius < middle - 8), 90)
    (left, top), (right, bottom) = (at(*corner) for corner in facts["camera"]["field_mm"])
    frame = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)]
    parts.append(line(frame, "#b9c6d1", stroke_dasharray="6 4"))
    if top > 4:
        parts.append(text(left + 4, top + 13, "the picture", "start", 11, SOFT))
    corners = [at(*corner) for corner in facts["object"]["outline_mm"]]
    parts.append(line([*corners, *corners[:1]], "#b08d4a", fill="#f3e3c3"))
    for row in rows:
        u, v = at(*(row["distance_mm"] * part for part in row["direction"][:2]))
        paint = THERE if row["is_there"] else NEW
        told = f"flash {row['number']}: {row['from_axis_deg']:.0f} degrees from the axis, {row['clock']} o'clock"
        parts.append(circle(u, v, 10, paint, told))
        parts.append(text(u, v + 4, str(row["number"]), size=11, fill="#fff", font_weight="600"))
        parts.append(text(u, v + 22, f"{row['height_mm'] / 10:.0f}", size=10, fill=paint))
    for number, ball in enumerate(facts["balls"], 1):
        u, v = at(ball["right_mm"], ball["up_mm"])
        radius, is_chrome = max(scale * ball["diameter_mm"] / 2, 4.0), ball["kind"] == "chrome"
        parts.append(circle(u, v, radius, CHROME if is_chrome else WHITE, stroke="#1d2329"))
        halo = {"font_weight": "600", "stroke": "white", "stroke_width": "3", "paint_order": "stroke"}
        parts.append(text(u, v - radius - 4, f"{'C' if is_chrome else 'W'}{number}", size=12, **halo))
    for hour, (x, y) in {"12": (0, 1), "3": (1, 0), "6": (0, -1), "9": (-1, 0)}.items():
        parts.append(text(middle + x * (middle - 9), middle - y * (middle - 9) + 4, hour, size=12, fill=SOFT))
    return svg(SIDE, SIDE, parts, label="the flashes and balls as the camera sees them")


def error_chart(facts: dict[str, Any]) -> Drawing:
    """Return the error that is to be expected against the number of flashes and the minutes that they take."""
    rows = [row for row in (*facts["flashes"], *facts["next_flashes"]) if row["error_median_deg"] is not None]
    numbers, errors = [row["number"] for row in rows], [row["error_median_deg"] for row in rows]
    wanted = [facts["accuracy_deg"]] if facts["accuracy_deg"] else []
    x = Axis.over([numbers], CHART.left, CHART.right, log=False)
    minutes = {row["number"]: row["minutes"] for row in rows}
    x.ticks[:] = [(float(n), f"{n}: {minutes[n]:.0f} min") for n in _spaced(numbers)]
    heights = [value for value in [*errors, *wanted] if value < 90] or [1.0]
    y = Axis.over([heights], CHART.bottom, CHART.top, log=True, unit="°")

    def shown(value: float) -> float:
        return y.at(min(max(value, 10**y.low), 10**y.high))

    parts = axes(x, y, CHART, x_title="flashes, and the minutes that they take", y_title="median error of the normals")
    places = ((x.at(n), shown(error)) for n, error in zip(numbers, errors, strict=True))
    parts.append(line(places, COLOURS[0], stroke_width=2.5))
    last = facts["flashes"][-1]
    if last["error_median_deg"] is not None:
        parts.append(circle(x.at(last["number"]), shown(last["error_median_deg"]), 6, COLOURS[0]))
    for error in wanted:
        level = [(CHART.left, y.at(error)), (CHART.right, y.at(error))]
        parts.append(line(level, WANTED, stroke_dasharray="6 4"))
        parts.append(text(CHART.right - 4, y.at(error) - 5, "wanted", "end", 12, WANTED))
    return svg(SIDE, 284, parts, label="error against flashes")


def _spaced(numbers: list[int]) -> list[int]:
    """Return at most six of the numbers, far enough from each other to be read."""
    found: list[int] = []
    for number in [n for n in TICKS if n in numbers]:
        if not found or number - found[-1] >= numbers[-1] / 7:
            found.append(number)
    return found

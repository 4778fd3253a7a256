"""Values with their uncertainty, real beside twin, one row a method: an SVG file."""

from collections.abc import Mapping
from html import escape

from compare.report.charts import COLOURS

WIDTH, LEFT, RIGHT, TOP, ROW = 720, 120, 120, 14, 34
SIGMAS = 2


def interval_chart(rows: Mapping[str, Mapping[str, tuple[float, float]]], *, x_title: str) -> str:
    """Return the SVG of values with bars of two sigma to either side.

    Parameters
    ----------
    rows : mapping of str to mapping of str to (value, sigma)
        By method, then by capture; the captures' names are the legend's.
    x_title : str
    """
    kinds = list(dict.fromkeys(kind for row in rows.values() for kind in row))
    ends = [value + SIGMAS * sigma for row in rows.values() for value, sigma in row.values()]
    end = 1.05 * max(ends, default=1.0) or 1.0
    bottom = TOP + ROW * len(rows)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {bottom + 46}" '
        'font-family="system-ui, sans-serif" font-size="13">',
        f'<rect width="{WIDTH}" height="{bottom + 46}" fill="white"/>',
    ]

    def x(value: float) -> float:
        return LEFT + max(value, 0.0) / end * (WIDTH - LEFT - RIGHT)

    step = next(one for one in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50) if end / one <= 8 or one == 50)
    for tick in range(int(end / step) + 1):
        parts.append(f'<path d="M{x(tick * step):.1f} {TOP}V{bottom}" stroke="#ddd"/>')
        parts.append(f'<text x="{x(tick * step):.1f}" y="{bottom + 17}" text-anchor="middle">{tick * step:g}</text>')
    for line, (name, row) in enumerate(rows.items()):
        middle = TOP + ROW * (line + 0.5)
        parts.append(f'<text x="{LEFT - 10}" y="{middle + 4:.1f}" text-anchor="end">{escape(name)}</text>')
        for number, kind in enumerate(kinds):
            if kind not in row:
                continue
            value, sigma = row[kind]
            y, colour = middle + 9 * (number - (len(kinds) - 1) / 2), COLOURS[number]
            low, high = x(value - SIGMAS * sigma), x(value + SIGMAS * sigma)
            parts.append(f'<path d="M{low:.1f} {y:.1f}H{high:.1f}" stroke="{colour}" stroke-width="2.5"/>')
            parts.append(f'<circle cx="{x(value):.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>')
    for number, kind in enumerate(kinds):
        at = TOP + 14 + 20 * number
        parts.append(f'<circle cx="{WIDTH - RIGHT + 20}" cy="{at - 4}" r="4" fill="{COLOURS[number]}"/>')
        parts.append(f'<text x="{WIDTH - RIGHT + 32}" y="{at}">{escape(kind)}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(f'<text x="{middle}" y="{bottom + 38}" text-anchor="middle">{escape(x_title)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"

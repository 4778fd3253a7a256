"""A line chart as an SVG file: a few lines, with their spread where there is one, for pages and the documentation."""

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np

from compare.report.charts import COLOURS

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 400, 64, 170, 20, 52
MOST_LETTERS = 12


def line_chart(
    lines: Mapping[str, tuple[Sequence[float], Sequence[float]]],
    *,
    x_title: str,
    y_title: str,
    log_x: bool = False,
    log_y: bool = False,
    spreads: Mapping[str, tuple[Sequence[float], Sequence[float]]] | None = None,
    x_names: Sequence[str] = (),
) -> str:
    """Return the SVG of named lines; the axes span the data.

    Parameters
    ----------
    lines : mapping of str to (x, y)
        A gap where y is NaN.
    x_title, y_title : str
    log_x, log_y : bool
    spreads : mapping of str to (low, high), optional
        Of lines, at their x: shaded.
    x_names : sequence of str
        Ticks of x = 0, 1, 2 ... by name, instead of numbers.
    """
    spreads = spreads or {}
    x_of, x_ticks = _axis([x for x, _ in lines.values()], LEFT, WIDTH - RIGHT, log_x)
    heights = [y for _, y in lines.values()] + [edge for spread in spreads.values() for edge in spread]
    y_of, y_ticks = _axis(heights, HEIGHT - BOTTOM, TOP, log_y)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="system-ui, sans-serif" font-size="13">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    x_named = list(enumerate(x_names)) or [(value, f"{value:g}") for value in x_ticks]
    for number, (value, name) in enumerate(x_named):
        x = x_of(value)
        parts.append(f'<path d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>')
        # Long names stand on two rows in turn.
        down = 14 if max(map(len, x_names), default=0) <= MOST_LETTERS else 12 + 13 * (number % 2)
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + down + 4}" text-anchor="middle"')
        parts[-1] += f"{_small(x_names)}>{escape(name)}</text>"
    for value in y_ticks:
        y = y_of(value)
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(f'<text x="{middle}" y="{HEIGHT - 8}" text-anchor="middle">{escape(x_title)}</text>')
    across = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(f'<text transform="translate(16 {across}) rotate(-90)" text-anchor="middle">{escape(y_title)}</text>')
    for number, (name, (x, _)) in enumerate(lines.items()):
        if name in spreads:
            low, high = spreads[name]
            known = [
                (x_of(a), y_of(b), y_of(c)) for a, b, c in zip(x, low, high, strict=True) if np.isfinite([b, c]).all()
            ]
            outline = [(a, c) for a, _, c in known] + [(a, b) for a, b, _ in reversed(known)]
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in outline)
            parts.append(f'<polygon points="{points}" fill="{_colour(number)}" fill-opacity="0.13"/>')
    for number, (name, (x, y)) in enumerate(lines.items()):
        colour = _colour(number)
        known = [(x_of(a), y_of(b)) for a, b in zip(x, y, strict=True) if np.isfinite(b)]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in known)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2.5"/>')
        at = TOP + 14 + 22 * number
        parts.append(f'<path d="M{WIDTH - RIGHT + 14} {at - 4}h22" stroke="{colour}" stroke-width="3"/>')
        parts.append(f'<text x="{WIDTH - RIGHT + 42}" y="{at}">{escape(name)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


def _colour(number: int) -> str:
    return COLOURS[number % len(COLOURS)]


def _small(names: Sequence[str]) -> str:
    return ' font-size="9"' if max(map(len, names), default=0) > MOST_LETTERS else ""


def _axis(values: Sequence[Sequence[float]], start: float, end: float, log: bool):
    """Return the function from a value to its place, and where ticks stand."""
    every = np.concatenate([np.asarray(v, float) for v in values])
    every = every[np.isfinite(every)]
    if not every.size:
        every = np.array([0.0, 1.0])
    if log:
        low, high = np.log10(every.min()), np.log10(every.max())
        decades = np.arange(np.floor(low), np.ceil(high) + 1)
        ticks = [float(f"{m * 10.0**d:.3g}") for d in decades for m in (1, 2, 5) if low <= np.log10(m) + d <= high]
        return (lambda value: start + (np.log10(value) - low) / (high - low) * (end - start)), ticks
    low, high = min(0.0, every.min()), every.max()
    high = max(high, low + 1e-9)
    step = 10.0 ** np.floor(np.log10((high - low) / 2))
    step = next(step * m for m in (0.5, 1, 2, 5) if (high - low) / (step * m) <= 7)
    ticks = [float(f"{v:.6g}") for v in np.arange(low, high + 1e-9 * step, step)]
    return (lambda value: start + (value - low) / (high - low) * (end - start)), ticks

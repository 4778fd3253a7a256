"""A line chart as an SVG file: a few lines on a logarithmic scale, for the documentation's pages."""

from collections.abc import Sequence
from html import escape

import numpy as np

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 720, 400, 64, 170, 20, 52


def line_chart(
    lines: dict[str, tuple[Sequence[float], Sequence[float]]],
    *,
    x_title: str,
    y_title: str,
    log_x: bool = False,
    log_y: bool = False,
) -> str:
    """Return the SVG of named lines, each (x, y); the axes span the data."""
    x_of, x_ticks = _axis([x for x, _ in lines.values()], LEFT, WIDTH - RIGHT, log_x)
    y_of, y_ticks = _axis([y for _, y in lines.values()], HEIGHT - BOTTOM, TOP, log_y)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        'font-family="system-ui, sans-serif" font-size="13">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
    ]
    for value in x_ticks:
        x = x_of(value)
        parts.append(f'<path d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>')
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{value:g}</text>')
    for value in y_ticks:
        y = y_of(value)
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(f'<text x="{middle}" y="{HEIGHT - 12}" text-anchor="middle">{escape(x_title)}</text>')
    across = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(f'<text transform="translate(16 {across}) rotate(-90)" text-anchor="middle">{escape(y_title)}</text>')
    for number, (name, (x, y)) in enumerate(lines.items()):
        colour = COLOURS[number % len(COLOURS)]
        points = " ".join(f"{x_of(a):.1f},{y_of(b):.1f}" for a, b in zip(x, y, strict=True))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2.5"/>')
        at = TOP + 14 + 22 * number
        parts.append(f'<path d="M{WIDTH - RIGHT + 14} {at - 4}h22" stroke="{colour}" stroke-width="3"/>')
        parts.append(f'<text x="{WIDTH - RIGHT + 42}" y="{at}">{escape(name)}</text>')
    return "\n".join([*parts, "</svg>"]) + "\n"


def _axis(values: Sequence[Sequence[float]], start: float, end: float, log: bool):
    """Return the function from a value to its place, and where ticks stand."""
    every = np.concatenate([np.asarray(v, float) for v in values])
    if log:
        low, high = np.log10(every.min()), np.log10(every.max())
        decades = np.arange(np.floor(low), np.ceil(high) + 1)
        ticks = [float(f"{m * 10.0**d:.3g}") for d in decades for m in (1, 2, 5) if low <= np.log10(m) + d <= high]
        return (lambda value: start + (np.log10(value) - low) / (high - low) * (end - start)), ticks
    low, high = min(0.0, every.min()), every.max()
    step = 10.0 ** np.floor(np.log10((high - low) / 2))
    step = next(step * m for m in (0.5, 1, 2, 5) if (high - low) / (step * m) <= 7)
    ticks = [float(f"{v:.6g}") for v in np.arange(low, high + 1e-9 * step, step)]
    return (lambda value: start + (value - low) / (high - low) * (end - start)), ticks

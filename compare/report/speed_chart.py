"""Speed against accuracy as one SVG: for the report and for the documentation's pages alike."""

from collections.abc import Sequence
from html import escape
from itertools import pairwise

import numpy as np

from compare.report.label_places import place_labels
from compare.report.speed import SpeedPoint, pareto_front

WIDTH, HEIGHT = 760, 470
LEFT, TOP, RIGHT, BOTTOM = 62.0, 14.0, 746.0, 372.0
"""The axes' frame, pixels."""
RADIUS = 6.0
FONT = 13
COLOURS = {"calibrated": "#0072B2", "uncalibrated": "#D55E00", "external": "#00795a"}
"""A second sign beside the shape; after [Okabe2008], the green darkened for thin outlines."""


def speed_chart(
    points: Sequence[SpeedPoint],
    *,
    label: str = "Time against median angular error",
    kinds: tuple[str, str] = ("photographs", "twin"),
    hollow: str = "the same method on the twin",
    is_twin_in_front: bool = False,
) -> str:
    """Return the chart, both axes logarithmic: left and low is better.

    Parameters
    ----------
    points : sequence of SpeedPoint
        At least one. A method's name stands once, beside its `real` point where it has one; its `twin` point is
        hollow and tied to it.
    label : str
        What the chart is, for who cannot see it.
    kinds : (str, str)
        What `real` and `twin` points are, in the words of who points at one.
    hollow : str
        Likewise of `twin`, in the legend.
    is_twin_in_front : bool
        The Pareto front is that of all points, not of the real ones.

    Returns
    -------
    str
        An <svg> that scales to its place. The dotted steps are the Pareto front of the real points (of all, if there is
        none): what no other method beats in both.
    """
    x_of, x_ticks = _axis([p.seconds for p in points], LEFT, RIGHT)
    y_of, y_ticks = _axis([p.median_deg for p in points], BOTTOM, TOP)
    at = {(p.method, p.kind): (x_of(p.seconds), y_of(p.median_deg)) for p in points}
    named = {p.method: p for p in sorted(points, key=lambda p: p.kind != "twin")}
    ties = [(at[name, "real"], at[name, "twin"]) for name in named if (name, "real") in at and (name, "twin") in at]
    front = pareto_front([p for p in points if p.kind == "real" or is_twin_in_front] or points)
    steps = _steps([at[p.method, p.kind] for p in front])
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(label)}" font-family="system-ui, \'DejaVu Sans\', sans-serif" font-size="{FONT}">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        *_axes(x_of, x_ticks, y_of, y_ticks),
    ]
    path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in steps)
    parts.append(f'<path d="{path}" fill="none" stroke="#777" stroke-width="1.5" stroke-dasharray="2 4"/>')
    for (x, y), (other_x, other_y) in ties:
        parts.append(f'<path d="M{x:.1f} {y:.1f}L{other_x:.1f} {other_y:.1f}" stroke="#aaa"/>')
    names = list(named)
    places = [at[name, named[name].kind] for name in names]
    sizes = [(_text_width(name) + 4, FONT + 3) for name in names]
    middles = place_labels(
        places,
        sizes,
        (LEFT + 2, TOP, RIGHT + 8, BOTTOM - 2),
        marks=list(at.values()),
        mark_radius=RADIUS,
        lines=[*ties, *pairwise(steps)],
    )
    for (x, y), middle, size in zip(places, middles, sizes, strict=True):
        parts += _leader(np.array([x, y]), middle, np.array(size) / 2)
    # Hollow marks first: where real and twin coincide the real one is to be seen.
    for point in sorted(points, key=lambda p: p.kind == "real"):
        words = f"{point.method}, {kinds[point.kind == 'twin']}: "
        words += f"{point.seconds:.3g} s per megapixel-image, median {point.median_deg:.2f}°"
        mark = _mark(*at[point.method, point.kind], point.family, hollow=point.kind == "twin")
        parts.append(f'<g class="{point.kind} {point.family}"><title>{escape(words)}</title>{mark}</g>')
    for name, (x, y) in zip(names, middles, strict=True):
        parts.append(
            f'<text class="name" x="{x:.1f}" y="{y + 0.36 * FONT:.1f}" text-anchor="middle" fill="#1d2329" '
            f'stroke="white" stroke-width="3" paint-order="stroke" stroke-linejoin="round">{escape(name)}</text>'
        )
    return "\n".join([*parts, *_legend(points, hollow), "</svg>"]) + "\n"


def _axis(values: list[float], start: float, end: float):
    """Return the function from a value to its place, at least half a decade wide with room around, and its ticks."""
    low, high = np.log10(min(values)), np.log10(max(values))
    room = max(0.12 * (high - low), (0.5 - (high - low)) / 2, 0.12)
    low, high = low - room, high + room
    digits = (1, 2, 5) if high - low < 3.2 else (1,)
    decades = range(int(np.floor(low)), int(np.ceil(high)) + 1)
    ticks = [float(f"{digit}e{decade}") for decade in decades for digit in digits]
    ticks = [tick for tick in ticks if low <= np.log10(tick) <= high]
    return (lambda value: float(start + (np.log10(value) - low) / (high - low) * (end - start))), ticks


def _axes(x_of, x_ticks, y_of, y_ticks) -> list[str]:
    parts = []
    for tick in x_ticks:
        parts.append(f'<path d="M{x_of(tick):.1f} {TOP}V{BOTTOM}" stroke="#e3e7ea"/>')
        parts.append(f'<text x="{x_of(tick):.1f}" y="{BOTTOM + 18}" text-anchor="middle" fill="#444">{tick:g}</text>')
    for tick in y_ticks:
        parts.append(f'<path d="M{LEFT} {y_of(tick):.1f}H{RIGHT}" stroke="#e3e7ea"/>')
        parts.append(f'<text x="{LEFT - 7}" y="{y_of(tick) + 4:.1f}" text-anchor="end" fill="#444">{tick:g}°</text>')
    parts.append(f'<path d="M{LEFT} {TOP}V{BOTTOM}H{RIGHT}" fill="none" stroke="#9aa5b0"/>')
    middle, across = (LEFT + RIGHT) / 2, (TOP + BOTTOM) / 2
    parts.append(f'<text x="{middle}" y="{BOTTOM + 38}" text-anchor="middle">seconds per megapixel-image</text>')
    parts.append(
        f'<text transform="translate(15 {across}) rotate(-90)" text-anchor="middle">median angular error (°)</text>'
    )
    return parts


def _steps(front: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of the front's steps: what a given time buys at best, up to the frame on both sides."""
    corners = [(front[0][0], TOP)]
    for x, y in front:
        corners += [(x, corners[-1][1]), (x, y)]
    return [*corners[1:], (RIGHT, front[-1][1])]


def _mark(x: float, y: float, family: str, *, hollow: bool) -> str:
    """Return a circle (calibrated), a square (uncalibrated) or a triangle (external)."""
    colour, r = COLOURS[family], RADIUS
    paint = f'fill="white" stroke="{colour}" stroke-width="2"' if hollow else f'fill="{colour}" stroke="white"'
    if family == "calibrated":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r}" {paint}/>'
    if family == "uncalibrated":
        return f'<rect x="{x - 0.9 * r:.1f}" y="{y - 0.9 * r:.1f}" width="{1.8 * r}" height="{1.8 * r}" {paint}/>'
    corners = f"{x:.1f},{y - 1.2 * r:.1f} {x + 1.15 * r:.1f},{y + 0.8 * r:.1f} {x - 1.15 * r:.1f},{y + 0.8 * r:.1f}"
    return f'<polygon points="{corners}" {paint}/>'


def _leader(point: np.ndarray, middle: np.ndarray, half: np.ndarray) -> list[str]:
    """Return a line from a name to its point where the two are apart."""
    edge = np.clip(point, middle - half, middle + half)
    if np.linalg.norm(edge - point) < 1.6 * RADIUS:
        return []
    return [f'<path d="M{edge[0]:.1f} {edge[1]:.1f}L{point[0]:.1f} {point[1]:.1f}" stroke="#555" stroke-width="0.8"/>']


def _legend(points: Sequence[SpeedPoint], hollow: str) -> list[str]:
    """Return what the marks mean; only those that are there."""
    items = [
        (family, _mark(0, 0, family, hollow=False)) for family in COLOURS if any(p.family == family for p in points)
    ]
    if any(p.kind == "twin" for p in points):
        family = items[0][0]
        items.append((f"hollow: {hollow}", _mark(0, 0, family, hollow=True)))
    dots = '<path d="M-10 0h20" stroke="#777" stroke-width="1.5" stroke-dasharray="2 4"/>'
    items.append(("Pareto front: no other is both faster and more accurate", dots))
    parts, x, y = [], LEFT + 8, BOTTOM + 64
    for words, mark in items:
        if x + 18 + _text_width(words) > RIGHT:
            x, y = LEFT + 8, y + 20
        parts.append(f'<g transform="translate({x:.0f} {y - 4})">{mark}</g>')
        parts.append(f'<text x="{x + 15:.0f}" y="{y}" fill="#444">{escape(words)}</text>')
        x += 15 + _text_width(words) + 22
    return parts


def _text_width(text: str) -> float:
    """Return the width of a text in pixels, rather too wide: the reader's font is not known."""
    wide = sum(letter.isupper() or letter in "mwMW@%" for letter in text)
    return FONT * (0.56 * len(text) + 0.2 * wide)

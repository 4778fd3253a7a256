"""Charts as SVG files, for pages and the documentation: lines with their spread, and values with their sigma."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

import numpy as np

from scene.figures import COLOURS

SIGMAS = 2
MOST_LETTERS = 12
"""Longer names of ticks are written small, and on two rows in turn."""
ROOM = 0.12
"""Share of a logarithmic axis, and decades at least, that are left free at either end."""
FEWEST_DECADES = 0.5
INK, GRID = "#444", "#e3e7ea"


class Frame(NamedTuple):
    """Where a chart's axes cross the page, pixels; y runs down."""

    left: float
    top: float
    right: float
    bottom: float


@dataclass(frozen=True)
class Axis:
    """From values to places in pixels; `low` and `high` are logarithms where `log`. `ticks`: (value, its name)."""

    low: float
    high: float
    start: float
    end: float
    log: bool
    ticks: list[tuple[float, str]]

    @classmethod
    def over(cls, values: Iterable[Sequence[float]], start: float, end: float, *, log: bool, unit: str = "") -> "Axis":
        """Return the axis that spans all values; from 0 on where it is linear and none is below."""
        every = np.concatenate([np.asarray(each, float) for each in values])
        every = every[np.isfinite(every)]
        low, high = (every.min(), every.max()) if every.size else (0.0, 1.0)
        if log:
            low, high = np.log10(low), np.log10(high)
            room = max(ROOM * (high - low), (FEWEST_DECADES - (high - low)) / 2, ROOM)
            low, high = low - room, high + room
            decades = range(int(np.floor(low)), int(np.ceil(high)) + 1)
            digits = (1, 2, 5) if high - low < 3.2 else (1,)
            ticks = [float(f"{digit}e{decade}") for decade in decades for digit in digits]
            ticks = [tick for tick in ticks if low <= np.log10(tick) <= high]
        else:
            low = min(0.0, low)
            high = max(high, low + 1e-9)
            step = 10.0 ** np.floor(np.log10((high - low) / 2))
            step = next(step * m for m in (0.5, 1, 2, 5) if (high - low) / (step * m) <= 7)
            ticks = [float(f"{k * step:.6g}") for k in range(int(np.ceil(low / step)), int(high / step + 1e-9) + 1)]
        return cls(float(low), float(high), start, end, log, [(tick, f"{tick:g}{unit}") for tick in ticks])

    def at(self, value: float) -> float:
        """Return a value's place."""
        value = np.log10(value) if self.log else value
        return float(self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start))


def svg(width: float, height: float, parts: Iterable[str], *, label: str = "chart") -> str:
    """Return a drawing on white that scales to its place; `label` is for who cannot see it."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{escape(label)}" font-family="system-ui, \'DejaVu Sans\', sans-serif" font-size="13">'
    )
    return "\n".join([head, f'<rect width="{width}" height="{height}" fill="white"/>', *parts, "</svg>"]) + "\n"


def axes(x: Axis, y: Axis, frame: Frame, *, x_title: str, y_title: str) -> list[str]:
    """Return the grid, its numbers or names, and what the axes show."""
    left, top, right, bottom = frame
    long = max((len(name) for _, name in x.ticks), default=0) > MOST_LETTERS
    parts = []
    for number, (tick, name) in enumerate(x.ticks):
        at, below = x.at(tick), bottom + 18 + (13 * (number % 2) - 2 if long else 0)
        parts.append(f'<path d="M{at:.1f} {top}V{bottom}" stroke="{GRID}"/>')
        parts.append(_text(at, below, name, "middle", f' font-size="9" fill="{INK}"' if long else f' fill="{INK}"'))
    for tick, name in y.ticks:
        parts.append(f'<path d="M{left} {y.at(tick):.1f}H{right}" stroke="{GRID}"/>')
        parts.append(_text(left - 7, y.at(tick) + 4, name, "end", f' fill="{INK}"'))
    parts.append(f'<path d="M{left} {top}V{bottom}H{right}" fill="none" stroke="#9aa5b0"/>')
    parts.append(_text((left + right) / 2, bottom + (44 if long else 38), x_title, "middle"))
    turn = f' transform="translate(15 {(top + bottom) / 2}) rotate(-90)"'
    return [*parts, _text(0, 0, y_title, "middle", turn)]


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
    frame = Frame(64, 20, 550, 348)
    x = Axis.over([x for x, _ in lines.values()], frame.left, frame.right, log=log_x)
    heights = [*(y for _, y in lines.values()), *(edge for spread in spreads.values() for edge in spread)]
    y = Axis.over(heights, frame.bottom, frame.top, log=log_y)
    if x_names:
        x.ticks[:] = [(float(place), name) for place, name in enumerate(x_names)]

    def points(places: Iterable[tuple[float, float]]) -> str:
        return " ".join(f"{x.at(a):.1f},{y.at(b):.1f}" for a, b in places if np.isfinite(b))

    colours = {name: COLOURS[number % len(COLOURS)] for number, name in enumerate(lines)}
    parts = axes(x, y, frame, x_title=x_title, y_title=y_title)
    for name, (low, high) in spreads.items():
        at = lines[name][0]
        outline = [*zip(at, high, strict=True), *reversed([*zip(at, low, strict=True)])]
        parts.append(f'<polygon points="{points(outline)}" fill="{colours[name]}" fill-opacity="0.13"/>')
    for name, pair in lines.items():
        line = points(zip(*pair, strict=True))
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colours[name]}" stroke-width="2.5"/>')
    return svg(720, 400, [*parts, *_legend(colours, frame)], label=f"{y_title} against {x_title}")


def interval_chart(rows: Mapping[str, Mapping[str, tuple[float, float]]], *, x_title: str) -> str:
    """Return the SVG of values with bars of `SIGMAS` sigma to either side, one row a method.

    `rows`: by method, then by capture, (value, sigma); the captures' names are the legend's.
    """
    frame = Frame(120, 14, 600, 14 + 34 * len(rows))
    colours = dict(zip(dict.fromkeys(kind for row in rows.values() for kind in row), COLOURS, strict=False))
    ends = [value + SIGMAS * sigma for row in rows.values() for value, sigma in row.values()]
    x = Axis.over([[1.05 * end for end in ends]], frame.left, frame.right, log=False)
    names = [(line + 0.5, name) for line, name in enumerate(rows)]
    y = Axis(0, len(rows), frame.top, frame.bottom, False, names)
    parts = axes(x, y, frame, x_title=x_title, y_title="")
    for line, row in enumerate(rows.values()):
        for number, (kind, colour) in enumerate(colours.items()):
            if kind not in row:
                continue
            value, sigma = row[kind]
            middle = y.at(line + 0.5) + 9 * (number - (len(colours) - 1) / 2)
            low, high = (x.at(max(value + sign * SIGMAS * sigma, 0.0)) for sign in (-1, 1))
            parts.append(f'<path d="M{low:.1f} {middle:.1f}H{high:.1f}" stroke="{colour}" stroke-width="2.5"/>')
            parts.append(f'<circle cx="{x.at(value):.1f}" cy="{middle:.1f}" r="4" fill="{colour}"/>')
    return svg(720, frame.bottom + 46, [*parts, *_legend(colours, frame)], label=x_title)


def _legend(colours: Mapping[str, str], frame: Frame) -> list[str]:
    """Return the names beside their colours, right of the frame."""
    parts = []
    for number, (name, colour) in enumerate(colours.items()):
        at = frame.top + 14 + 22 * number
        parts.append(f'<path d="M{frame.right + 14} {at - 4}h22" stroke="{colour}" stroke-width="3"/>')
        parts.append(_text(frame.right + 42, at, name, "start"))
    return parts


def _text(x: float, y: float, words: str, anchor: str, more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{more}>{escape(words)}</text>'

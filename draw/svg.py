"""The pieces of every drawing: shapes, words, axes, a legend; all text is escaped."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape, unescape
from typing import NamedTuple

import numpy as np

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000")
"""Told apart by colour-blind eyes too [Okabe2008]."""
INK, GRID, EDGE = "#444", "#e3e7ea", "#9aa5b0"
ROOM, HEADROOM = 0.25, 0.04
"""Decades that are left free at either end of a logarithmic axis; share of a linear one at its upper end."""


class Drawing(str):
    """An SVG as text; notebooks show it, and templates put it in as it is."""

    __slots__ = ()

    def _repr_svg_(self) -> str:
        return str(self)

    __html__ = _repr_svg_

    def __repr__(self) -> str:
        return "drawing: " + unescape(self.partition('aria-label="')[2].partition('"')[0])


def svg(width: float, height: float, parts: Iterable[str], *, label: str = "chart") -> Drawing:
    """Return a drawing on white that scales to its place; `label` is for who cannot see it."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" '
        f'aria-label="{escape(label)}" font-family="system-ui, \'DejaVu Sans\', sans-serif" font-size="13">'
    )
    paper = f'<rect width="{width}" height="{height}" fill="white"/>'
    return Drawing("\n".join([head, paper, *filter(None, parts), "</svg>"]) + "\n")


def shape(name: str, words: str = "", content: str = "", /, **values: float | str) -> str:
    """Return an element with its attributes; `words` is what is told when one points at it, `content` what it shows.

    Numbers have one decimal; of an attribute's name, _ stands for -.
    """
    told = f"<title>{escape(words)}</title>" if words else escape(content)
    pairs = ((key.rstrip("_").replace("_", "-"), value) for key, value in values.items())
    listed = " ".join(f'{key}="{escape(value) if isinstance(value, str) else _number(value)}"' for key, value in pairs)
    return f"<{name} {listed}>{told}</{name}>" if told else f"<{name} {listed}/>"


def circle(x: float, y: float, radius: float, fill: str, words: str = "", **more: float | str) -> str:
    """Return a disc."""
    return shape("circle", words, cx=x, cy=y, r=radius, fill=fill, **more)


def line(points: Iterable[tuple[float, float]], stroke: str = "none", words: str = "", **more: float | str) -> str:
    """Return a line through points; what is not a number is left out."""
    path = "L".join(f"{u:.1f} {v:.1f}" for u, v in points if np.isfinite(u + v))
    return shape("path", words, d=f"M{path}", **({"fill": "none", "stroke": stroke} | more)) if path else ""


def text(x: float, y: float, words: str, anchor: str = "middle", size: float = 13, fill: str = INK, **more: str) -> str:
    """Return words on a base line; `anchor`: start, middle or end."""
    return shape("text", "", words, x=x, y=y, text_anchor=anchor, font_size=size, fill=fill, **more)


def text_width(words: str) -> float:
    """Return the width of a text in pixels, rather too wide: the reader's font is not known."""
    wide = sum(letter.isupper() or letter in "mwMW@%" for letter in words)
    return 13 * (0.56 * len(words) + 0.2 * wide)


def _number(value: float) -> str:
    return f"{value:.1f}".removesuffix(".0")


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
            low, high = np.log10(low) - ROOM, np.log10(high) + ROOM
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
            # The last mark is not cut by the frame.
            high += HEADROOM * (high - low)
        return cls(float(low), float(high), start, end, log, [(tick, f"{tick:g}{unit}") for tick in ticks])

    def at(self, value: float) -> float:
        """Return a value's place."""
        value = np.log10(value) if self.log else value
        return float(self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start))


class Axes(NamedTuple):
    """A chart's axes, which frame it; pixels' y runs down."""

    x: Axis
    y: Axis

    def line(self, points: Iterable[tuple[float, float]], stroke: str, words: str = "", **more: float | str) -> str:
        """Return a line through values."""
        return line(((self.x.at(u), self.y.at(v)) for u, v in points), stroke, words, **more)

    def drawn(self, x_title: str = "", y_title: str = "") -> list[str]:
        """Return the grid, its numbers or names, and what the axes show."""
        (left, right), (bottom, top) = ((axis.start, axis.end) for axis in self)
        # Such names are written small, and on two rows in turn.
        long = max((len(name) for _, name in self.x.ticks), default=0) > 12
        parts = []
        for number, (tick, name) in enumerate(self.x.ticks):
            at, below = self.x.at(tick), bottom + 18 + (13 * (number % 2) - 2 if long else 0)
            parts += [line([(at, top), (at, bottom)], GRID), text(at, below, name, size=9 if long else 13)]
        for tick, name in self.y.ticks:
            at = self.y.at(tick)
            parts += [line([(left, at), (right, at)], GRID), text(left - 7, at + 4, name, "end")]
        parts.append(line([(left, top), (left, bottom), (right, bottom)], EDGE))
        parts.append(text((left + right) / 2, bottom + (44 if long else 38), x_title, fill="#000") if x_title else "")
        turn = f"translate({left - 49:g} {(top + bottom) / 2:g}) rotate(-90)"
        return [*parts, text(0, 0, y_title, fill="#000", transform=turn) if y_title else ""]


def legend(colours: Mapping[str, str], x: float, y: float) -> tuple[list[str], float]:
    """Return names beside their colours, one below the other, the first at (x, y), and where they end on the right."""
    parts = []
    for number, (name, colour) in enumerate(colours.items()):
        at = y + 22 * number
        parts.append(line([(x, at - 4), (x + 22, at - 4)], colour, stroke_width=3))
        parts.append(text(x + 28, at, name, "start", fill="#000"))
    return parts, x + 28 + max(map(text_width, colours), default=0.0)

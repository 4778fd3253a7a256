"""Speed against accuracy, out of a summary, as one SVG for pages and the documentation: a name beside each mark."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from compare.report.facts import Summary, family
from compare.report.page import is_number
from draw.line_chart import Axis, Frame, axes, svg

Array = NDArray[np.float64]

FRAME = Frame(62.0, 14.0, 746.0, 372.0)
RADIUS = 6.0
FONT = 13
COLOURS = {"calibrated": "#0072B2", "uncalibrated": "#D55E00", "external": "#00795a"}
"""A second sign beside the shape; after [Okabe2008], the green darkened for thin outlines."""
DOTS = 'fill="none" stroke="#777" stroke-width="1.5" stroke-dasharray="2 4"'
"""The Pareto front's line."""
GAPS = (7.0, 16.0, 28.0, 42.0, 58.0, 78.0, 100.0, 130.0, 165.0)
"""Distances, pixels, between a point and its name that are tried, in 24 directions."""
MOST_ROUNDS = 12
_OVERLAP, _OUTSIDE, _ON_MARK, _ON_LINE, _FOREIGN = 1e6, 1e6, 400.0, 40.0, 120.0


@dataclass(frozen=True)
class SpeedPoint:
    """One method on the photographs (`kind` real) or on their twin.

    `family`: of `facts.family`. `seconds`: processor seconds for a million pixels of one frame, of this kind's own
    solving.
    `median_deg`: median angular error against the ground truth.
    """

    method: str
    family: str
    kind: str
    seconds: float
    median_deg: float


def seconds_per_megapixel_image(row: Summary, kind: str) -> float | None:
    """Return a method's processor seconds for a million pixels of one frame; `row` of summary's solve.methods."""
    if kind == "real":
        seconds = row.get("processor_seconds_per_megapixel_image")
        return seconds if is_number(seconds) else None
    seconds, megapixels, frames = row.get("twin_processor_seconds"), row.get("megapixels"), row.get("frames")
    if is_number(seconds) and is_number(megapixels) and is_number(frames) and megapixels * frames > 0:
        return seconds / (megapixels * frames)
    return None


def speed_points(summary: Summary) -> tuple[list[SpeedPoint], list[tuple[str, str]]]:
    """Return what can be charted, and what cannot: (method, why), every method in one of the two or in both.

    `summary` is as in summary.json; of it solve.methods and compare.
    """
    compared, solved = summary.get("compare") or {}, (summary.get("solve") or {}).get("methods") or {}
    errors = compared.get("methods") or {}
    any_twin = any((row or {}).get("twin") for row in errors.values())
    points, missing = [], []
    for method in dict.fromkeys([*solved, *errors]):
        row, error = solved.get(method) or {}, errors.get(method) or {}
        for kind, words in (("real", ""), ("twin", " on the twin")):
            median, seconds = (error.get(kind) or {}).get("median_deg"), seconds_per_megapixel_image(row, kind)
            if is_number(median) and is_number(seconds) and min(median, seconds) > 0:
                points.append(SpeedPoint(method, family(method), kind, seconds, median))
            elif kind == "twin" and not any_twin:
                continue
            elif not compared.get("has_truth"):
                missing.append((method, "there is no ground truth to tell an error"))
            elif not is_number(median):
                missing.append((method, f"no normal{words} where the truth is known"))
            elif not is_number(seconds):
                missing.append((method, f"no time{words} is in the summary"))
            else:
                missing.append((method, f"a median error or a time{words} of zero has no place on logarithmic axes"))
    return points, missing


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
    x = Axis.over([[p.seconds for p in points]], FRAME.left, FRAME.right, log=True)
    y = Axis.over([[p.median_deg for p in points]], FRAME.bottom, FRAME.top, log=True, unit="°")
    at = {(p.method, p.kind): (x.at(p.seconds), y.at(p.median_deg)) for p in points}
    named = {p.method: at[p.method, p.kind] for p in sorted(points, key=lambda p: p.kind != "twin")}
    ties = [(at[name, "real"], at[name, "twin"]) for name in named if (name, "real") in at and (name, "twin") in at]
    front = pareto_front([p for p in points if p.kind == "real" or is_twin_in_front] or points)
    steps = _steps([at[p.method, p.kind] for p in front])
    parts = axes(x, y, FRAME, x_title="processor seconds per megapixel-image", y_title="median angular error (°)")
    parts.append(f'<path d="M{"L".join(f"{u:.1f} {v:.1f}" for u, v in steps)}" {DOTS}/>')
    parts += [f'<path d="M{u:.1f} {v:.1f}L{s:.1f} {t:.1f}" stroke="#aaa"/>' for (u, v), (s, t) in ties]
    sizes = np.array([(_text_width(name) + 4, FONT + 3) for name in named])
    room = (FRAME.left + 2, FRAME.top, FRAME.right + 8, FRAME.bottom - 2)
    lines = [*ties, *pairwise(steps)]
    middles = place_labels([*named.values()], sizes, room, marks=[*at.values()], mark_radius=RADIUS, lines=lines)
    for place, middle, size in zip(named.values(), middles, sizes, strict=True):
        # A line from the name to its point where the two are apart.
        edge = np.clip(place, middle - size / 2, middle + size / 2)
        if np.linalg.norm(edge - place) >= 1.6 * RADIUS:
            line = f"M{edge[0]:.1f} {edge[1]:.1f}L{place[0]:.1f} {place[1]:.1f}"
            parts.append(f'<path d="{line}" stroke="#555" stroke-width="0.8"/>')
    # Hollow marks first: where real and twin coincide the real one is to be seen.
    for point in sorted(points, key=lambda p: p.kind == "real"):
        words = f"{point.method}, {kinds[point.kind == 'twin']}: "
        words += f"{point.seconds:.3g} processor s per megapixel-image, median {point.median_deg:.2f}°"
        mark = _mark(*at[point.method, point.kind], point.family, hollow=point.kind == "twin")
        parts.append(f'<g class="{point.kind} {point.family}"><title>{escape(words)}</title>{mark}</g>')
    for name, (u, v) in zip(named, middles, strict=True):
        parts.append(
            f'<text class="name" x="{u:.1f}" y="{v + 0.36 * FONT:.1f}" text-anchor="middle" fill="#1d2329" '
            f'stroke="white" stroke-width="3" paint-order="stroke" stroke-linejoin="round">{escape(name)}</text>'
        )
    return svg(760, 470, [*parts, *_legend(points, hollow)], label=label)


def pareto_front(points: Sequence[SpeedPoint]) -> list[SpeedPoint]:
    """Return the points, fastest first, for which none is both at least as fast and at least as accurate."""
    front: list[SpeedPoint] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.median_deg)):
        if not front or point.median_deg < front[-1].median_deg:
            front.append(point)
    return front


def _steps(front: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the corners of the front's steps: what a given time buys at best, up to the frame on both sides."""
    corners = [(front[0][0], FRAME.top)]
    for x, y in front:
        corners += [(x, corners[-1][1]), (x, y)]
    return [*corners[1:], (FRAME.right, front[-1][1])]


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


def _legend(points: Sequence[SpeedPoint], hollow: str) -> list[str]:
    """Return what the marks mean; only those that are there."""
    families = [family for family in COLOURS if any(p.family == family for p in points)]
    items = [(family, _mark(0, 0, family, hollow=False)) for family in families]
    if any(p.kind == "twin" for p in points):
        items.append((f"hollow: {hollow}", _mark(0, 0, families[0], hollow=True)))
    items.append(("Pareto front: no other is both faster and more accurate", f'<path d="M-10 0h20" {DOTS}/>'))
    parts, x, y = [], FRAME.left + 8, FRAME.bottom + 64
    for words, mark in items:
        if x + 18 + _text_width(words) > FRAME.right:
            x, y = FRAME.left + 8, y + 20
        parts.append(f'<g transform="translate({x:.0f} {y - 4})">{mark}</g>')
        parts.append(f'<text x="{x + 15:.0f}" y="{y}" fill="#444">{escape(words)}</text>')
        x += 15 + _text_width(words) + 22
    return parts


def _text_width(text: str) -> float:
    """Return the width of a text in pixels, rather too wide: the reader's font is not known."""
    wide = sum(letter.isupper() or letter in "mwMW@%" for letter in text)
    return FONT * (0.56 * len(text) + 0.2 * wide)


def place_labels(
    points: ArrayLike,
    sizes: ArrayLike,
    room: tuple[float, float, float, float],
    *,
    marks: ArrayLike,
    mark_radius: float,
    lines: ArrayLike = (),
) -> Array:
    """Return the middles (N, 2) of the names, (N, 2) wide and high, of points (N, 2): none on another, all in `room`.

    Names avoid all marks (M, 2) and, where they can, straight lines (K, 2, 2). Each in turn takes the cheapest of the
    places around its point while the others stand, until none moves; only where the room (left, top, right, bottom)
    is too full for them all does one lie on another.
    """
    points, sizes, marks = (np.asarray(each, float).reshape(-1, 2) for each in (points, sizes, marks))
    # Points of a line close enough together that no name slips between them.
    steps = np.linspace(0, 1, 80)[:, None]
    dots = np.concatenate([np.empty((0, 2)), *(a + steps * (b - a) for a, b in np.asarray(lines, float))])
    # Right and left first, as one reads.
    angle = np.arange(24) * 2 * np.pi / 24
    around, gap = np.tile(np.stack([np.cos(angle), -np.sin(angle)], -1), (len(GAPS), 1)), np.repeat(GAPS, 24)
    places, costs = [], []
    for point, half in zip(points, sizes / 2, strict=True):
        place = point + around * (half + gap[:, None])
        # From a name's box to each mark, and to its own point.
        aside = np.linalg.norm(np.maximum(np.abs(place[:, None] - marks) - half, 0), axis=-1)
        own = np.linalg.norm(np.maximum(np.abs(place - point) - half, 0), axis=-1)
        foreign = np.linalg.norm(marks - point, axis=1) > 1e-6
        outside = (place - half < room[:2]).any(1) | (place + half > room[2:]).any(1)
        cost = gap + _OUTSIDE * outside + _ON_MARK * (aside < mark_radius + 1).sum(1)
        # A name that stands nearer to another mark than to its own would be read as the other's.
        cost += _FOREIGN * (aside[:, foreign] < own[:, None]).any(1)
        costs.append(cost + _ON_LINE * (np.abs(place[:, None] - dots) < half).all(-1).any(1))
        places.append(place)
    # The most crowded choose first.
    distances = np.linalg.norm(points[:, None] - points, axis=-1)
    order = np.argsort(np.sort(distances, axis=1)[:, : min(len(points), 5)].sum(1), kind="stable")
    middles = np.full_like(points, np.nan)
    for _ in range(MOST_ROUNDS):
        before = middles.copy()
        for i in order:
            others = np.isfinite(middles[:, 0]) & (np.arange(len(points)) != i)
            over = (np.abs(places[i][:, None] - middles[others]) < (sizes[i] + sizes[others]) / 2).all(-1).sum(1)
            middles[i] = places[i][np.argmin(costs[i] + _OVERLAP * over)]
        if np.array_equal(before, middles):
            break
    return middles

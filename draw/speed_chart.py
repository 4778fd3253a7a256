"""Speed against accuracy: each method where it stands, its name beside it, and what no other method beats."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from draw.readable import readable
from draw.svg import Axes, Axis, Drawing, circle, line, shape, svg, text, text_width

Array = NDArray[np.float64]
Place = tuple[float, float]

LEFT, TOP, RIGHT, BOTTOM = 62.0, 14.0, 746.0, 372.0
"""Of the axes, pixels."""
RADIUS = 6.0
FONT = 13
COLOURS = {"calibrated": "#0072B2", "uncalibrated": "#D55E00", "external": "#00795a"}
"""A second sign beside the shape; after [Okabe2008], the green darkened for thin outlines."""
FRONT = {"stroke_width": 1.5, "stroke_dasharray": "2 4"}
GAP = 8.0
"""Pixels between a point and its name."""


@dataclass(frozen=True)
class SpeedPoint:
    """One method on the photographs (`kind` real) or on their twin.

    `family`: a key of `COLOURS`. `seconds`: processor seconds for a million pixels of one frame, of this kind's own
    solving.
    `median_deg`: median angular error against the ground truth.
    """

    method: str
    family: str
    kind: str
    seconds: float
    median_deg: float


def speed_chart(
    points: Sequence[SpeedPoint],
    *,
    label: str = "Time against median angular error",
    kinds: tuple[str, str] = ("photographs", "twin"),
) -> Drawing:
    """Return the chart, both axes logarithmic: left and low is better.

    Parameters
    ----------
    points : sequence of SpeedPoint
        At least one. A method's name stands once, beside its `real` point where it has one; its `twin` point is
        hollow and tied to it.
    label : str
        What the chart is, for who cannot see it.
    kinds : (str, str)
        What `real` and `twin` points are, in words.

    Notes
    -----
    The dotted steps are the Pareto front of the real points (of all, if there is none): what no other method beats in
    both.
    """
    x = Axis.over([[p.seconds for p in points]], LEFT, RIGHT, log=True)
    y = Axis.over([[p.median_deg for p in points]], BOTTOM, TOP, log=True, unit="°")
    at = {(p.method, p.kind): (x.at(p.seconds), y.at(p.median_deg)) for p in points}
    named = {p.method: at[p.method, p.kind] for p in sorted(points, key=lambda p: p.kind != "twin")}
    ties = [(at[name, "real"], at[name, "twin"]) for name in named if (name, "real") in at and (name, "twin") in at]
    front = pareto_front([p for p in points if p.kind == "real"] or points)
    parts = Axes(x, y).drawn("processor seconds per megapixel-image", "median angular error (°)")
    parts.append(line(_steps([at[p.method, p.kind] for p in front]), "#777", **FRONT))
    parts += [line(tie, "#aaa") for tie in ties]
    sizes = np.array([(text_width(name) + 4, FONT + 3) for name in named])
    middles = place_labels(np.array([*named.values()]), sizes, np.array([*at.values()]))
    for place, middle, size in zip(named.values(), middles, sizes, strict=True):
        # A line from the name to its point where the two are apart.
        edge = np.clip(place, middle - size / 2, middle + size / 2)
        if np.linalg.norm(edge - place) >= 1.6 * RADIUS:
            parts.append(line([(edge[0], edge[1]), place], "#555", stroke_width=0.8))
    # Hollow marks first: where real and twin coincide the real one is to be seen.
    for point in sorted(points, key=lambda p: p.kind == "real"):
        words = f"{point.method}, {kinds[point.kind == 'twin']}: "
        words += f"{readable(point.seconds, 3)} processor s per megapixel-image, median {readable(point.median_deg)}°"
        parts.append(_mark(*at[point.method, point.kind], point.family, words, hollow=point.kind == "twin"))
    halo = {"class": "name", "stroke": "white", "stroke_width": "3", "paint_order": "stroke"}
    for name, (u, v) in zip(named, middles, strict=True):
        parts.append(text(u, v + 0.36 * FONT, name, size=FONT, fill="#1d2329", **halo))
    return svg(760, 470, [*parts, *_legend(points, kinds[1])], label=label)


def pareto_front(points: Sequence[SpeedPoint]) -> list[SpeedPoint]:
    """Return the points, fastest first, for which none is both at least as fast and at least as accurate."""
    front: list[SpeedPoint] = []
    for point in sorted(points, key=lambda p: (p.seconds, p.median_deg)):
        if not front or point.median_deg < front[-1].median_deg:
            front.append(point)
    return front


def _steps(front: list[Place]) -> list[Place]:
    """Return the corners of the front's steps: what a given time buys at best, up to the frame on both sides."""
    corners = [(front[0][0], TOP)]
    for x, y in front:
        corners += [(x, corners[-1][1]), (x, y)]
    return [*corners[1:], (RIGHT, front[-1][1])]


def _mark(x: float, y: float, family: str, words: str = "", *, hollow: bool) -> str:
    """Return a circle (calibrated), a square (uncalibrated) or a triangle (external)."""
    colour, r = COLOURS[family], RADIUS
    paint = {"fill": "white", "stroke": colour, "stroke_width": 2} if hollow else {"fill": colour, "stroke": "white"}
    if family == "calibrated":
        return circle(x, y, r, words=words, **paint)
    if family == "uncalibrated":
        return shape("rect", words, x=x - 0.9 * r, y=y - 0.9 * r, width=1.8 * r, height=1.8 * r, **paint)
    corners = [(x, y - 1.2 * r), (x + 1.15 * r, y + 0.8 * r), (x - 1.15 * r, y + 0.8 * r), (x, y - 1.2 * r)]
    return line(corners, words=words, **paint)


def _legend(points: Sequence[SpeedPoint], hollow: str) -> list[str]:
    """Return what the marks mean; only those that are there."""
    families = [family for family in COLOURS if any(p.family == family for p in points)]
    items = [(family, _mark(0, 0, family, hollow=False)) for family in families]
    if any(p.kind == "twin" for p in points):
        items.append((f"hollow: {hollow}", _mark(0, 0, families[0], hollow=True)))
    front = line([(-10, 0), (20, 0)], "#777", **FRONT)
    rows = [items, [("Pareto front: no other is both faster and more accurate", front)]]
    placed = (
        (LEFT + 8 + 170 * i, BOTTOM + 64 + 20 * j, *item) for j, row in enumerate(rows) for i, item in enumerate(row)
    )
    return [
        f'<g transform="translate({x:.0f} {y - 4})">{mark}</g>' + text(x + 24, y, words, "start")
        for x, y, words, mark in placed
    ]


def place_labels(points: Array, sizes: Array, marks: Array) -> Array:
    """Return the middles (N, 2) of the names, (N, 2) wide and high, of points (N, 2): beside them, none on another.

    Each in turn, from top to bottom, takes the free place nearest to its point, right or left of it, higher or lower,
    off names and marks (M, 2); all lie in the chart.
    """
    left, top, right, bottom = LEFT + 2, TOP, RIGHT + 8, BOTTOM - 2
    middles, taken = np.empty_like(points, float), [np.array([*mark, 2 * RADIUS, 2 * RADIUS]) for mark in marks]
    for i in np.argsort(points[:, 1], kind="stable"):
        (u, v), (wide, high) = points[i], sizes[i]
        aside = [u + side * (wide / 2 + GAP) for side in (1, -1)]
        aside = [x for x in aside if left <= x - wide / 2 and x + wide / 2 <= right] or aside
        rows = sorted(np.arange(top + high / 2, bottom - high / 2, 2.0), key=lambda y: abs(y - v))
        tried = np.array([(x, y) for y in rows for x in aside])
        boxes = np.array(taken)
        is_on = (np.abs(tried[:, None] - boxes[:, :2]) < (sizes[i] + boxes[:, 2:]) / 2).all(-1)
        middles[i] = tried[np.argmin(is_on.sum(1))]
        taken.append(np.array([*middles[i], *sizes[i]]))
    return middles

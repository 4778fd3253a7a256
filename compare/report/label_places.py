"""Where the names of points stand in a drawing, so that each can be read."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

GAPS = (7.0, 16.0, 28.0, 42.0, 58.0, 78.0, 100.0, 130.0, 165.0)
"""Distances, pixels, between a point and its name that are tried."""
DIRECTIONS = 24
MOST_ROUNDS = 12
_OVERLAP, _OUTSIDE, _ON_MARK, _ON_LINE, _FOREIGN = 1e6, 1e6, 400.0, 40.0, 120.0


def place_labels(
    points: ArrayLike,
    sizes: ArrayLike,
    frame: tuple[float, float, float, float],
    *,
    marks: ArrayLike,
    mark_radius: float,
    lines: ArrayLike = (),
) -> Array:
    """Return the middles of the points' names, (N, 2) pixels: beside their points and never on each other.

    Parameters
    ----------
    points : (N, 2)
        Where the points are, x and y down.
    sizes : (N, 2)
        Width and height of each name.
    frame : (left, top, right, bottom)
        Names stay inside.
    marks : (M, 2)
        Everything that is drawn as a mark, the points among them; names avoid them.
    mark_radius : float
    lines : (K, 2, 2)
        Ends of straight lines that names avoid where they can.

    Notes
    -----
    Each name in turn takes the cheapest of the places around its point while the others stand, until none moves. A name
    on another costs more than anything: it happens only where the frame is too full for them all.
    """
    points, sizes = np.asarray(points, float).reshape(-1, 2), np.asarray(sizes, float).reshape(-1, 2)
    marks, lines = np.asarray(marks, float).reshape(-1, 2), np.asarray(lines, float).reshape(-1, 2, 2)
    # Points of a line close enough together that no name slips between them.
    steps = np.linspace(0, 1, 80)[:, None]
    dots = np.concatenate([a + steps * (b - a) for a, b in lines]) if len(lines) else np.empty((0, 2))
    places = [_places(point, size) for point, size in zip(points, sizes, strict=True)]
    fixed = [
        _fixed_cost(place, gap, size, point, frame, marks, mark_radius, dots)
        for (place, gap), size, point in zip(places, sizes, points, strict=True)
    ]
    # The most crowded choose first.
    distances = np.linalg.norm(points[:, None] - points, axis=-1)
    order = np.argsort(np.sort(distances, axis=1)[:, : min(len(points), 5)].sum(1), kind="stable")
    middles = np.full_like(points, np.nan)
    for _ in range(MOST_ROUNDS):
        moved = False
        for i in order:
            others = np.isfinite(middles[:, 0])
            others[i] = False
            place = places[i][0]
            room = (sizes[i] + sizes[others]) / 2
            over = (np.abs(place[:, None] - middles[others]) < room).all(-1).sum(1)
            best = place[np.argmin(fixed[i] + _OVERLAP * over)]
            moved = moved or not np.array_equal(best, middles[i])
            middles[i] = best
        if not moved:
            break
    return middles


def _places(point: Array, size: Array) -> tuple[Array, Array]:
    """Return the places around a point and how far each keeps from it; right and left first, as one reads."""
    angle = np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    around = np.stack([np.cos(angle), -np.sin(angle)], -1)
    gap = np.repeat(GAPS, DIRECTIONS)
    middle = point + np.tile(around, (len(GAPS), 1)) * (size / 2 + gap[:, None])
    return middle, gap


def _fixed_cost(place, gap, size, point, frame, marks, mark_radius, dots) -> Array:
    """Return what each place costs whatever the other names do."""
    left, top, right, bottom = frame
    half = size / 2
    outside = (place - half < [left, top]).any(1) | (place + half > [right, bottom]).any(1)
    # Distance from a name's box to each mark.
    aside = np.linalg.norm(np.maximum(np.abs(place[:, None] - marks) - half, 0), axis=-1)
    own = np.linalg.norm(np.maximum(np.abs(place - point) - half, 0), axis=-1)
    foreign = np.linalg.norm(marks - point, axis=1) > 1e-6
    on_line = (np.abs(place[:, None] - dots) < half).all(-1).any(1) if len(dots) else 0.0
    return (
        gap
        + _OUTSIDE * outside
        + _ON_MARK * (aside < mark_radius + 1).sum(1)
        # A name that stands nearer to another mark than to its own would be read as the other's.
        + _FOREIGN * (aside[:, foreign] < own[:, None]).any(1)
        + _ON_LINE * on_line
    )

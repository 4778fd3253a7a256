"""The edges beside a circle that stand still, and the outline on which most of them agree.

Offsets are measured along the outline's normals, and the three numbers of `Sphere` (center_px, radius_px) move until
the offsets vanish. Shadows and mirrored things that cross the outline are outvoted: they lie elsewhere in other
frames, or on a short arc.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]
EDGE_NOISES = 5.0
"""An edge must exceed the derivative's noise by this factor."""


@dataclass(frozen=True)
class Edges:
    """K edges across an outline, in whichever frame.

    Parameters
    ----------
    point : (K,) intp
        Number of the outline's point.
    offset, weight : (K,) float64
        Outward of the outline, px; 1 for the best.
    prominence : (K,) float64
        0 to 1, less for what is faint in its own frame.
    """

    point: NDArray[np.intp]
    offset: Array
    weight: Array
    prominence: Array


@dataclass(frozen=True)
class Agreement:
    """An outline on which edges agree: its shift from the start, how much of it is seen, and their spread, px."""

    shift: Array
    score: float
    spread: float


def kernel_reach_px(softness: float) -> float:
    """Return how far beyond the offsets searched the strips must go."""
    return 4.0 * softness


def find_edges(
    strips: NDArray[np.float32], offsets: Array, spacing_px: float, *, softness: float, search_px: float
) -> Edges | None:
    """Find the edges in strips (F, N, M) across an outline; None where there are too few.

    Parameters
    ----------
    strips : (F, N, M) float32
        NaN where nothing is known.
    offsets : (M,) float64
        Evenly spaced, px.
    spacing_px : float
        Between neighbouring points of the outline.
    softness : float
        Scale of the edges: 1 for a sharp picture.
    search_px : float
        Edges farther away are not looked at.
    """
    step = offsets[1] - offsets[0]
    unit = np.eye(len(offsets))
    # Less what a wider kernel sees: a step stays, the ball's own shading and a soft shadow go.
    narrow = gaussian_filter1d(unit, 0.8 * softness / step, axis=0, order=1) / step
    kernel = narrow - gaussian_filter1d(unit, 2.4 * softness / step, axis=0, order=1) / step
    known = np.isfinite(strips)
    values = np.where(known, strips, 0)
    margin = max(1, round(1.6 * softness / step))
    holes = gaussian_filter1d((~known).astype(np.float32), margin, axis=2) > 0.02
    slope = values @ kernel.T.astype(np.float32)
    slope = gaussian_filter1d(slope, 1.0 * softness / spacing_px, axis=1, mode="wrap")
    slope[holes] = 0
    # The second difference along the outline is blind to whatever runs along it: noise, through the same kernels.
    second = slope - 0.5 * (np.roll(slope, 3, 1) + np.roll(slope, -3, 1))
    noise = 1.4826 / 1.22 * np.median(np.abs(second), axis=(1, 2))
    level = np.abs(values).mean((1, 2))
    signal = slope / np.maximum(np.maximum(EDGE_NOISES * noise, 1e-4), 0.004 * level)[:, None, None]
    square = signal**2
    standing = (square / (1 + square)).mean(0)
    strength = np.abs(signal)
    here = strength[..., 1:-1]
    peak = (here >= strength[..., :-2]) & (here > strength[..., 2:]) & (here > 1)
    # What is an edge in one frame only is a shadow's; of three frames two must agree.
    needed = min(0.3, max(0.12, 1.2 / len(strips)))
    wide = np.maximum(np.maximum(standing[:, :-2], standing[:, 2:]), standing[:, 1:-1])
    peak &= (wide > needed) & (np.abs(offsets[1:-1]) <= search_px)
    # Three widths beside a strong edge the wider kernel alone makes an echo of it, with nothing there to see.
    steep = (values @ narrow.T.astype(np.float32))[..., 1:-1]
    peak &= steep * slope[..., 1:-1] > 0.5 * slope[..., 1:-1] ** 2
    frame, point, at = np.nonzero(peak)
    if len(frame) < 20:
        return None
    before, middle, after = (strength[frame, point, at + k] for k in (0, 1, 2))
    bend = before - 2 * middle + after
    sub = np.where(bend < 0, 0.5 * (before - after) / np.minimum(bend, -1e-12), 0)
    places = offsets[at + 1] + step * np.clip(sub, -0.5, 0.5)
    strong = np.array([np.quantile(middle[frame == f], 0.9) if np.any(frame == f) else 1 for f in range(len(strips))])
    weight = standing[point, at + 1] / (0.25**2 + (1.5 / (EDGE_NOISES * middle)) ** 2)
    prominence = middle**2 / (middle**2 + 0.5 * strong[frame] ** 2)
    return Edges(point, places, weight / weight.max(), prominence)


def agree(edges: Edges, jacobian: Array, *, start: Array, reach_px: float, closest_px: float) -> Agreement | None:
    """Return the outline near `start` (3,) on which the edges agree, or None.

    Parameters
    ----------
    edges : Edges
    jacobian : (N, 3) float64
        What the outline's offset changes by with u, v and radius.
    start : (3,) float64
        Shift of u, v and radius, px.
    reach_px, closest_px : float
        Edges so far from the outline are believed at first, and at last: what is not this outline (a cast shadow, a
        terminator, the rim of a reflection) loses its weight as the reach shrinks to the place where the frames agree.
    """
    shift, reach = start, reach_px
    residual = edges.offset - (jacobian @ shift)[edges.point]
    for turn in range(14):
        # On a matte ball's dark side the shading ends inside the outline: until the frames agree to half a pixel,
        # each frame's strongest edges count most. After that they would only pull toward the brighter side.
        weight = edges.weight * edges.prominence if reach > 0.6 else edges.weight
        step = robust_step(jacobian, residual, weight, reach, point=edges.point)
        if step is None:
            return None
        shift = shift + step
        residual = edges.offset - (jacobian @ shift)[edges.point]
        if turn > 4 and np.abs(step).max() < 1e-2 and reach == closest_px:
            break
        reach = max(closest_px, min(0.7 * reach, 3.5 * _spread(residual, weight, reach)))
    seen = np.zeros(len(jacobian), bool)
    seen[edges.point[np.abs(residual) < reach]] = True
    return Agreement(shift, float(seen.mean()), _spread(residual, edges.weight, max(1.5, 2 * closest_px)))


def robust_step(
    jacobian: Array, offset: Array, weight: Array, reach: float | Array, *, point: NDArray[np.intp] | None = None
) -> Array | None:
    """Return the shift (3,) of a Tukey-weighted linear fit, or None where it is not determined.

    `jacobian` (N, 3) has a row for each offset (K,), or for each `point` (K,) of the outline that offsets lie at.
    """
    # Edges at one point of the outline share its row: they are summed before the rows are multiplied.
    point = np.arange(len(jacobian)) if point is None else point
    shift = np.zeros(3)
    for _ in range(10):
        residual = offset - (jacobian @ shift)[point]
        w = weight * np.maximum(1 - (residual / reach) ** 2, 0) ** 2
        total = np.bincount(point, w, len(jacobian))
        normal = jacobian.T @ (total[:, None] * jacobian)
        if np.count_nonzero(w) < 12 or np.linalg.cond(normal) > 1e8:
            return None
        right = jacobian.T @ np.bincount(point, w * offset, len(jacobian))
        previous, shift = shift, np.linalg.solve(normal, right)
        if np.abs(shift - previous).max() < 1e-4:
            break
    return np.asarray(shift, np.float64)


def _spread(offset: Array, weight: Array, window: float) -> float:
    """Return the robust standard deviation of the offsets near zero."""
    near = (np.abs(offset) < window) & (weight > 0)
    if not near.any():
        return window
    order = np.argsort(np.abs(offset[near]))
    share = np.cumsum(weight[near][order])
    return 1.4826 * float(np.abs(offset[near])[order][np.searchsorted(share, 0.5 * share[-1])])

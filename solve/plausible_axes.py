"""In which axes a normal map makes sense alone: it faces the viewer, is a surface's slope, points out at its rim."""

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

Array = NDArray[np.float64]
AXES = tuple(
    np.array([[sign * (axis == column) for column in range(3)] for sign, axis in zip(signs, order, strict=True)], float)
    for order in permutations(range(3))
    for signs in product((1, -1), repeat=3)
)
"""The 48 ways to swap and flip three axes, camera frame from a map's: n = matrix @ (its components). The first changes
nothing."""
INVERTED = np.diag([-1.0, -1.0, 1.0])
"""Convex for concave."""
FACING = 0.97
"""Share of the normals that point to the viewer, in the right axes."""
_STEEP = 0.3
"""z of a normal under which its slope says too little."""
_CLEARLY = 0.5
"""A misfit is clearly the least when the next is twice as large."""
_OUT = 0.35
"""See `_way_out`: from it on the rim is one; in wrong axes it is negative."""
_LIMB = 0.7
"""Sine of the angle between a normal at the rim and the line of sight from which the rim is a body's."""
RIM_PX = (1.5, 6.5)
"""Distance from the outline of the pixels that vote: the outermost are mixed with the background."""


@dataclass(frozen=True)
class PlausibleAxes:
    """Which of `AXES` a normal map makes sense in.

    `plain`: by its slopes; 0, the first, where they do not speak against it. Where they do, the rim chooses.
    `by_rim`: the same, taking it that normals point out of the mask at its rim: a hollow's do not. `is_unique`:
    `by_rim` is clearly better than all others.
    """

    plain: int
    by_rim: int
    is_unique: bool


def axes_words(matrix: Array) -> str:
    """Return what the camera frame's x, y and z are of a map's, by its entry of `AXES`: (x, -y, -z)."""
    rows = [(int(np.abs(row).argmax()), row.sum() < 0) for row in matrix]
    return "(" + ", ".join(f"{'-' if flipped else ''}{'xyz'[axis]}" for axis, flipped in rows) + ")"


def plausible_axes(normals: Array, mask: NDArray[np.bool_]) -> PlausibleAxes:
    """Return the axes in which a normal map, NaN where there is none, makes sense by itself."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    box = (slice(max(rows[0] - 1, 0), rows[-1] + 2), slice(max(columns[0] - 1, 0), columns[-1] + 2))
    normals, mask = np.where(mask[..., None], normals, np.nan)[box], mask[box]
    known = normals[np.isfinite(normals[..., 0])]
    facing = [k for k, axes in enumerate(AXES) if len(known) and np.mean(known @ axes[2] > 0) > FACING]
    if not facing:
        return PlausibleAxes(0, 0, False)
    # The third axis as it stands, where that will do.
    third = min((AXES[k][2] for k in facing), key=lambda row: not np.array_equal(row, [0, 0, 1]))
    facing = [k for k in facing if np.array_equal(AXES[k][2], third)]
    curls = {k: _curl(normals @ AXES[k].T) for k in facing}
    left = [k for k in facing if curls[k] <= max(min(curls.values()) / _CLEARLY, 1e-4)]
    outs = {k: _way_out(normals[mask] @ AXES[k].T, mask) for k in left}
    most = max(outs.values())
    best = [k for k in left if most <= _OUT or outs[k] > most - _OUT]
    by_rim = 0 if 0 in best else max(best, key=lambda k: outs[k])
    return PlausibleAxes(0 if 0 in left else by_rim, by_rim, len(best) == 1)


def _curl(turned: Array) -> float:
    """Return the median of |dp/dy - dq/dx| over slopes p = -x/z, q = -y/z, x right, y up: 0 on every smooth surface."""
    with np.errstate(invalid="ignore", divide="ignore"):
        z = np.where(turned[..., 2] > _STEEP, turned[..., 2], np.nan)
        p, q = -turned[..., 0] / z, -turned[..., 1] / z
    # Rows run down, y up.
    across, up = (q[1:-1, 2:] - q[1:-1, :-2]) / 2, (p[:-2, 1:-1] - p[2:, 1:-1]) / 2
    curl = np.abs(up - across)
    return float(np.nanmedian(curl)) if np.isfinite(curl).any() else np.inf


def _way_out(turned: Array, mask: NDArray[np.bool_]) -> float:
    """Return how clearly normals (P, 3) point out of the mask at its rim: 1 on a round body, -1 in a hollow.

    Near 0 on a relief that fills its mask: a rim is steep; the edge of a relief is what it happens to be.
    """
    vote, steepness = outward_vote(turned, mask)
    return 0.0 if np.isnan(vote) else (2 * vote - 1) * min(1.0, steepness / _LIMB)


def outward_vote(b: Array, mask: NDArray[np.bool_]) -> tuple[float, float]:
    """Return which share of the outline says that b (P, 3) points out of the mask (H, W), and how steep it is.

    NaN of b does not vote. NaN without an outline: where the mask runs into the picture's edge the object goes on.
    Steepness: the median of the sine between the normals there and the line of sight.
    """
    padded = np.pad(mask, 1, mode="edge")
    inside = np.asarray(ndimage.distance_transform_edt(padded))[1:-1, 1:-1]
    smooth = ndimage.gaussian_filter(np.pad(mask, 8, mode="edge").astype(np.float32), 3.0)
    down, right = np.gradient(smooth)
    outward = np.stack([-right, down], -1)[8:-8, 8:-8][mask]
    rim = ((inside > RIM_PX[0]) & (inside < RIM_PX[1]))[mask]
    rim &= (np.linalg.norm(outward, axis=1) > 1e-3) & (np.linalg.norm(b, axis=1) > 0)
    if np.count_nonzero(rim) < 20:
        return np.nan, 0.0
    # Steep pixels say more than those that face the camera.
    pull = np.sum(b[rim, :2] * outward[rim], 1) / np.maximum(
        np.linalg.norm(b[rim], axis=1) * np.linalg.norm(outward[rim], axis=1), 1e-300
    )
    share = float(np.sum(np.maximum(pull, 0)) / max(float(np.sum(np.abs(pull))), 1e-300))
    sine = np.linalg.norm(b[rim, :2], axis=1) / np.maximum(np.linalg.norm(b[rim], axis=1), 1e-300)
    return share, float(np.median(sine))

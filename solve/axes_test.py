"""Test a normal map's axes by the map itself: it faces the viewer, is a surface's slope, and points out at the rim."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.frames import Frames, gray
from scene.lights import Lights
from scene.normals import unit
from solve.axes import AXES, Axes

Array = NDArray[np.float64]
FACING = 0.97
"""Share of the normals that point to the viewer, in the right axes."""
_STEEP = 0.3
"""z of a normal under which its slope says too little."""
_CLEARLY = 0.5
"""A misfit is clearly the least when the next is twice as large."""
_OUT = 0.35
"""Mean cosine, at the rim, between normals and the way out, from which the rim is one; in wrong axes it is negative."""
_GRID = 200
"""Pixels along the object's longer side that are asked for the lights' axes."""
_LIT = 0.15
"""Share of a pixel's brightest samples under which it stands in shadow."""
_LAMBERT = 0.15
"""Misfit of Lambert's law, the same in all axes, above which something else is wrong: the order, the strengths."""


@dataclass(frozen=True)
class PlausibleAxes:
    """Which axes, of some candidates, a normal map makes sense in.

    `plain`: by its slopes; 0, the first, where they do not speak against it. Where they do, the rim chooses.
    `by_rim`: the same, taking it that normals point out of the mask at its rim: a hollow's do not. `is_unique`:
    `by_rim` is clearly better than all others.
    """

    plain: int
    by_rim: int
    is_unique: bool


def axes_by_themselves(normals: Array, mask: NDArray[np.bool_], all_axes: tuple[Array, ...]) -> PlausibleAxes:
    """Return the axes in which a normal map makes sense by itself.

    `normals` are NaN where there is none; `all_axes` are camera frame from the map's, the first changes nothing.
    """
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    box = (slice(max(rows[0] - 1, 0), rows[-1] + 2), slice(max(columns[0] - 1, 0), columns[-1] + 2))
    normals, mask = np.where(mask[..., None], normals, np.nan)[box], mask[box]
    known = normals[np.isfinite(normals[..., 0])]
    facing = [k for k, axes in enumerate(all_axes) if len(known) and np.mean(known @ axes[2] > 0) > FACING]
    if not facing:
        return PlausibleAxes(0, 0, False)
    # The third axis as it stands, where that will do.
    toward = [all_axes[k][2] for k in facing]
    third = next((row for row in toward if np.array_equal(row, [0, 0, 1])), toward[0])
    facing = [k for k in facing if np.array_equal(all_axes[k][2], third)]
    curls = {k: _curl(normals @ all_axes[k].T) for k in facing}
    left = [k for k in facing if curls[k] <= max(min(curls.values()) / _CLEARLY, 1e-4)]
    outs = {k: _way_out(normals @ all_axes[k].T, mask) for k in left}
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
    """Return the mean over the rim of the cosine between a normal's x, y and the way out of the mask.

    1 on a round body, -1 in a hollow, near 0 on a relief that fills its mask.
    """
    import cv2

    inside = np.pad(mask, 1).astype(np.uint8)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, 5)[1:-1, 1:-1]
    smooth = np.asarray(cv2.GaussianBlur(depth, (0, 0), 1.5), np.float64)
    known = np.isfinite(turned[..., 0]) & np.isfinite(turned[..., 2])
    border = np.zeros_like(mask)
    border[1:-1, 1:-1] = True
    # Where the picture ends the object does not.
    rim = mask & known & (depth <= 2.5) & border
    if rim.sum() < 20:
        return 0.0
    gy, gx = np.gradient(smooth, axis=0), np.gradient(smooth, axis=1)
    out, flat = np.stack([-gx[rim], gy[rim]], -1), turned[rim][:, :2]
    scale = np.linalg.norm(out, axis=1) * np.linalg.norm(flat, axis=1)
    cosine = np.sum(out * flat, 1) / np.maximum(scale, 1e-9)
    # A rim is steep; the edge of a relief is what it happens to be.
    return float(np.mean(cosine) * min(1.0, np.median(np.linalg.norm(flat, axis=1)) / 0.7))


def lights_in_other_axes(frames: Frames, lights: Lights, mask: NDArray[np.bool_]) -> str | None:
    """Say in which axes known lights must be for the object to be a surface; None where they make sense as they are.

    Lambert's law fits lights in any axes: the normals follow. But turned normals are no surface's slope, or point into
    it at its rim; the latter are a hollow's too. Nothing is said where Lambert's law does not fit.
    """
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    step = max(1, int(max(np.ptp(rows), np.ptp(columns)) // _GRID))
    down, across = slice(rows[0], rows[-1] + 1, step), slice(columns[0], columns[-1] + 1, step)
    inside = mask[down, across]
    values = np.stack([gray(frames.read(down, [f], columns=across)[0][inside]) for f in range(len(frames))])
    values = (values / lights.intensities.mean(1)[:, None]).astype(np.float64).T
    bright = np.quantile(values, 0.9, axis=1, keepdims=True)
    weight = (values > _LIT * bright) & (values < 3 * np.maximum(np.median(values, 1, keepdims=True), 0.3 * bright))
    light = lights.directions * weight[..., None]
    matrix = np.swapaxes(light, 1, 2) @ light + 1e-6 * np.eye(3)
    fitted = np.linalg.solve(matrix, np.swapaxes(light, 1, 2) @ values[..., None])[..., 0]
    lit = values * weight
    misfit = np.linalg.norm(lit - (light @ fitted[..., None])[..., 0], axis=1) / np.linalg.norm(lit, axis=1).clip(1e-12)
    if np.median(misfit) > _LAMBERT:
        return None
    normals = np.full((*inside.shape, 3), np.nan)
    normals[inside] = np.where((weight.sum(1) >= 4)[:, None], unit(fitted), np.nan)
    found = axes_by_themselves(normals, inside, AXES)
    best = found.by_rim if found.is_unique else found.plain
    if not best:
        return None
    fault, makes = "is no surface's slope", "It makes"
    if not found.plain:
        # Its slopes do not speak against the file: only the rim does.
        fault, makes = "points inward at its rim", "Unless it is hollow, it makes"
    return (
        f"lights.file: under its lights the object {fault}. {makes} sense if the file's axes are changed to "
        f"{Axes(AXES[best])}; expected are x right, y up, z toward the viewer. Correct lights.file; it is used as it "
        "stands."
    )

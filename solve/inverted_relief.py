"""Convex taken for concave: whether lights that are known explain the photographs better by the inverted relief.

Uncalibrated methods see no difference between a surface under its lights and the inverted surface under mirrored ones;
a network may invert a part. Lights that were calibrated know: of normals n and (-n_x, -n_y, n_z) one explains each
pixel. The normals stay as the method gave them: what is its own is to be judged as its own.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from scene.camera import Camera
from scene.frames import Frames
from scene.lights import Lights
from solve.axes import INVERTED, TELLING, misfits, some_pixels
from solve.problem import Problem
from solve.samples import all_samples

Array = NDArray[np.float64]
WHOLE = 0.25
"""Share of what the lights can tell by which the inverted relief must be the better one."""
LEAST = 0.003
"""Misfit that is noise's as well as any relief's."""
ASIDE = 0.2
"""Sine of the angle between a normal and the line of sight from which inverting it shows."""
LIT, FEWEST_LIT = 0.1, 4
"""Share of the bright samples from which one is lit, and how many of these a pixel must have to count for a part."""
CLEAR, BETTER = 0.05, 0.5
"""Misfit from which a patch is not explained, and the share of it that the inverted relief may leave there."""
PATCHES, FEWEST = 16, 12
"""Patches along the object's longer side, and pixels that a patch must have."""
PART = 0.02
"""Share of the object in patches of that kind from which a part is called inverted."""


def relief_cautions(
    normals: NDArray, frames: Frames, lights: Lights, camera: Camera, mask: NDArray[np.bool_]
) -> tuple[str, ...]:
    """Return what is to be said of the relief of normals (H, W, 3), camera frame, NaN where unknown.

    Nothing under unknown lights, nor of an object that is too flat to tell.
    """
    known = mask & np.isfinite(normals[..., 0]) & (normals[..., 2] > 0)
    if lights.is_unknown or not known.any():
        return ()
    places = np.flatnonzero(known)[some_pixels(np.ones(int(known.sum()), bool))]
    few = np.zeros(mask.size, bool)
    few[places] = True
    thin = few.reshape(mask.shape)
    samples = all_samples(Problem(frames, lights, camera, thin, slice(0, len(mask))))
    there = normals[thin].astype(np.float64)
    weights = samples.valid * np.maximum(samples.gray, 0).astype(np.float64)
    toward = samples.toward()
    given, other = (misfits(each, weights, samples.valid, toward) for each in (there, there @ INVERTED))
    if not np.isfinite(given).any():
        return ()
    chance = misfits(there[np.random.default_rng(0).permutation(len(there))], weights, samples.valid, toward)
    room = float(np.nanmedian(chance)) - min(float(np.nanmedian(given)), float(np.nanmedian(other)))
    if room < TELLING * float(np.nanmedian(chance)):
        return ()
    if np.nanmedian(given) > LEAST and float(np.nanmedian(given) - np.nanmedian(other)) > WHOLE * room:
        return (
            "its relief is inverted, convex for concave: under the calibrated lights normals with x and y negated "
            f"explain the photographs to {np.nanmedian(other):.1%}, its own to {np.nanmedian(given):.1%} only. It is "
            "left as the method gave it; believe a calibrated method.",
        )
    lit = (samples.valid & (samples.gray > LIT * samples.scale())).sum(1) >= FEWEST_LIT
    share, (row, column) = _inverted_part(thin, there, np.where(lit, given, np.nan), other)
    if share > PART:
        return (
            f"{share:.0%} of the object, about row {row}, column {column}, seem inverted, convex for concave: there "
            "normals with x and y negated explain the photographs better under the calibrated lights.",
        )
    return ()


def _inverted_part(
    thin: NDArray[np.bool_], normals: Array, given: Array, other: Array
) -> tuple[float, tuple[int, int]]:
    """Return the share of the pixels that lie in inverted patches, and the middle of these."""
    row, column = np.nonzero(thin)
    tall, wide = np.ptp(row) + 1.0, np.ptp(column) + 1.0
    # Of a small object patches are larger: each is to have its pixels.
    side = max(max(tall, wide) / PATCHES, np.sqrt(1.3 * FEWEST * tall * wide / len(row))) + 1
    patch = ((row - row.min()) // side * (PATCHES + 1) + (column - column.min()) // side).astype(int)
    telling = np.hypot(normals[:, 0], normals[:, 1]) > ASIDE
    telling &= np.isfinite(given) & np.isfinite(other)
    labels = np.unique(patch)
    if not telling.any():
        return 0.0, (0, 0)
    medians = [
        np.asarray(ndimage.labeled_comprehension(each[telling], patch[telling], labels, np.median, float, np.nan))
        for each in (given, other)
    ]
    count = np.bincount(patch[telling], minlength=labels.max() + 1)[labels]
    with np.errstate(invalid="ignore"):
        bad = (count >= FEWEST) & (medians[0] > CLEAR) & (medians[1] < BETTER * medians[0])
    inside = np.isin(patch, labels[bad]) & telling
    if not inside.any():
        return 0.0, (0, 0)
    return float(inside.mean()), (int(np.median(row[inside])), int(np.median(column[inside])))

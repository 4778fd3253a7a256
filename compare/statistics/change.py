"""Where an object's normals changed between two sessions, by more than both sessions' errors explain."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scene.robust import TUKEY, tukey

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ROUNDS = 8
"""Of the reweighted fit."""
STATED = 0.01
"""Share of an unchanged object's pixels that is flagged; and the chance that a place is told of an unchanged object."""
MEDIAN = 2 * np.log(2)
"""Of chi-square with two degrees of freedom: of a normal's squared change over its variance along one tangent axis."""
LOCAL = 16
"""Windows across the object, in each of which errors are measured: a change is smaller than a window."""
CLIPPED = 24.0
"""Medians at which a squared change is cut for the window's mean: a real change shall not pass for an error."""
PLACE_PX = 5
"""Side of the window whose pixels together tell a place."""
BORDER_PX = 3
"""What lies nearer to an edge of what is known tells nothing: lens and demosaicing mix the two sides."""
QUANTILE = 0.9
"""Of the windows, that tells with their median how unevenly they err; the changed ones are fewer than a tenth."""


class ChangedPlace(NamedTuple):
    """A part of the object that changed; its middle is (u, v), `change_deg` the largest in it."""

    u: float
    v: float
    change_deg: float
    chance: float
    """Of one that is as clear on an unchanged object."""
    area_mm2: float
    lit_share: float
    """Of its pixels: what every flash lights in both sessions. Elsewhere a shadow's error may pass for a change."""


class Tested(NamedTuple):
    """Which pixels changed, and how clearly."""

    square: Array
    """(H, W): squared change over its variance along one tangent axis; NaN where unknown. Its root is z."""
    windows: Array
    """(H, W): the mean of it over the window about a pixel."""
    log_chance: Array
    """(H, W): natural logarithm of the chance of one window that is as clear among all of an unchanged object."""
    over_stated: float
    """How many times the stated sigmas the changes scatter by."""
    least_deg: float
    """What the normals of a window must have changed by, rms, to be told: of the median pixel."""


def common_turn(normals: Array, place: Array) -> Array:
    """Return (P, 3, 27): how normals (P, 3) at places (P, 2) in the picture, -1 to 1, turn with the lights' errors.

    Least-squares normals under wrong directions or intensities are (1 + E) n; E changes over the object as near lights'
    vectors do, to first order.
    """
    tangent = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    near = np.concatenate([np.ones((len(place), 1)), place], 1)
    return np.einsum("pci,pj,pk->pcijk", tangent, normals, near).reshape(len(normals), 3, -1)


def fit_common(turned: Array, variance: Array, columns: Array, prior: Array) -> Array:
    """Return the unknowns (K,) of columns (P, 3, K) that explain most normals' turns (P, 3), radians.

    variance (P,): of a turn along one tangent axis. prior (k,): standard deviations of the first k unknowns.
    """
    sigma = np.sqrt(variance)[:, None]
    columns, target = columns / sigma[..., None], turned / sigma
    held, found = np.zeros((columns.shape[-1],) * 2), np.zeros(columns.shape[-1])
    # Beyond noise, pixels of one window err alike.
    held[range(len(prior)), range(len(prior))] = max(1.0, len(turned) / LOCAL**2) / prior**2
    for _ in range(ROUNDS):
        size = np.linalg.norm(target - columns @ found, axis=1)
        scale = np.sqrt(np.median(size**2) / MEDIAN)
        weighted = columns * (tukey(size, TUKEY * scale) / scale**2)[:, None, None]
        information = np.einsum("pck,pcl->kl", weighted, columns) + held
        found = np.linalg.pinv(information, rcond=1e-10, hermitian=True) @ np.einsum("pck,pc->k", weighted, target)
    return found


def tested(turned: Array, variance: Array) -> Tested:
    """Test the turns (H, W, 3) of normals, radians, NaN where unknown; variance (H, W) is what is stated of them.

    Notes
    -----
    Stated is what noise does. Gloss, shadows and bounced light do more where they fall otherwise in one of the two
    sessions. So the variance of a pixel is the stated one times what the changes about it exceed theirs by, on the mean
    over a window of the object's size over `LOCAL`.

    Neighbours err together. The means over small windows are taken for a chi-square whose degrees of freedom their own
    median and `QUANTILE` tell; a window must be clearer than `STATED` over the number of pixels (Bonferroni).
    """
    import cv2
    from scipy.optimize import brentq
    from scipy.special import chdtri, gammaincc

    known = np.isfinite(turned).all(-1) & np.isfinite(variance)
    inner = cv2.erode(known.astype(np.uint8), np.ones((2 * BORDER_PX + 1,) * 2)) > 0
    # Of an object of few pixels all is border.
    known = inner if inner.any() else known
    rows, columns = (np.flatnonzero(known.any(axis)) for axis in (1, 0))
    side = max(PLACE_PX, int(max(np.ptp(rows), np.ptp(columns)) / LOCAL) | 1)
    # A few samples tell a pixel's noise badly; neighbours have the same.
    variance = _mean(variance, known, PLACE_PX)
    square = np.where(known, np.sum(turned**2, -1) / variance, np.nan)
    usual = float(np.nanmedian(square))
    local = _mean(np.minimum(square, CLIPPED * usual), known, side) / 2
    square = square / local
    windows = _mean(square, known, PLACE_PX)
    middle, high = np.quantile(windows[known], [0.5, QUANTILE])
    spread = max(high / middle, 1.0)

    def exceeds(free: float) -> float:
        return chdtri(free, 1 - QUANTILE) / chdtri(free, 0.5) - spread

    solve: Any = brentq
    free = float(solve(exceeds, 0.5, 1e4)) if exceeds(0.5) > 0 > exceeds(1e4) else 2.0
    unit, count = middle / chdtri(free, 0.5), np.count_nonzero(known)
    chance = gammaincc(free / 2, windows / unit / 2)
    least = unit * chdtri(free, STATED / count)
    least_deg = np.degrees(np.sqrt(least * np.median((local * variance)[known])))
    log_chance = np.log(np.maximum(chance * count, 1e-300))
    return Tested(square, windows, log_chance, float(np.sqrt(usual / MEDIAN)), float(least_deg))


def places(found: Tested, change_deg: NDArray, pixel_mm2: NDArray, lit: Mask) -> list[ChangedPlace]:
    """Return where the object changed, the largest change first.

    (H, W): the changes, each pixel's area of surface, and whether every flash lights it in both sessions.
    """
    from scipy import ndimage

    labelled: Any = ndimage.label(found.log_chance < np.log(STATED))
    label, out = labelled[0], []
    for number, box in enumerate(ndimage.find_objects(label), 1):
        v, u = np.nonzero(label[box] == number)
        v, u = v + box[0].start, u + box[1].start
        chance = float(np.exp(found.log_chance[v, u].min()))
        most = float(np.nanmax(change_deg[v, u]))
        area, share = float(np.nansum(pixel_mm2[v, u])), float(lit[v, u].mean())
        out.append(ChangedPlace(float(u.mean()), float(v.mean()), most, chance, area, share))
    return sorted(out, key=lambda place: -place.change_deg)


def _mean(values: NDArray, known: Mask, side: int) -> Array:
    """Return the mean of the known values (H, W) in the square window of `side` pixels about each; NaN if unknown."""
    import cv2

    filled = np.stack([np.where(known, values, 0), known], -1).astype(np.float64)
    total, count = np.moveaxis(cv2.blur(filled, (side, side), borderType=cv2.BORDER_CONSTANT), -1, 0)
    return np.divide(total, count, out=np.full(known.shape, np.nan), where=known)

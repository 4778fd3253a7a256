"""One decoded photograph, and the arithmetic on codes that every reader needs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.frames import PEDESTAL, WHITE

SATURATION = 0.98
"""Share of the white level from which a sample counts as clipped: sensors bend before they clip."""
CLIPPED_CODE = round(SATURATION * (WHITE - PEDESTAL)) + PEDESTAL
FLOAT16_MAX = 65504.0
BIN = 64
"""Codes in one bin of a histogram."""


@dataclass(frozen=True)
class Photograph:
    """A linear picture as codes; see `scene.frames.Frames`.

    Parameters
    ----------
    codes : (H, W, 3) uint16 or float16
        RGB.
    white : float
        Linear value at which the sensor clips: 1, unless this file's white level lies below the session's. Of floating
        point: see `clip_level`.
    sensor_range : float or None
        White less black level of a RAW file, DN, or the power of two of a float file: what 1.0 stands for.
    is_mosaic : bool
        Colours were interpolated between neighbours.
    """

    codes: NDArray
    white: float = 1.0
    sensor_range: float | None = None
    is_mosaic: bool = False


def half_floats(linear: NDArray) -> NDArray[np.float16]:
    """Return linear values as codes; the greatest half float stands for what is above it, and counts as clipped."""
    return np.clip(linear, -FLOAT16_MAX, FLOAT16_MAX).astype(np.float16)


def halve(codes: NDArray, white: float = 1.0) -> NDArray:
    """Return the means of 2 x 2 pixels, (H // 2, W // 2, 3); clipped where one of the four is clipped."""
    height, width = codes.shape[0] // 2 * 2, codes.shape[1] // 2 * 2
    quads = [codes[row:height:2, column:width:2] for row in (0, 1) for column in (0, 1)]
    return mean_of(quads, white)


def mean_of(parts: list[NDArray], white: float = 1.0) -> NDArray:
    """Return the mean of codes, the greatest where one is clipped: a mean would hide it."""
    is_whole = parts[0].dtype == np.uint16
    total = np.full(parts[0].shape, len(parts) // 2 * is_whole, np.uint32 if is_whole else np.float32)
    most = parts[0]
    for part in parts:
        total += part
        most = np.maximum(most, part)
    mean = total // len(parts) if is_whole else total / np.float32(len(parts))
    return np.where(most >= (CLIPPED_CODE if is_whole else SATURATION * white), most, mean).astype(most.dtype)


def clip_level(codes: NDArray) -> float:
    """Return the linear value at which a picture's samples end: 1 of whole numbers.

    Floating point: where the samples of a channel pile up at its greatest values, as those of an overexposed
    photograph do; infinity where they do not.
    """
    if codes.dtype == np.uint16:
        return 1.0
    tops = piles(codes)
    return float(np.int16(2 * min(tops)).view(np.float16)) if tops else np.inf


def piles(codes: NDArray) -> list[int]:
    """Return, for each channel of codes (H, W, 3) that piles up at its top, the last bin: of `BIN`, or 2 half floats.

    A pile has the last four bins, and is compared with the eight times four below them. About a million pixels are
    looked at, in a regular sample.
    """
    step, tops = max(1, round(np.sqrt(codes.shape[0] * codes.shape[1] / 1e6))), []
    some, is_whole = codes[::step, ::step], codes.dtype == np.uint16
    # Half floats above 0 have the order of their bits: a bin is 0.1 to 0.2 % wide.
    bins = some // BIN if is_whole else np.maximum(some.view(np.int16), 0) >> 1
    for counts in map(np.bincount, bins.reshape(-1, 3).T):
        top = len(counts) - 1
        if top < 35:
            continue
        pile = counts[top - 3 :].sum()
        below = counts[top - 35 : top - 3].reshape(8, 4).sum(axis=1)
        # Where brightness is continuous most of them are filled; below a flat face of a rendering there is nothing.
        is_filled = is_whole or np.count_nonzero(below) >= 4
        if pile >= 20 and pile > 3 * below.max() and pile > 8 * below.mean() and is_filled:
            tops.append(top)
    return tops

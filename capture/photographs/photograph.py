"""One decoded photograph, and the arithmetic on codes that every reader needs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.frames import PEDESTAL, WHITE

SATURATION = 0.98
"""Share of the white level from which a sample counts as clipped: sensors bend before they clip."""
CLIPPED_CODE = round(SATURATION * (WHITE - PEDESTAL)) + PEDESTAL
FLOAT16_MAX = 65504.0


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
    step = max(1, round(np.sqrt(codes.shape[0] * codes.shape[1] / 1e6)))
    # Half floats above 0 have the order of their bits: a bin is 0.1 to 0.2 % wide.
    bins = np.maximum(codes[::step, ::step].view(np.int16), 0) >> 1
    # Where brightness is continuous most windows are filled; below a flat face of a rendering there is nothing.
    tops = [pile_at_top(np.bincount(channel), windows=4) for channel in bins.reshape(-1, 3).T]
    found = [top for top in tops if top is not None]
    return float(np.int16(2 * min(found)).view(np.float16)) if found else np.inf


def pile_at_top(counts: NDArray[np.int64], *, windows: int = 0) -> int | None:
    """Return the last filled bin of a histogram where samples pile up in it and the 3 before, else None.

    The pile is compared with the eight windows of 4 bins below it, of which `windows` must be filled.
    """
    filled = np.flatnonzero(counts)
    if not len(filled) or filled[-1] < 35:
        return None
    top = int(filled[-1])
    pile = counts[top - 3 : top + 1].sum()
    below = counts[top - 35 : top - 3].reshape(8, 4).sum(axis=1)
    stands = pile >= 20 and pile > 3 * below.max() and pile > 8 * below.mean()
    return top if stands and np.count_nonzero(below) >= windows else None

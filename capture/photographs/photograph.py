"""One decoded photograph, and the arithmetic on codes that every reader needs."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.frames import PEDESTAL, WHITE

SATURATION = 0.98
"""Share of the white level from which a sample counts as clipped: sensors bend before they clip."""
CLIPPED_CODE = round(SATURATION * (WHITE - PEDESTAL)) + PEDESTAL


@dataclass(frozen=True)
class Photograph:
    """A linear picture as codes; see `scene.frames.Frames`.

    Parameters
    ----------
    codes : (H, W, 3) uint16 or float16
        RGB.
    white : float
        Linear value at which the sensor clips: 1, unless this file's white level lies below the session's.
    sensor_range : float or None
        White less black level of a RAW file, DN: what 1.0 stands for.
    is_mosaic : bool
        Colours were interpolated between neighbours.
    """

    codes: NDArray
    white: float = 1.0
    sensor_range: float | None = None
    is_mosaic: bool = False


def halve(codes: NDArray) -> NDArray:
    """Return the means of 2 x 2 pixels, (H // 2, W // 2, 3); clipped where one of the four is clipped."""
    height, width = codes.shape[0] // 2 * 2, codes.shape[1] // 2 * 2
    quads = [codes[row:height:2, column:width:2] for row in (0, 1) for column in (0, 1)]
    return mean_of(quads)


def mean_of(parts: list[NDArray]) -> NDArray:
    """Return the mean of codes; of uint16, the greatest where one is clipped: a mean would hide it."""
    if parts[0].dtype != np.uint16:
        return np.mean([part.astype(np.float32) for part in parts], axis=0).astype(np.float16)
    total = np.full(parts[0].shape, len(parts) // 2, np.uint32)
    most = parts[0]
    for part in parts:
        total += part
        most = np.maximum(most, part)
    return np.where(most >= CLIPPED_CODE, most, total // len(parts)).astype(np.uint16)

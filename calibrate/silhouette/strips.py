"""The photographs along an outline: for each of its points, the pixels on a short line across it."""

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.frames import PEDESTAL, WHITE, Frames, decode

Array = NDArray[np.float64]
THIRDS = np.full((1, 3), 1 / 3, np.float32)


def read_strips(frames: Frames, points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
    """Return (F, N, M) linear values of F frames at points (N, 2) + offsets (M,) along normals (N, 2).

    Mean of the channels, ambient subtracted; NaN outside the picture and where a channel is clipped.
    """
    where = _places(points, normals, offsets)
    out = np.full((len(frames), *where.shape[:2]), np.nan, np.float32)
    low = np.clip(np.floor(np.nanmin(where, axis=(0, 1))).astype(int), 0, None)
    high = np.minimum(np.ceil(np.nanmax(where, axis=(0, 1))).astype(int) + 2, [frames.width, frames.height])
    if np.any(high - low < 2):
        return out
    box = (slice(low[1], high[1]), slice(low[0], high[0]))
    outside = np.any((where < 0) | (where > [frames.width - 1, frames.height - 1]), -1)
    places = np.moveaxis(where - low, -1, 0).astype(np.float32, order="C")
    limit = _limit(frames)
    ambient = np.float32(0)
    if frames.ambient is not None:
        ambient = _sampled(frames.ambient[box], places)[0]
    for index, gain in enumerate(frames.gain.astype(np.float32)):
        values, brightest = _sampled(frames.codes[index][box], places)
        values *= gain
        values -= ambient
        values[outside | (brightest >= limit)] = np.nan
        out[index] = values
    return out


def image_strips(image: NDArray, points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
    """Return (1, N, M), the same of one image (H, W) float32."""
    where = _places(points, normals, offsets).astype(np.float32)
    values = cv2.remap(image.astype(np.float32), where[..., 0], where[..., 1], cv2.INTER_LINEAR)
    inside = np.all((where >= 0) & (where <= np.array(image.shape[::-1]) - 1), axis=-1)
    return np.where(inside, values, np.float32(np.nan))[None].astype(np.float32)


def _places(points: Array, normals: Array, offsets: Array) -> Array:
    return points[:, None] + offsets[:, None] * normals[:, None]


def _limit(frames: Frames) -> float:
    """Return the code from which an interpolated sample may hold a clipped one."""
    limit = 0.95 * frames.saturation
    return limit * (WHITE - PEDESTAL) + PEDESTAL if frames.codes.dtype == np.uint16 else limit


def _sampled(codes: NDArray, places: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray]:
    """Interpolate codes (h, w, 3) at (2, n, M) places: the channels' linear mean and the highest code."""
    # A view of the file: only the pixels about the places are ever touched.
    view = np.asarray(codes) if codes.dtype == np.uint16 else codes.astype(np.float32)
    u, v = places
    found = cv2.remap(view, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    highest = np.maximum(np.maximum(found[..., 0], found[..., 1]), found[..., 2])
    return np.asarray(cv2.transform(decode(found), THIRDS), np.float32), highest

"""The photographs along an outline: for each of its points, the pixels on a short line across it."""

import itertools

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.frames import PEDESTAL, WHITE, Frames, decode

Array = NDArray[np.float64]
LARGEST_BLOCK_PX = 200
"""An outline is read in arcs of about this size: a large ball's inside is never touched."""


def read_strips(frames: Frames, points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
    """Return (F, N, M) linear values of F frames at points (N, 2) + offsets (M,) along normals (N, 2).

    Mean of the channels, ambient subtracted; NaN outside the picture and where a channel is clipped.
    """
    where = _places(points, normals, offsets)
    out = np.full((len(frames), *where.shape[:2]), np.nan, np.float32)
    ambient = np.zeros(where.shape[:2], np.float32)
    limit = _limit(frames)
    for part, rows, columns in _arcs(where, frames.height, frames.width):
        place = where[part] - [columns.start, rows.start]
        u, v = np.ascontiguousarray(place[..., 0], np.float32), np.ascontiguousarray(place[..., 1], np.float32)
        outside = (u < 0) | (v < 0) | (u > columns.stop - columns.start - 1) | (v > rows.stop - rows.start - 1)
        if frames.ambient is not None:
            ambient[part] = decode(_sampled(frames.ambient[rows, columns], u, v)).mean(-1)
        for index in range(len(frames)):
            codes = _sampled(frames.codes[index, rows, columns], u, v)
            values = decode(codes).mean(-1) * np.float32(frames.gain[index])
            values[outside | (codes.max(-1) >= limit)] = np.nan
            out[index, part] = values
    return out - ambient


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


def _sampled(codes: NDArray, u: NDArray[np.float32], v: NDArray[np.float32]) -> NDArray:
    """Interpolate codes (h, w, 3) at (n, M) places; codes stay codes."""
    block = np.ascontiguousarray(codes)
    if block.dtype == np.float16:
        block = block.astype(np.float32)
    return cv2.remap(block, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def _arcs(where: Array, height: int, width: int) -> list[tuple[slice, slice, slice]]:
    """Return (part of the points, rows, columns) of arcs that are small enough to be read as blocks."""
    extent = np.ptp(np.nan_to_num(where), axis=(0, 1)).max()
    count = int(np.clip(np.ceil(3.2 * extent / LARGEST_BLOCK_PX), 1, 48)) if extent > LARGEST_BLOCK_PX else 1
    bounds = np.linspace(0, len(where), count + 1).astype(int)
    out = []
    for start, stop in itertools.pairwise(bounds):
        places = where[start:stop]
        low = np.floor(np.nanmin(places, axis=(0, 1))).astype(int)
        high = np.ceil(np.nanmax(places, axis=(0, 1))).astype(int) + 2
        left, top = np.clip(low, 0, [width, height])
        right, bottom = np.clip(high, 0, [width, height])
        if right - left >= 2 and bottom - top >= 2:
            out.append((slice(int(start), int(stop)), slice(int(top), int(bottom)), slice(int(left), int(right))))
    return out

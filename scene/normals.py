"""Normal maps: unit vectors in the camera frame, NaN where unknown."""

import numpy as np
from numpy.typing import NDArray

_ROWS = 256


def unit(vectors: NDArray) -> NDArray:
    """Return vectors (..., 3) at length 1; NaN where the length is zero or unknown."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.full_like(vectors, np.nan), where=length > 0)


def angular_error_deg(a: NDArray, b: NDArray) -> NDArray:
    """Return the angle in degrees between two maps (..., 3) of unit vectors, 0 to 180, float64.

    NaN where either is unknown. By atan2(|a x b|, a . b), exact for small angles, where
    arccos(a . b) loses half of its digits.
    """
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, -1)))


def encode_normals(normals: NDArray) -> NDArray[np.uint16]:
    """Return (H, W, 3) uint16, round((n + 1) / 2 * 65535) in x, y, z order; 0, 0, 0 where unknown."""
    codes = np.empty(normals.shape, np.uint16)
    # Rows at a time: in float64 a map of 24 megapixels is 0.6 GB.
    for start in range(0, len(normals), _ROWS):
        rows = slice(start, start + _ROWS)
        values = np.round((np.asarray(normals[rows], np.float64) + 1) / 2 * 65535)
        codes[rows] = np.nan_to_num(values, nan=0.0)
    return codes


def filled(image: NDArray, known: NDArray[np.bool_]) -> NDArray:
    """Return a map (H, W, ...) whose pixels that are not `known` (H, W) have the nearest known one's value."""
    from scipy.ndimage import distance_transform_edt

    if known.all():
        return image
    nearest = np.asarray(distance_transform_edt(~known, return_distances=False, return_indices=True))
    out = image.copy()
    # Row by row: numpy would make 16 bytes a pixel of the indices.
    for row, unknown in enumerate(~known):
        out[row, unknown] = image[nearest[0, row, unknown], nearest[1, row, unknown]]
    return out

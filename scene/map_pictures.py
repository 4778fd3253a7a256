"""Pictures of maps of the object: normals as colours, at the size at which they are shown."""

import base64

import numpy as np
from numpy.typing import NDArray

from scene.files import encoded
from scene.normals import unit

Image = NDArray[np.uint8]
PAPER = 246
"""Grey level (8 bits) of pixels that are unknown in maps, a little darker than the page."""


def shrink(image: NDArray, width: int) -> NDArray[np.float32]:
    """Return the image at most `width` wide, each pixel the mean of the known ones it covers; NaN where none is."""
    import cv2

    image = np.asarray(image, np.float32)
    if image.shape[1] <= width:
        return image
    size = (width, max(1, round(image.shape[0] * width / image.shape[1])))
    known = np.isfinite(image) if image.ndim == 2 else known_pixels(image)[..., None]
    weight = np.asarray(cv2.resize(known.astype(np.float32), size, interpolation=cv2.INTER_AREA))
    total = np.asarray(cv2.resize(np.where(known, image, 0), size, interpolation=cv2.INTER_AREA), np.float32)
    weight = weight.reshape(*weight.shape[:2], *[1] * (image.ndim - 2))
    return np.divide(total, weight, out=np.full_like(total, np.nan), where=weight > 1e-3)


def known_pixels(image: NDArray) -> NDArray[np.bool_]:
    """Return (h, w) bool: every channel of (h, w, c) is a number."""
    return np.logical_and.reduce(np.isfinite(image), axis=-1)


def normal_picture(normals: NDArray, width: int) -> Image:
    """Return normals (h, w, 3) as colours: red x (right), green y (up), blue z (toward the viewer)."""
    normals = unit(shrink(normals, width))
    codes = np.round((normals + 1) / 2 * 255)
    return np.where(np.isfinite(codes), codes, PAPER).astype(np.uint8)


def data_uri(image: Image, *, photograph: bool) -> str:
    """Return the image (h, w, 3) RGB as a data URI: JPEG for photographs, PNG for maps."""
    import cv2

    how = ("jpeg", cv2.IMWRITE_JPEG_QUALITY, 86) if photograph else ("png", cv2.IMWRITE_PNG_COMPRESSION, 9)
    return f"data:image/{how[0]};base64,{base64.b64encode(encoded(image, f'.{how[0]}', *how[1:])).decode()}"

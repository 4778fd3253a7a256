"""Pictures in files, decoded by OpenCV: what a header claims is looked at before memory is asked for."""

import io
import logging
import os
import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.reading import reading

# What it would print of damaged headers, the decoder says in one message.
logging.getLogger("tifffile").addHandler(logging.NullHandler())

MOST_PIXELS = 600_000_000
"""No camera has more, with its pixels shifted neither."""
TIGHTEST = 4000
"""Pixels that a byte of a file can stand for, at most: deflate packs 1032 to 1, LZW and JPEG to the same order."""
PIXEL_BYTES = 16
"""Of memory that a pixel takes while it is decoded: its values, and its codes."""
EXR = b"\x76\x2f\x31\x01"
BOX = b"dataWindow\0box2i\0"
PILLOW = ["PNG", "JPEG", "BMP", "PPM", "TGA", "GIF", "WEBP"]


def read_pixels(
    path: Path,
    flags: int,
    error: type[SceneError] = SceneError,
    *,
    fault: str = "cannot be read as a picture",
    do: str = "Save it again.",
) -> NDArray:
    """Return a picture's values as OpenCV orders them, (H, W) or (H, W, BGR or BGRA).

    Parameters
    ----------
    path : Path
        PNG, TIFF, JPEG, BMP, PGM, PPM and whatever else OpenCV knows.
    flags : int
        `cv2.IMREAD_...`.
    error, fault, do
        As in `scene.reading.reading`.
    """
    with reading(path, fault, error, do=do):
        return pixels_of(path.read_bytes(), flags)


def pixels_of(data: bytes, flags: int) -> NDArray:
    """Return the picture that a file's bytes hold; ValueError where they hold none. See `read_pixels`."""
    import cv2

    check_header(data)
    values = cv2.imdecode(np.frombuffer(data, np.uint8), flags) if data else None
    if values is None:
        raise ValueError("corrupt, empty, or of another kind")
    return values


def check_header(data: bytes) -> None:
    """Raise ValueError for a picture of a size that no camera takes, or that so small a file cannot hold."""
    width, height = claimed_size(data) or (1, 1)
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if min(width, height) < 1 or width * height > min(MOST_PIXELS, TIGHTEST * len(data), memory // PIXEL_BYTES):
        raise ValueError(f"its header claims {width} x {height} px, the file has {len(data)} bytes")


def claimed_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height that a header claims, None where it is not understood: OpenCV may know more kinds."""
    import tifffile
    from PIL import Image

    # The check is ours: Pillow's own would warn of 90 megapixels.
    Image.MAX_IMAGE_PIXELS = None
    try:
        if data.startswith(EXR):
            left, top, right, bottom = struct.unpack_from("<4i", data, data.index(BOX) + len(BOX) + 4)
            return right - left + 1, bottom - top + 1
        if data[:2] in (b"II", b"MM"):
            with tifffile.TiffFile(io.BytesIO(data)) as file:
                page = file.pages.first
                return page.imagewidth, page.imagelength
        with Image.open(io.BytesIO(data), formats=PILLOW) as image:
            return image.size
    except Exception:
        return None

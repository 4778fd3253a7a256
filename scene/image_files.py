"""Pictures in files, decoded by OpenCV: what a header claims is looked at before memory is asked for."""

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.reading import reading

MOST_PIXELS = 600_000_000
"""No camera has more, with its pixels shifted neither."""
TIGHTEST = 4000
"""Pixels that a byte of a file can stand for, at most: deflate packs 1032 to 1, LZW and JPEG to the same order."""
PIXEL_BYTES = 16
"""Of memory that a pixel takes while it is decoded: its values, and its codes."""
PILLOW = ["PNG", "JPEG", "BMP", "PPM", "TGA", "GIF", "WEBP"]
HDR = b"#?"
"""Radiance's files begin so; Pillow does not know them."""


def read_pixels(
    path: Path,
    error: type[SceneError] = SceneError,
    *,
    fault: str = "cannot be read as a picture",
    do: str = "Save it again.",
) -> tuple[NDArray, int]:
    """Return a picture's values as they lie in the file, and that of white.

    Parameters
    ----------
    path : Path
        PNG, JPEG, BMP, PGM, PPM, TGA, HDR; TIFF and OpenEXR are read by `formats.picture_files.read_values`.
    error, fault, do
        As in `scene.reading.reading`.

    Returns
    -------
    values : (H, W), (H, W, 3) RGB or, of PNG with alpha, (H, W, 4)
        uint8, uint16; of HDR float32.
    white : int
        1 of floating point.
    """
    import cv2

    with reading(path, fault, error, do=do):
        data = path.read_bytes()
        if not data:
            raise ValueError("it is empty")
        # The decoders fill the rest of a file cut short with gray, and say nothing.
        ends = {b"\xff\xd8": b"\xff\xd9" in data[-4096:], b"\x89P": b"IEND" in data[-64:]}
        if not ends.get(data[:2], True):
            raise ValueError(f"it is cut short: {len(data)} bytes, no end mark")
        head = None if data.startswith(HDR) else _head(data)
        if head and head.mode == "CMYK":
            raise error(f"{path}: is of the colour space CMYK. Export it as RGB.")
        if head and head.format == "TGA":
            return np.asarray(head.convert("L" if head.mode in ("L", "LA", "1") else "RGB")), 255
        values = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        if values is None or values.dtype not in (np.uint8, np.uint16, np.float32):
            raise ValueError("corrupt, or of another kind")
        white = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1
        if head and head.format == "PPM" and isinstance(head.tile[0].args, tuple):
            # The greatest value that a header states: 4095 in a 12-bit file. Text of 8 bits OpenCV brings to 255.
            white = white if data[:2] in (b"P2", b"P3") and white == 255 else int(head.tile[0].args[-1])
        # OpenCV has blue first.
        return values if values.ndim == 2 else values[..., [2, 1, 0, 3][: values.shape[2]]], white


def _head(data: bytes) -> Any:
    """Return the picture as Pillow finds it, not decoded."""
    from PIL import Image

    # The check is ours: Pillow's own would warn of 90 megapixels.
    Image.MAX_IMAGE_PIXELS = None
    try:
        head = Image.open(io.BytesIO(data), formats=PILLOW)
    except Exception as error:
        raise ValueError("corrupt, or of another kind") from error
    check_size(*head.size, len(data))
    return head


def check_size(width: int, height: int, file_bytes: int) -> None:
    """Raise ValueError for a picture of a size that no camera takes, or that so small a file cannot hold."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if min(width, height) < 1 or width * height > min(MOST_PIXELS, TIGHTEST * file_bytes, memory // PIXEL_BYTES):
        raise ValueError(f"its header claims {width} x {height} px, the file has {file_bytes} bytes")

"""Pictures that are no RAW: PNG, TIFF, JPEG, TGA, PGM and OpenEXR to linear codes.

No colour profile is applied, no orientation: the sensor's pixels as they lie in the file.
"""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.photographs.photograph import Photograph, halve
from capture.session.globs import kind_of
from capture.session.session_types import Encoding
from formats.pictures import linear_from_srgb, read_exr
from scene.errors import CaptureError
from scene.frames import encode
from scene.image_files import check_header, pixels_of
from scene.reading import reading

FLOAT16_MAX = 65504.0

COPY = "Copy it from the camera again."


def read_image(path: Path, encoding: Encoding, *, half: bool = False) -> Photograph:
    """Read a picture, 8 or 16-bit PNG, TIFF, JPEG, TGA, PGM, PPM, BMP, OpenEXR or float TIFF.

    Gray is copied to three channels, alpha is dropped; `half` averages 2 x 2 pixels. CaptureError for a file that
    cannot be read, or is cut short.
    """
    values: NDArray
    if kind_of(path) == "exr":
        values, white = read_exr(path, _fault(path), CaptureError, do=COPY), 1
    else:
        values, white = _read_pixels(path)
    if values.dtype.kind == "f":
        if not np.isfinite(values).all():
            raise CaptureError(
                f"{path}: holds {np.sum(~np.isfinite(values))} values that are no numbers. Export again."
            )
        codes = np.clip(values, -FLOAT16_MAX, FLOAT16_MAX).astype(np.float16)
    else:
        codes = _codes_of_values(values.dtype, encoding, white)[values]
    if codes.ndim == 2:
        codes = np.repeat(codes[..., None], 3, axis=2)
    return Photograph(halve(codes) if half else codes)


def linear_of_values(values: NDArray, encoding: Encoding) -> NDArray[np.float64]:
    """Return linear light of coded values, both 0 to 1."""
    values = np.asarray(values, np.float64)
    if encoding == "linear":
        return values
    if encoding == "srgb":
        return linear_from_srgb(values)
    return values**encoding


def _codes_of_values(dtype: np.dtype, encoding: Encoding, white: int) -> NDArray[np.uint16]:
    """Return the table that takes every possible value of the file to its code."""
    values = np.arange(np.iinfo(dtype).max + 1) / white
    return encode(linear_of_values(np.minimum(values, 1.0), encoding))


def _read_pixels(path: Path) -> tuple[NDArray, int]:
    """Return values (H, W) or (H, W, 3) RGB as they lie in the file, and the value of white."""
    import cv2

    data = _bytes_of(path)
    suffix = path.suffix.lower()
    with reading(path, _fault(path), CaptureError, do=COPY):
        if suffix == ".tga":
            values = _pixels_of_tga(data)
        else:
            _check_end(path, data)
            # IGNORE_ORIENTATION: a camera that looks down guesses "up" anew for every frame.
            flags = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
            values = pixels_of(data, flags)[..., ::-1]
    if values.dtype not in (np.uint8, np.uint16, np.float32):
        raise CaptureError(f"{path}: found {values.dtype} pixels, expected 8 or 16 bits, or float32. Export again.")
    white = np.iinfo(values.dtype).max if values.dtype.kind == "u" else 1
    if suffix in (".pgm", ".ppm", ".pnm"):
        white = _pnm_white(data, white)
    return values, white


def _bytes_of(path: Path) -> bytes:
    with reading(path, error=CaptureError, do="Restore the file, or skip it."):
        data = path.read_bytes()
    if not data:
        raise CaptureError(f"{path}: is empty (0 bytes). Copy it from the camera again.")
    return data


def _fault(path: Path) -> str:
    return f"cannot be decoded: corrupt, or no {path.suffix} file"


def _check_end(path: Path, data: bytes) -> None:
    """Raise for a file cut short: the decoders fill the rest with gray and say nothing."""
    start = data[:8]
    cut = (start[:2] == b"\xff\xd8" and b"\xff\xd9" not in data[-4096:]) or (
        start == b"\x89PNG\r\n\x1a\n" and b"IEND" not in data[-64:]
    )
    if cut:
        raise CaptureError(f"{path}: is cut short ({len(data)} bytes, no end mark). Copy it from the camera again.")


def _pnm_white(data: bytes, otherwise: int) -> int:
    """Return the greatest value that a PGM or PPM header states: 4095 in a 12-bit file."""
    words: list[bytes] = []
    for line in data[:4096].split(b"\n"):
        words += line.split(b"#")[0].split()
        if len(words) >= 4:
            return int(words[3]) if words[3].isdigit() and 0 < int(words[3]) <= otherwise else otherwise
    return otherwise


def _pixels_of_tga(data: bytes) -> NDArray:
    from PIL import Image

    check_header(data)
    with Image.open(io.BytesIO(data), formats=["TGA"]) as image:
        gray = image.mode in ("L", "LA", "1")
        return np.asarray(image.convert("L" if gray else "RGB"))

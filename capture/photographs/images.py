"""Pictures that are no RAW: PNG, TIFF, JPEG, TGA, PGM and OpenEXR to linear codes.

No colour profile is applied, no orientation: the sensor's pixels as they lie in the file.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.photographs.photograph import Photograph, clip_level, half_floats, halve
from capture.session.session_types import Encoding
from formats.picture_files import linear_from_srgb, read_values
from scene.errors import CaptureError
from scene.frames import encode

STEP = 20
"""Powers of two between the scales of floating-point sessions: one whose values are between 0.001 and 1000 has 1."""


def read_image(path: Path, encoding: Encoding, *, half: bool = False, sensor_range: float | None = 1.0) -> Photograph:
    """Read a picture: TIFF of 1 to 16 bits or floating point, 8 or 16-bit PNG, JPEG, TGA, PGM, PPM, BMP, OpenEXR.

    Gray is copied to three channels, alpha is dropped; `half` averages 2 x 2 pixels. Floating point is divided by
    `sensor_range`, or, if that is None, by the power of two that brings this picture's values into half floats.
    CaptureError for a file that cannot be read, or is cut short.
    """
    fault = f"cannot be decoded: corrupt, or no {path.suffix} file"
    values, white = read_values(path, CaptureError, fault=fault, do="Copy it from the camera again.")
    if values.dtype.kind == "f":
        bad = np.count_nonzero(~np.isfinite(values))
        if bad:
            raise CaptureError(f"{path}: holds {bad} values that are no numbers. Export again.")
        sensor_range = _fitting_range(values) if sensor_range is None else sensor_range
        codes = half_floats(values / np.float32(sensor_range))
    else:
        sensor_range = None
        codes = _codes_of_values(values.dtype, encoding, white)[values]
    codes = np.repeat(codes[..., None], 3, axis=2) if codes.ndim == 2 else codes[..., :3]
    level = clip_level(codes)
    return Photograph(halve(codes, level) if half else codes, level, sensor_range)


def _codes_of_values(dtype: np.dtype, encoding: Encoding, white: int) -> NDArray[np.uint16]:
    """Return the table that takes every possible value of the file to its code."""
    values = np.minimum(np.arange(np.iinfo(dtype).max + 1) / white, 1.0)
    return encode(
        linear_from_srgb(values) if encoding == "srgb" else values if encoding == "linear" else values**encoding
    )


def _fitting_range(values: NDArray) -> float:
    """Return the power of two that stands for 1.0: half floats have five digits between 0.0001 and 65504 alone.

    A quantile tells it, since single pixels may be thousands of times brighter.
    """
    some = values[::4, ::4]
    lit = some[some > 0]
    return 2.0 ** (STEP * round(np.log2(float(np.quantile(lit, 0.99))) / STEP)) if lit.size else 1.0

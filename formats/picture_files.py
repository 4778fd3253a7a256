"""Pictures and arrays as linear float32; OpenEXR; the sRGB curve."""

import io
import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from formats.tiff_files import MOST_PIXELS, check_size, read_tiff
from scene.errors import RenderError, SceneError
from scene.files import write_whole
from scene.reading import array_of, reading, shortened

Picture = NDArray[np.float32]
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".hdr", ".npy")

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Y of linear sRGB (IEC 61966-2-1)."""

EXR = b"\x76\x2f\x31\x01"
PILLOW = ["PNG", "JPEG", "BMP", "PPM", "TGA", "GIF", "WEBP"]
KINDS = {"HALF": np.float16, "FLOAT": np.float32}
"""Of OpenEXR's channels. A third, UINT, holds numbers of objects and the like."""
READ = "Read is one picture: R, G, B or Y, of floating point. Export it alone."


def linear_from_srgb(values: Any) -> NDArray:
    """Return linear light of coded values, both 0 to 1 (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(values: Any) -> NDArray:
    """Return the sRGB code, 0 to 1, of linear light, cut to 0 to 1."""
    values = np.clip(values, 0, 1)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)


def srgb_profile() -> bytes:
    """Return sRGB as an ICC profile."""
    from PIL import ImageCms

    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def read_picture(path: Path, encoding: str | None = None) -> Picture:
    """Read a picture as linear float32 (h, w, 3), or (h, w, 1) where it has one channel.

    Parameters
    ----------
    path : Path
        One of `SUFFIXES`; .npy: (h, w), (h, w, 1) or (h, w, 3), first row above.
    encoding : {"linear", "srgb"} or None
        None: sRGB where the file holds whole numbers, linear where it holds floating point.

    Raises
    ------
    RenderError
        It cannot be read, holds values that are not finite or below 0, or has another number of channels.
    """
    if not path.is_file():
        raise RenderError(f"{path}: not found.")
    if path.suffix.lower() not in SUFFIXES:
        raise RenderError(f"{path}: not a picture that is read here; expected one of {', '.join(SUFFIXES)}.")
    values, white = read_values(path, RenderError)
    if values.ndim == 2:
        values = values[..., None]
    if values.ndim == 3 and values.shape[2] == 4:
        values = values[..., :3]
    if values.ndim != 3 or values.shape[2] not in (1, 3) or not values.size:
        raise RenderError(f"{path}: found an array of shape {values.shape}; expected height x width x 3 (or 1).")
    is_whole = np.issubdtype(values.dtype, np.integer)
    linear = values.astype(np.float32) / white
    bad = int(np.count_nonzero(~np.isfinite(linear) | (linear < 0)))
    if bad:
        raise RenderError(
            f"{path}: {bad} of {linear.size} values are not finite or below 0. Light and reflectance cannot be; mend "
            "the picture."
        )
    if encoding == "srgb" or (encoding is None and is_whole):
        linear = linear_from_srgb(linear)
    return np.ascontiguousarray(linear, np.float32)


def read_values(
    path: Path,
    error: type[SceneError] = SceneError,
    *,
    fault: str = "cannot be read as a picture",
    do: str = "Save it again.",
) -> tuple[NDArray, int]:
    """Return the values of a picture of any kind as they lie in the file, and that of white.

    What is decoded is not what a header claims beyond sense. No colour profile is applied, and no orientation. What a
    file is, but for .npy, is told by its first bytes, not by its name.

    Parameters
    ----------
    path : Path
    error, fault, do
        As in `scene.reading.reading`.

    Returns
    -------
    values : (H, W), (H, W, 3) RGB or, of PNG with alpha, (H, W, 4)
        uint8, uint16 or floating point.
    white : int
        1 of floating point.
    """
    with reading(path, fault, error, do=do):
        with path.open("rb") as file:
            start = file.read(4)
        if path.suffix.lower() == ".npy":
            values = array_of(path, "cannot be read as a picture", error)
            return values, np.iinfo(values.dtype).max if values.dtype.kind in "iu" else 1
        if start == EXR:
            return _read_exr(path, error), 1
        if start[:2] in (b"II", b"MM"):
            return read_tiff(path, error)
        return _read_others(path, error)


def _read_others(path: Path, error: type[SceneError]) -> tuple[NDArray, int]:
    """Return what `read_values` does of PNG, JPEG, BMP, PGM, PPM, TGA, and Radiance's HDR."""
    import cv2

    data = path.read_bytes()
    if not data:
        raise ValueError("it is empty")
    # The decoders fill the rest of a file cut short with gray, and say nothing.
    ends = {b"\xff\xd8": b"\xff\xd9" in data[-4096:], b"\x89P": b"IEND" in data[-64:]}
    if not ends.get(data[:2], True):
        raise ValueError(f"it is cut short: {len(data)} bytes, no end mark")
    # Radiance's files begin so; Pillow does not know them.
    head = None if data.startswith(b"#?") else _head(data)
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


def _read_exr(path: Path, error: type[SceneError]) -> NDArray:
    """Return R, G, B (h, w, 3), or a single channel (h, w), of an OpenEXR file's display window, as they are stored.

    What is stored beyond the display window is cut off. Where nothing is stored the picture is 0, as OpenEXR's own
    tools show it. Chromaticities are not applied, and alpha is dropped.
    """
    import OpenEXR

    parts = OpenEXR.File(os.fspath(path), header_only=True).parts
    if unlike := _unlike(parts):
        raise error(f"{path}: {unlike}. {READ}")
    stored, shown = (np.array(parts[0].header[key], np.int64) for key in ("dataWindow", "displayWindow"))
    (width, height), (wide, high) = (box[1] - box[0] + 1 for box in (stored, shown))
    check_size(int(width), int(height), path.stat().st_size)
    # A small data window may lie in a large display window.
    check_size(int(wide), int(high), MOST_PIXELS)
    first, end = np.maximum(stored[0], shown[0]), np.minimum(stored[1], shown[1]) + 1
    if np.any(first >= end):
        raise ValueError("its data window lies outside of its display window")
    # `File` would decode all channels of all parts, and would print what is damaged, and go on.
    file = OpenEXR.InputFile(os.fspath(path))
    names = _names(parts[0])
    types = [str(file.header()["channels"][name].type) for name in names]
    if not set(types) <= set(KINDS):
        raise error(f"{path}: holds whole numbers (channels of the type UINT). {READ}")
    kinds = [np.dtype(KINDS[name]) for name in types]
    values = np.zeros((high, wide, len(names)), max(kinds))
    (left, top), (right, bottom) = first - shown[0], end - shown[0]
    x, y = shown[0] - stored[0]
    for index, (plane, kind) in enumerate(zip(file.channels(names), kinds, strict=True)):
        part = np.frombuffer(plane, kind).reshape(height, width)[top + y : bottom + y, left + x : right + x]
        values[top:bottom, left:right, index] = part
    return values if len(names) == 3 else values[..., 0]


def _names(part: Any) -> list[str]:
    """Return which channels of an OpenEXR part are its picture, none if there is none."""
    names = [channel.name for channel in part.header["channels"]]
    if {"R", "G", "B"} <= set(names):
        return ["R", "G", "B"]
    # Z is the distance.
    return names if len(names) == 1 and names != ["Z"] else ["Y"] * ("Y" in names and "RY" not in names)


def _unlike(parts: list[Any]) -> str:
    """Return what about an OpenEXR file is not read, nothing if all is."""
    import OpenEXR

    pictures = [bool(_names(part)) for part in parts]
    channels = parts[0].header["channels"]
    if sum(pictures) > 1 or not pictures[0]:
        names = shortened(", ".join(one.name for one in channels))
        return f"holds {len(parts)} part{'s' * (len(parts) > 1)}; the channels of the first are {names}"
    if parts[0].type() not in (OpenEXR.scanlineimage, OpenEXR.tiledimage):
        return "holds deep pixels"
    if any(one.xSampling * one.ySampling != 1 for one in channels if one.name in _names(parts[0])):
        return "holds channels of fewer pixels than the picture (sampling)"
    return ""


def write_exr(path: Path, picture: Picture) -> None:
    """Write (h, w, 3), (h, w, 1) or (h, w) as 32-bit OpenEXR."""
    import OpenEXR

    values = np.ascontiguousarray(picture, np.float32)
    channels = {"RGB": values} if values.shape[2:] == (3,) else {"Y": values.reshape(values.shape[:2])}
    with write_whole(path) as file:
        OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, channels).write(file)

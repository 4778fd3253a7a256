"""Pictures and arrays as linear float32; OpenEXR; the sRGB curve."""

import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError, SceneError
from scene.files import in_place
from scene.image_files import check_header, read_pixels
from scene.reading import array_of, reading, shortened

Picture = NDArray[np.float32]
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".hdr", ".npy")

_THREADS = threading.Lock()


def linear_from_srgb(values: Any) -> NDArray:
    """Return linear light of coded values, both 0 to 1 (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(values: Any) -> NDArray:
    """Return the sRGB code, 0 to 1, of linear light, cut to 0 to 1."""
    values = np.clip(values, 0, 1)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * values ** (1 / 2.4) - 0.055)


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
    values = _read(path)
    if values.ndim == 2:
        values = values[..., None]
    if values.ndim == 3 and values.shape[2] == 4:
        values = values[..., :3]
    if values.ndim != 3 or values.shape[2] not in (1, 3) or not values.size:
        raise RenderError(f"{path}: found an array of shape {values.shape}; expected height x width x 3 (or 1).")
    is_whole = np.issubdtype(values.dtype, np.integer)
    linear = values.astype(np.float32) / (np.iinfo(values.dtype).max if is_whole else 1)
    bad = int(np.count_nonzero(~np.isfinite(linear) | (linear < 0)))
    if bad:
        raise RenderError(
            f"{path}: {bad} of {linear.size} values are not finite or below 0. Light and reflectance cannot be; mend "
            "the picture."
        )
    if encoding == "srgb" or (encoding is None and is_whole):
        linear = linear_from_srgb(linear)
    return np.ascontiguousarray(linear, np.float32)


def _read(path: Path) -> NDArray:
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return array_of(path, "cannot be read as a picture", RenderError)
    if suffix == ".exr":
        return read_exr(path, "cannot be read as a picture", RenderError, do="Save it again.")
    import cv2

    image = read_pixels(path, cv2.IMREAD_UNCHANGED, RenderError)
    return image if image.ndim == 2 else np.asarray(image[..., :3][..., ::-1])


def read_exr(path: Path, fault: str, error: type[SceneError], *, do: str) -> Picture:
    """Return the channels R, G, B (h, w, 3) or Y (h, w) of an OpenEXR file; see `scene.reading.reading`."""
    import mitsuba

    _have_threads()
    with reading(path, fault, error, do=do):
        data = path.read_bytes()
        if not data:
            raise ValueError("it is empty")
        check_header(data)
        # Mitsuba brings a full OpenEXR reader; OpenCV's wheels have lost theirs.
        bitmap: Any = mitsuba.Bitmap(os.fspath(path))
        names = [field.name for field in bitmap.struct_()]
        values = np.array(bitmap, np.float32)
    values = values.reshape(*values.shape[:2], -1)
    if {"R", "G", "B"} <= set(names):
        return values[..., [names.index(name) for name in "RGB"]]
    if len(names) == 1 or "Y" in names:
        return values[..., names.index("Y") if "Y" in names else 0]
    raise error(
        f"{path}: holds the channels {shortened(', '.join(names))}, expected R, G, B or Y. Export the picture alone."
    )


def write_exr(path: Path, picture: Picture) -> None:
    """Write (h, w, 3) or (h, w, 1) as 32-bit OpenEXR."""
    import mitsuba

    _have_threads()
    with in_place(path) as temporary:
        mitsuba.Bitmap(np.ascontiguousarray(picture, np.float32)).write(os.fspath(temporary))


def _have_threads() -> None:
    """Give Mitsuba's OpenEXR a thread to wait for: on one core, or kept to one, it would wait for ever."""
    import drjit

    with _THREADS:
        if drjit.thread_count() < 2:
            drjit.set_thread_count(2)

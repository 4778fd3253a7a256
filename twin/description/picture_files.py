"""Textures and environment maps: pictures and arrays as linear float32."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.files import in_place
from scene.image_files import check_header, read_pixels
from scene.reading import array_of, reading
from twin.description.mesh_files import linear_from_srgb

Picture = NDArray[np.float32]
SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".exr", ".hdr", ".npy")


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
        with reading(path, "cannot be read as a picture", RenderError, do="Save it again."):
            check_header(path.read_bytes())
            return _read_exr(path)
    import cv2

    image = read_pixels(path, cv2.IMREAD_UNCHANGED, RenderError)
    return image if image.ndim == 2 else np.asarray(image[..., :3][..., ::-1])


def _read_exr(path: Path) -> NDArray:
    import mitsuba as mi

    from twin.engines.variant import pick_variant

    mi.set_variant(pick_variant()[0])  # type: ignore[attr-defined]
    _have_threads()
    bitmap = mi.Bitmap(os.fspath(path))
    one = bitmap.channel_count() < 3
    form = mi.Bitmap.PixelFormat.Y if one else mi.Bitmap.PixelFormat.RGB
    return np.array(bitmap.convert(form, mi.Struct.Type.Float32, srgb_gamma=False))


def write_exr(path: Path, picture: Picture) -> None:
    """Write (h, w, 3) or (h, w, 1) as 32-bit OpenEXR."""
    import mitsuba as mi

    _have_threads()
    with in_place(path) as temporary:
        mi.Bitmap(np.ascontiguousarray(picture, np.float32)).write(os.fspath(temporary))


def _have_threads() -> None:
    """Give Mitsuba's OpenEXR a thread to wait for: on one core, or kept to one, it would wait for ever."""
    import drjit

    drjit.set_thread_count(max(drjit.thread_count(), 2))

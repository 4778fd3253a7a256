"""RAW photographs to linear codes: the same arithmetic for every frame, whatever is in it.

LibRaw's ready-made decode scales each frame by that frame's own brightest pixel (`adjust_maximum_thr`), up to
1.33 times, and a chrome highlight sets it off. Here nothing depends on the picture: black level and white level
come from the file's header, the white level of the session's first frame holds for all.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.photographs.dng import DO, compression_of, plain_dng
from capture.photographs.photograph import Photograph, halve, mean_of
from scene.errors import CaptureError
from scene.frames import PEDESTAL, WHITE, encode
from scene.reading import reading

BAND_ROWS = 512
"""Rows that are demosaiced at once: the working memory stays in the processor's cache. Even: Bayer's period is 2."""


def read_raw(path: Path, *, sensor_range: float | None = None, half: bool = False) -> Photograph:
    """Decode a RAW file of any kind that LibRaw reads: the sensor's own colours, no white balance, not turned.

    linear = (DN - black of the channel) / sensor_range; negative noise is kept. `sensor_range` is the DN between black
    and 1.0, this file's own white level less its black level if None. Missing colours of a Bayer mosaic are the means
    of the nearest neighbours (bilinear): an edge-adaptive method would bend radiometry. `half`: 2 x 2 superpixels (R,
    the mean of both G, B) instead. CaptureError for a file that is corrupt, cut short, or no RAW file.
    """
    import rawpy

    with reading(path, error=CaptureError):
        is_there = path.is_file() and path.stat().st_size
    if not is_there:
        raise CaptureError(f"{path}: is missing or empty. Copy it from the camera again.")
    do = "Copy it from the camera again, or list it under frames.skip."
    fault = "cannot be decoded: corrupt, cut short, or no RAW file"
    with reading(path, fault, CaptureError, do=do):
        try:
            source, unit = plain_dng(path) or (str(path), 1.0)
            opened = rawpy.imread(source)
        except rawpy.LibRawFileUnsupportedError as error:
            raise CaptureError(
                f"{path}: is no RAW file, or of a kind that LibRaw does not read ({compression_of(path)}). {DO} If no "
                "other program opens it either, copy it from the camera again."
            ) from error
    with reading(path, fault, CaptureError, do=do), opened as raw:
        black = [float(level) for level in raw.black_level_per_channel]
        white = float(raw.white_level)
        # Stacks of three colours fill only three of the four levels.
        own_range = (white - max(black[:3])) / unit
        if own_range <= 0:
            raise CaptureError(f"{path}: states black level {black} above white level {white}. The file is broken.")
        sensor_range = sensor_range or own_range
        scale = sensor_range * unit
        pattern = raw.raw_pattern
        if raw.raw_type == rawpy.RawType.Stack:
            # Every colour at every pixel: LinearRaw DNG, Foveon.
            image, is_mosaic = raw.raw_image_visible, False
            codes = np.stack([_code_table(black[i], scale)[image[..., i]] for i in range(3)], axis=-1)
            codes = halve(codes) if half else codes
        elif pattern is not None and pattern.shape == (2, 2) and raw.color_desc == b"RGBG":
            mosaic, site_black = raw.raw_image_visible, np.asarray(black)[pattern]
            letters = "".join("RGBG"[i] for i in pattern.ravel())
            if sorted(letters) != ["B", "G", "G", "R"]:
                raise ValueError(f"its colour filter is {letters}")
            decode = _superpixels if half else _bilinear
            codes, is_mosaic = decode(mosaic, site_black, letters, scale), not half
        else:
            codes, is_mosaic = _codes_by_libraw(raw, black, white, scale), not half
            codes = halve(codes) if half else codes
    return Photograph(codes, min(own_range / sensor_range, 1.0), sensor_range, is_mosaic)


@lru_cache(maxsize=16)
def _code_table(black: float, scale: float) -> NDArray[np.uint16]:
    """Return (65536,) uint16: the code of every DN."""
    return encode((np.arange(65536) - black) / scale)


def _coded(mosaic: NDArray, site_black: NDArray, scale: float) -> NDArray[np.uint16]:
    """Return the mosaic as codes; `site_black` (2, 2) is the black level of each Bayer site."""
    if np.ptp(site_black) == 0:
        return _code_table(float(site_black[0, 0]), scale)[mosaic]
    out = np.zeros_like(mosaic)
    for row in (0, 1):
        for column in (0, 1):
            sites = np.s_[row::2, column::2]
            out[sites] = _code_table(float(site_black[row, column]), scale)[mosaic[sites]]
    return out


def _bilinear(mosaic: NDArray, site_black: NDArray, letters: str, scale: float) -> NDArray[np.uint16]:
    """Return (H, W, 3) codes of a Bayer mosaic (H, W); `letters` names the colours of the top left 2 x 2."""
    import cv2

    conversion = getattr(cv2, f"COLOR_Bayer{letters}2RGB")
    height, width = mosaic.shape
    out = np.zeros((height, width, 3), np.uint16)
    for start in range(0, height, BAND_ROWS):
        stop = min(start + BAND_ROWS, height)
        first, last = max(start - 2, 0), min(stop + 2, height)
        top, bottom = 2 - (start - first), 2 - (last - stop)
        band = _coded(mosaic[first:last], site_black, scale)
        # OpenCV copies its outermost ring from the next one; two mirrored rows and columns keep Bayer's
        # phase and make that ring fall outside.
        band = cv2.copyMakeBorder(band, top, bottom, 2, 2, cv2.BORDER_REFLECT_101)
        out[start:stop] = cv2.demosaicing(band, conversion)[2:-2, 2:-2]
    return out


def _superpixels(mosaic: NDArray, site_black: NDArray, letters: str, scale: float) -> NDArray[np.uint16]:
    """Return (H // 2, W // 2, 3) codes: each 2 x 2 of the mosaic becomes one pixel."""
    height, width = mosaic.shape[0] // 2 * 2, mosaic.shape[1] // 2 * 2
    codes = _coded(mosaic[:height, :width], site_black, scale)
    sites = [codes[row::2, column::2] for row in (0, 1) for column in (0, 1)]
    greens = [site for site, letter in zip(sites, letters, strict=True) if letter == "G"]
    return np.stack([sites[letters.index("R")], mean_of(greens), sites[letters.index("B")]], axis=-1)


def _codes_by_libraw(raw: Any, black: list[float], white: float, scale: float) -> NDArray[np.uint16]:
    """Return codes of any other mosaic (X-Trans, monochrome) by LibRaw's own linear interpolation, locked.

    Black is not subtracted by LibRaw, which would cut negative noise; and its `user_sat` counts from there.
    """
    import rawpy

    # One level for all is exact only if the channels agree; else they keep their offset of a few DN.
    level = float(np.mean(black[:3]))
    image = raw.postprocess(
        demosaic_algorithm=rawpy.DemosaicAlgorithm.LINEAR,
        user_black=0,
        user_cblack=[0, 0, 0, 0],
        user_sat=int(white),
        user_wb=[1, 1, 1, 1],
        output_color=rawpy.ColorSpace.raw,
        gamma=(1, 1),
        no_auto_bright=True,
        adjust_maximum_thr=0,
        output_bps=16,
        user_flip=0,
    )
    dn = np.arange(65536) * (white / 65535)
    table = np.clip(np.round((dn - level) / scale * (WHITE - PEDESTAL)) + PEDESTAL, 0, 65535).astype(np.uint16)
    codes = table[image].reshape(*image.shape[:2], -1)
    # A sensor without colour filters gives one value a pixel.
    return codes if codes.shape[2] == 3 else np.repeat(codes[..., :1], 3, axis=2)

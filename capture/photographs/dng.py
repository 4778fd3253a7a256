"""DNG files that LibRaw refuses or misreads, decoded by tifffile and handed to it as uncompressed whole numbers."""

import io
import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from formats.tiff_files import FLOAT, JPEG, named, pictures_in, samples_of
from scene.errors import CaptureError

LOSSY = 34892
"""Compression by JPEG's DCT: LibRaw takes its values for sRGB, unless a polynomial tells their curve."""
TABLE, POLYNOMIAL = 7, 8
"""Operations of OpcodeList2 that bend the stored values. LibRaw knows the second, in lossy files alone."""
FILTERED, LINEAR = 32803, 34892
"""PhotometricInterpretation of a mosaic, and of a file with every colour at every pixel."""
BLACK, WHITE = 50714, 50717
KEPT = (33421, 33422, *range(50706, 50723), 50728, 50829)
"""What LibRaw asks for: colour filters; version, model, levels, first matrix; neutral; active area."""
PEDESTAL = 2048
"""Black level of what was floating point: noise below black stays."""
DO = "Convert it by Adobe's DNG Converter, without lossy compression, compatible with DNG 1.6."


def plain_dng(path: Path) -> tuple[io.BytesIO, float] | None:
    """Return a DNG file as LibRaw reads it, and how many of its DN are one of the file's; None if it reads the file.

    LibRaw would make whole numbers of floating point by each frame's own brightest sample. Here white level becomes
    65535: what is above it counts as clipped, as the DNG standard has it.

    Raises
    ------
    CaptureError
        Its values are compressed, or bent by a curve, in a way that is not known here either.
    ValueError, and whatever tifffile raises
        It is damaged.
    """
    import tifffile

    with path.open("rb") as data:
        if data.read(2) not in (b"II", b"MM"):
            return None
    with tifffile.TiffFile(path) as file:
        first: Any = file.pages.first
        page = pictures_in(file)[0]
        if 50706 not in first.tags or _is_for_libraw(page):
            return None
        if not _is_known(page):
            raise CaptureError(f"{path}: is a DNG of a kind that is not read ({compression_of(path)}). {DO}")
        values = samples_of(page)
        tags = {tag.code: (tag.code, int(tag.dtype), tag.count, tag.value) for tag in (*first.tags, *page.tags)}
    for axis, code in enumerate((50975, 52547)):
        # Rows and columns that lie apart, each kind of colour filter by itself.
        fields, count = tags.get(code, (code, 4, 1, 1))[-1], values.shape[axis]
        order = np.concatenate([np.arange(count)[start::fields] for start in range(fields)])
        values = np.take(values, np.argsort(order), axis)
    scale = 1.0
    if page.sampleformat == FLOAT:
        if not np.isfinite(values).all():
            raise CaptureError(f"{path}: holds values that are no numbers. Export again.")
        white, black = (_numbers(tags.get(code), value) for code, value in ((WHITE, 1.0), (BLACK, 0.0)))
        scale = (65535 - PEDESTAL) / float(white.min())
        values = np.clip(np.round(values.astype(np.float32) * scale + PEDESTAL), 0, 65535).astype(np.uint16)
        levels = np.round(black * scale + PEDESTAL).astype(int)
        tags |= {WHITE: (WHITE, 4, 1, 65535), BLACK: (BLACK, 4, len(levels), levels.tolist())}
    if values.ndim == 2 and page.photometric == LINEAR:
        values = np.repeat(values[..., None], 3, axis=2)
    plain = io.BytesIO()
    extra = [(*tags[code], True) for code in KEPT if code in tags]
    tifffile.imwrite(plain, values, photometric=page.photometric, metadata=None, extratags=extra)
    plain.seek(0)
    return plain, scale


def compression_of(path: Path) -> str:
    """Return in words how a RAW file is compressed, as far as its tags tell."""
    import tifffile

    with suppress(Exception), tifffile.TiffFile(path) as file:
        page = pictures_in(file)[0]
        kind = f"compression {int(page.compression)}, {named(page.compression)}"
        return kind + ", values bent by a curve" * bool({TABLE, POLYNOMIAL} & _operations(page))
    # No TIFF file, or a damaged one.
    return "its tags do not tell which"


def _is_for_libraw(page: Any) -> bool:
    if page.sampleformat == FLOAT or page.photometric not in (FILTERED, LINEAR):
        return page.sampleformat != FLOAT
    without_loss = page.compression == 1 or (page.compression == JPEG and page.bitspersample != 8)
    return without_loss or (page.compression == LOSSY and POLYNOMIAL in _operations(page))


def _is_known(page: Any) -> bool:
    import tifffile

    if page.sampleformat == FLOAT:
        # tifffile undoes no predictor of 24 bits; the levels of single columns and rows would have to be scaled too.
        fits = (page.bitspersample != 24 or page.predictor == 1) and not {50715, 50716} & {
            tag.code for tag in page.tags
        }
    else:
        fits = page.bitspersample <= (8 if page.compression == LOSSY else 16)
    is_decoded = page.compression == 1 or page.compression in tifffile.TIFF.DECOMPRESSORS
    return fits and is_decoded and page.dtype is not None and not {TABLE, POLYNOMIAL} & _operations(page)


def _operations(page: Any) -> set[int]:
    """Return the numbers of what OpcodeList2 demands to be done to the stored values."""
    data, found, place = page.tags.valueof(51009, default=b""), set(), 4
    while place + 16 <= len(data):
        number, length = struct.unpack_from(">I8xI", data, place)
        found.add(number)
        place += 16 + length
    return found


def _numbers(tag: Any, otherwise: float) -> np.ndarray:
    """Return a tag's numbers; a fraction is two whole numbers."""
    values = np.atleast_1d(np.array(otherwise if tag is None else tag[-1], float))
    return values[::2] / values[1::2] if tag is not None and tag[1] in (5, 10) else values

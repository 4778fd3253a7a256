"""TIFF files: what a picture is, is read from its tags; tifffile decodes it, and applies none of them.

Maps of an object are written as measuring and mapping programs open them: values, and the size of a pixel.
"""

import json
import logging
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scene.errors import SceneError
from scene.files import write_text, write_whole

# What it would print of damaged headers, the reader says in one message.
logging.getLogger("tifffile").addHandler(logging.NullHandler())

COPY = 0b1101
"""Bits of NewSubfileType: a reduced copy, a mask, a map of depths. None of them is the picture."""
ALIKE = 0.3
"""Share of the largest page's area from which another page is a picture too: a pyramid's next level has a quarter."""
PHOTOMETRIC, YCBCR, JPEG, FLOAT = 262, 6, 7, 3
CENTIMETRE = 3
"""ResolutionUnit [Adobe1992]."""
SAMPLES = {0: 1, 1: 1, 2: 3, 3: 1, YCBCR: 3}
"""Of a pixel, by PhotometricInterpretation: MinIsWhite, MinIsBlack, RGB, palette; YCbCr, undone by JPEG's decoder."""
MOST_PIXELS = 600_000_000
"""No camera has more, with its pixels shifted neither."""
TIGHTEST = 4000
"""Pixels that a byte of a file can stand for, at most: deflate packs 1032 to 1, LZW and JPEG to the same order."""
PIXEL_BYTES = 16
"""Of memory that a pixel takes while it is decoded: its values, and its codes."""
READ = (
    "Read are files of one picture: gray, palette or RGB, of 1 to 16 bits or floating point. Export it as such a one."
)


def read_tiff(path: Path, error: type[SceneError]) -> tuple[NDArray, int]:
    """Return a picture as it lies in the file, and the value of white.

    Orientation and alpha are not applied: the stored colours, alpha dropped. A palette is, MinIsWhite is undone.

    Returns
    -------
    values : (H, W) or (H, W, 3)
        RGB; uint8, uint16 or float32.
    white : int
        The greatest value that the stored bits can hold, 1 of floating point. What MaxSampleValue says is not used:
        programs write each picture's own maximum there.

    Raises
    ------
    SceneError
        Of the type `error`: it is of a kind that is not read.
    ValueError, and whatever tifffile raises
        It is damaged.
    """
    import tifffile

    with tifffile.TiffFile(path) as file:
        page, *others = pictures_in(file)
        if unlike := _unlike(file, page, others):
            raise error(f"{path}: {unlike}. {READ}")
        values = samples_of(page)
        colors = page.colormap
    kind, white = page.photometric, 1
    if values.ndim == 3:
        values = values[..., : SAMPLES[kind]] if SAMPLES[kind] == 3 else values[..., 0]
    if page.nodata and (missing := np.count_nonzero(values == page.nodata)):
        raise error(f"{path}: {missing} values are {page.nodata}, its mark of missing data. Export it without gaps.")
    if page.sampleformat == FLOAT:
        return values.astype(np.float32, copy=False), white
    white = 2**page.bitspersample - 1
    values = values.astype(np.uint8 if white < 256 else np.uint16, copy=False)
    if kind == tifffile.PHOTOMETRIC.MINISWHITE:
        values = values.dtype.type(white) - values
    if kind == tifffile.PHOTOMETRIC.PALETTE:
        # Of 16 bits, though some programs write 8.
        colors = (colors >> 8 if colors.max() > 255 else colors).astype(np.uint8)
        values, white = np.ascontiguousarray(colors.T)[values], 255
    return values, white


def pictures_in(file: Any) -> list[Any]:
    """Return a tifffile.TiffFile's pages and their sub-pages that are no copies, the largest first."""
    # By their number: to iterate over them would never end where a damaged file's last page names its first.
    pages = [file.pages[index] for index in range(len(file.pages))]
    pages += [page.pages[index] for page in pages for index in range(len(page.pages or ()))]
    whole = [page for page in pages if not page.subfiletype & COPY] or pages
    return sorted(whole, key=_area, reverse=True)


def samples_of(page: Any) -> NDArray:
    """Return a page's samples (H, W) or (H, W, S), decoded; ValueError where the file lacks a part of them."""
    size = page.parent.filehandle.size
    check_size(page.imagewidth, page.imagelength, size)
    starts, lengths = page.dataoffsets, page.databytecounts
    ends = [start + length for start, length in zip(starts, lengths, strict=True) if min(start, length) > 0]
    if len(ends) < math.prod(page.chunked) or max(ends) > size:
        raise ValueError(f"it is cut short: {size} bytes do not hold all of its strips or tiles")
    values = page.asarray()
    if page.axes == "SYX":
        values = np.moveaxis(values, 0, -1)
    return np.ascontiguousarray(values)


def check_size(width: int, height: int, file_bytes: int) -> None:
    """Raise ValueError for a picture of a size that no camera takes, or that so small a file cannot hold."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if min(width, height) < 1 or width * height > min(MOST_PIXELS, TIGHTEST * file_bytes, memory // PIXEL_BYTES):
        raise ValueError(f"its header claims {width} x {height} px, the file has {file_bytes} bytes")


def _unlike(file: Any, page: Any, others: list[Any]) -> str:
    """Return what about a file's picture is not read, nothing if all is."""
    import tifffile

    kind, bits, form = named(page.photometric), page.bitspersample, page.sampleformat
    pages = 1 + sum(_area(other) > ALIKE * _area(page) for other in others)
    # Some programs write one page, and what lies behind it in the file.
    behind = [math.prod(told.get("shape", ())) // page.size for told in file.shaped_metadata or ()]
    count = max(pages, page.imagedepth, (file.imagej_metadata or {}).get("images", 1), *behind)
    if count > 1:
        return (
            f"holds {count} pictures (pages) of about {page.imagewidth} x {page.imagelength} px, perhaps one a colour"
        )
    if page.compression != 1 and page.compression not in tifffile.TIFF.DECOMPRESSORS:
        return f"is compressed by {named(page.compression)}, which is not decoded here"
    if page.photometric not in SAMPLES or (page.photometric == YCBCR and page.compression != JPEG):
        return f"is of the colour space {kind}"
    least = SAMPLES[page.photometric]
    if PHOTOMETRIC not in page.tags or not least <= page.samplesperpixel <= least + 1:
        return f"has {page.samplesperpixel} samples a pixel, expected {least} of {kind}, and perhaps one of alpha"
    fits = page.photometric in (1, 2) if form == FLOAT else form == 1 and isinstance(bits, int) and bits <= 16
    if not fits or page.dtype is None:
        return f"holds {kind} values of {bits} bits, SampleFormat {named(form)}"
    return ""


def _area(page: Any) -> int:
    return page.imagewidth * page.imagelength


def named(value: Any) -> str:
    """Return the name of a tag's value, the value itself where it has none."""
    return str(getattr(value, "name", value))


def write_map(
    path: Path, values: NDArray, told: Mapping[str, Any], pixel_mm: float | None, *, world_mm: float = 1.0, **tags: Any
) -> list[Path]:
    """Write a map as TIFF, and a world file beside it where a pixel has a size; return both.

    Parameters
    ----------
    path : Path
        .tif
    values : (H, W) or (H, W, 3), uint16 or float32
        NaN where unknown, of whole numbers 0.
    told : mapping
        What the values mean: JSON in the tag ImageDescription.
    pixel_mm : float or None
        On the object. It goes into XResolution and YResolution, pixels a centimetre, and into the .tfw: x to the right
        and y up, from the middle of the picture's first pixel.
    world_mm : float
        Unit of the .tfw.
    **tags
        Of `tifffile.imwrite`, as `iccprofile`.
    """
    import tifffile

    kind = "rgb" if values.ndim == 3 else "minisblack"
    size = {} if pixel_mm is None else {"resolution": (10 / pixel_mm,) * 2, "resolutionunit": CENTIMETRE}
    with write_whole(path) as file:
        tifffile.imwrite(
            file, np.ascontiguousarray(values), photometric=kind, description=json.dumps(told), metadata=None,
            compression="zlib", predictor=values.dtype.kind == "u", software="rgbn", **size, **tags,
        )  # fmt: skip
    world = path.with_suffix(".tfw")
    if pixel_mm is None:
        return [path]
    # Across, two turns, down, and the middle of the first pixel.
    pixel = pixel_mm / world_mm
    write_text(world, "".join(f"{number:.9g}\n" for number in (pixel, 0, 0, -pixel, 0, 0)))
    return [path, world]

"""What the camera wrote beside the picture: exposure, lens. Absent EXIF is normal.

Tags are read by EXIF's names, whatever the file, by tifffile. Most RAW files are TIFF. Others hold blocks of TIFF: JPEG
and .raf behind "Exif", .cr3 in the boxes CMT1 and CMT2, .mrw in TTW, PNG in the chunk eXIf.
"""

import io
import logging
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

# What it would print of damaged blocks is no news: they hold no tags.
logging.getLogger("tifffile").addHandler(logging.NullHandler())

HEAD = 1 << 20
"""Bytes at a file's beginning and at its end in which its blocks begin."""
MOST = 500
"""Of blocks, and of a tag's values: a damaged file can promise any number."""
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
BLOCK = re.compile(rb"(?:Exif\0\0|CMT[12]|\0TTW....|eXIf)(?=II\*\0|MM\0\*)", re.DOTALL)
PANASONIC_ISO = {"55": "ISOSpeedRatings", "23": "ISOSpeedRatings"}
"""Tags 0x37 and 0x17 of .rw2, which have no name elsewhere."""
MOST_ISO = 65535
"""Stands where the sensitivity has more than 16 bits; then another tag has it."""


@dataclass(frozen=True)
class Exif:
    """One photograph's settings; None where the file is silent.

    Parameters
    ----------
    aperture : float or None
        f-number.
    focal_mm, focal_35mm : float or None
        The lens' focal length, and what it would be on 36 x 24 mm.
    pixels_per_mm : (x, y) or None
        Focal-plane resolution, of a picture `width_px` wide.
    subject_mm : float or None
        What the lens is focused at.
    camera : str or None
        Maker and model.
    """

    exposure_s: float | None = None
    iso: float | None = None
    aperture: float | None = None
    focal_mm: float | None = None
    focal_35mm: float | None = None
    pixels_per_mm: tuple[float, float] | None = None
    width_px: int | None = None
    subject_mm: float | None = None
    camera: str | None = None


def read_exif(path: Path) -> Exif:
    """Return the EXIF of a photograph, all None where there is none. Never raises for what it cannot read."""
    # The picture is what counts.
    with suppress(Exception):
        return _exif_of_tags(tags_in(path))
    return Exif()


def _exif_of_tags(tags: Mapping[str, Any]) -> Exif:
    unit_mm = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}.get(int(_number(tags, "FocalPlaneResolutionUnit") or 2))
    x, y = _number(tags, "FocalPlaneXResolution"), _number(tags, "FocalPlaneYResolution")
    distance = _number(tags, "SubjectDistance")
    # The first picture of a RAW file may be a small one.
    width = _number(tags, "PixelXDimension", "ImageWidth" if not tags.get("NewSubfileType") else "")
    iso = _number(tags, "ISOSpeedRatings")
    if iso in (None, MOST_ISO):
        iso = _number(tags, "RecommendedExposureIndex", "StandardOutputSensitivity", "ISOSpeed")
    return Exif(
        exposure_s=_number(tags, "ExposureTime"),
        iso=iso,
        aperture=_number(tags, "FNumber"),
        focal_mm=_number(tags, "FocalLength"),
        focal_35mm=_number(tags, "FocalLengthIn35mmFilm"),
        pixels_per_mm=(x / unit_mm, (y or x) / unit_mm) if x and unit_mm else None,
        width_px=int(width) if width else None,
        # All bits set: infinity.
        subject_mm=1000 * distance if distance and distance < 4e6 else None,
        camera=" ".join(str(tags.get(name, "")).strip(" \0") for name in ("Make", "Model")).strip() or None,
    )


def _number(tags: Mapping[str, Any], *names: str) -> float | None:
    """Return the first positive number among tags: cameras write 0 for "not known"."""
    for name in names:
        value: Any = tags.get(name)
        try:
            # Several sensitivities, or a fraction.
            above, below = (value[0], 1 if "ISO" in name else value[1]) if isinstance(value, tuple) else (value, 1)
            number = float(above) / float(below)
        except (ValueError, ZeroDivisionError, TypeError, IndexError):
            continue
        if 0 < number < float("inf"):
            return number
    return None


def tags_in(path: Path) -> dict[str, Any]:
    """Return {EXIF's name: value}: a number, a text, (numerator, denominator), or a tuple of numbers."""
    import tifffile

    with open(path, "rb") as file:
        data = file.read(HEAD)
        blocks: list[BinaryIO] = [file] if data[:2] in (b"II", b"MM") else []
        if data[:4] not in TIFF:
            file.seek(max(HEAD, path.stat().st_size - HEAD))
            data += file.read()
            ends = [found.end() for found in BLOCK.finditer(data)][:MOST]
            blocks += [io.BytesIO(data[end:][:HEAD]) for end in ends]
        found: dict[str, Any] = {}
        for block in reversed(blocks):
            block.seek(0)
            # A maker's malformed block breaks parsers in many ways; the others still count.
            with suppress(Exception), tifffile.TiffFile(block) as file:
                tags = file.pages.first.tags
                exif = tags.valueof("ExifTag", {})
                plain = {PANASONIC_ISO.get(tag.name, tag.name): tag.value for tag in tags if tag.count < MOST}
                found |= plain | dict(exif if isinstance(exif, Mapping) else {})
        return found

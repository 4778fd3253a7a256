"""What the camera wrote beside the picture: exposure, lens, clock. Absent EXIF is normal."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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
    taken : str or None
        "2026-11-21 09:30:12.34", with the fraction when the camera gives one.
    camera : str or None
        Maker and model.
    orientation : int or None
        1 to 8; never applied to the pixels.
    """

    exposure_s: float | None = None
    iso: float | None = None
    aperture: float | None = None
    focal_mm: float | None = None
    focal_35mm: float | None = None
    pixels_per_mm: tuple[float, float] | None = None
    width_px: int | None = None
    subject_mm: float | None = None
    taken: str | None = None
    camera: str | None = None
    orientation: int | None = None


def read_exif(path: Path) -> Exif:
    """Return the EXIF of a photograph, all None where there is none. Never raises for what it cannot read."""
    from capture.camera.exif_tags import tags_in

    try:
        return _exif_of_tags(tags_in(path))
    except Exception:
        # The picture is what counts.
        return Exif()


def _exif_of_tags(tags: Mapping[str, Any]) -> Exif:
    unit_mm = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}.get(int(_number(tags, "FocalPlaneResolutionUnit") or 2))
    x, y = _number(tags, "FocalPlaneXResolution"), _number(tags, "FocalPlaneYResolution")
    distance = _number(tags, "SubjectDistance")
    # The first picture of a RAW file may be a small one.
    width = _number(tags, "PixelXDimension", "ImageWidth" if not tags.get("NewSubfileType") else "")
    iso, orientation = _number(tags, "ISOSpeedRatings"), _number(tags, "Orientation")
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
        taken=_time(tags),
        camera=" ".join(word for word in (_text(tags, "Make"), _text(tags, "Model")) if word) or None,
        orientation=int(orientation) if orientation else None,
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


def _text(tags: Mapping[str, Any], name: str) -> str:
    return str(tags.get(name, "")).strip(" \0")


def _time(tags: Mapping[str, Any]) -> str | None:
    for name, fraction in (
        ("DateTimeOriginal", "SubsecTimeOriginal"),
        ("DateTimeDigitized", "SubsecTimeDigitized"),
        ("DateTime", "SubsecTime"),
    ):
        stamp = _text(tags, name)
        if len(stamp) >= 19 and stamp[:4] != "0000":
            digits = _text(tags, fraction)
            return stamp[:10].replace(":", "-") + stamp[10:19] + (f".{digits}" if digits.isdigit() else "")
    return None

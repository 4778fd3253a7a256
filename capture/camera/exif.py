"""What the camera wrote beside the picture: exposure, lens, clock. Absent EXIF is normal."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# It says on stderr that a PGM has no EXIF, which is no news.
logging.getLogger("exifread").addHandler(logging.NullHandler())


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

    @property
    def exposure(self) -> float | None:
        """Light gathered, relative: time x ISO / aperture^2. None unless all three are known."""
        if self.exposure_s is None or self.iso is None or self.aperture is None:
            return None
        return self.exposure_s * self.iso / self.aperture**2


def read_exif(path: Path) -> Exif:
    """Return the EXIF of a photograph, all None where there is none. Never raises for what it cannot read."""
    import exifread

    try:
        with open(path, "rb") as file:
            tags = exifread.process_file(file, details=False)
    except Exception:
        # A maker's malformed block breaks the parser in many ways; the picture is what counts.
        tags = {}
    return _exif_of_tags(tags)


def _exif_of_tags(tags: Mapping[str, Any]) -> Exif:
    unit_mm = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}.get(int(_number(tags, "EXIF FocalPlaneResolutionUnit") or 2))
    x, y = _number(tags, "EXIF FocalPlaneXResolution"), _number(tags, "EXIF FocalPlaneYResolution")
    distance = _number(tags, "EXIF SubjectDistance")
    width = _number(tags, "EXIF ExifImageWidth", "Image ImageWidth")
    orientation = _number(tags, "Image Orientation")
    return Exif(
        exposure_s=_number(tags, "EXIF ExposureTime", "Image ExposureTime"),
        iso=_number(tags, "EXIF ISOSpeedRatings", "EXIF PhotographicSensitivity", "Image ISOSpeedRatings"),
        aperture=_number(tags, "EXIF FNumber", "Image FNumber"),
        focal_mm=_number(tags, "EXIF FocalLength", "Image FocalLength"),
        focal_35mm=_number(tags, "EXIF FocalLengthIn35mmFilm"),
        pixels_per_mm=(x / unit_mm, (y or x) / unit_mm) if x and unit_mm else None,
        width_px=int(width) if width else None,
        # All bits set: infinity.
        subject_mm=1000 * distance if distance and distance < 4e6 else None,
        taken=_time(tags),
        camera=" ".join(word for word in (_text(tags, "Image Make"), _text(tags, "Image Model")) if word) or None,
        orientation=int(orientation) if orientation else None,
    )


def _number(tags: Mapping[str, Any], *names: str) -> float | None:
    """Return the first positive number among tags: cameras write 0 for "not known"."""
    for name in names:
        values = getattr(tags.get(name), "values", None)
        if isinstance(values, list) and values:
            try:
                number = float(values[0])
            except (ValueError, ZeroDivisionError, TypeError):
                continue
            if 0 < number < float("inf"):
                return number
    return None


def _text(tags: Mapping[str, Any], name: str) -> str:
    return str(tags[name]).strip(" \0") if name in tags else ""


def _time(tags: Mapping[str, Any]) -> str | None:
    for name, fraction in (
        ("EXIF DateTimeOriginal", "EXIF SubSecTimeOriginal"),
        ("EXIF DateTimeDigitized", "EXIF SubSecTimeDigitized"),
        ("Image DateTime", "EXIF SubSecTime"),
    ):
        stamp = _text(tags, name)
        if len(stamp) >= 19 and stamp[:4] != "0000":
            digits = _text(tags, fraction)
            return stamp[:10].replace(":", "-") + stamp[10:19] + (f".{digits}" if digits.isdigit() else "")
    return None

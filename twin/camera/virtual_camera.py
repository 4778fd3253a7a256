"""The virtual camera: a linear image becomes a Bayer photograph, noise and all, in a DNG file.

    linear RGB -> lens blur -> vignetting -> colour filter -> photons -> read noise -> quantised, clipped -> DNG

LibRaw gives the mosaic back bit for bit, and so a rendered session goes in by the same door as a real one.
"""

import io
import struct
from dataclasses import dataclass
from datetime import datetime
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray

from scene.errors import RenderError
from scene.files import write_whole
from twin.description.value_kinds import Level, NotNegative, Positive, Three, checked, key

NO_FILTER: Final = "none"

_SRGB_FROM_XYZ = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)

_PLACEHOLDER = 34664
"""A tag that nobody uses, next to EXIF's 34665."""


@checked
@dataclass(frozen=True)
class Sensor:
    """A sensor behind a lens."""

    full_well_e: Annotated[
        Positive, key("Electrons from black to white at ISO 100. They set the photon noise.", "electrons")
    ] = 40000.0
    read_noise_e: Annotated[
        NotNegative, key("Standard deviation of the read-out noise, at every ISO.", "electrons")
    ] = 4.0
    adc_noise_dn: Annotated[NotNegative, key("Standard deviation of the converter's noise.", "DN")] = 0.0
    iso: Annotated[Positive, key("White is `full_well_e` x 100 / `iso` electrons.")] = 100.0
    black_level: Annotated[Level, key("Value of no light.", "DN")] = 512
    white_level: Annotated[Level, key("Value of a full well, the greatest that is recorded.", "DN")] = 16383
    blur_px: Annotated[NotNegative, key("Standard deviation of the lens' Gaussian blur.", "px")] = 0.5
    vignetting: Annotated[
        Three, key("k1, k2, k3. The share of light is 1 + k1 r^2 + k2 r^4 + k3 r^6, r = 1 at the corners.")
    ] = (0.0, 0.0, 0.0)
    cfa: Annotated[
        Literal["RGGB", "BGGR", "GRBG", "GBRG", "none"],
        key("Colours of the top left 2 x 2 pixels, row by row. none: all three at each pixel."),
    ] = "RGGB"
    neutral: Annotated[
        tuple[Positive, Positive, Positive],
        key("Raw response to white, at most 1: the DNG's AsShotNeutral. A channel of 1 is white at pixel value 1."),
    ] = (0.58, 1.0, 0.69)
    pixel_um: Annotated[Positive, key("Pixel pitch, for the DNG's focal-plane resolution.", "um")] = 5.0

    def __post_init__(self) -> None:
        if not 0 <= self.black_level < self.white_level <= 65535:
            raise RenderError(
                f"black_level {self.black_level}, white_level {self.white_level}: expected 0 <= black < white <= 65535."
            )
        if self.falloff(np.linspace(0, 1, 101)).min() <= 0:
            raise RenderError(
                f"vignetting {self.vignetting} leaves no light at some place of the picture; expected "
                "1 + k1 r^2 + k2 r^4 + k3 r^6 above 0 from the middle (r = 0) to the corners (r = 1)."
            )

    @property
    def white_e(self) -> float:
        """Electrons at the white level, at this ISO."""
        return self.full_well_e * 100 / self.iso

    @property
    def electrons_per_dn(self) -> float:
        return self.white_e / (self.white_level - self.black_level)

    @property
    def noise_e(self) -> float:
        """Standard deviation of what the read-out adds in all, electrons."""
        return float(np.hypot(self.read_noise_e, self.adc_noise_dn * self.electrons_per_dn))

    def falloff(self, radius: NDArray) -> NDArray[np.float64]:
        """Return the share of the middle's light at distances from it; the corners' is 1."""
        square = np.asarray(radius, np.float64) ** 2
        k1, k2, k3 = self.vignetting
        return 1 + square * (k1 + square * (k2 + square * k3))

    def channels(self, height: int, width: int) -> NDArray[np.intp]:
        """Return (height, width), the colour under each pixel's filter: 0 red, 1 green, 2 blue."""
        tile = np.array(["RGB".index(letter) for letter in self.cfa]).reshape(2, 2)
        return np.tile(tile, (height // 2 + 1, width // 2 + 1))[:height, :width]


def expose(linear_rgb: NDArray, sensor: Sensor, rng: np.random.Generator) -> NDArray[np.uint16]:
    """Photograph a linear image.

    Parameters
    ----------
    linear_rgb : (H, W, 3) float
        Linear sRGB; 1.0 fills the green pixels. Values above 1 bleed through the lens' blur before they are clipped.
    rng : numpy Generator
        The noise; a seed gives the same photograph again.

    Returns
    -------
    counts : (H, W) uint16; (H, W, 3) of a sensor without filter
        DN, black level included.

    Raises
    ------
    RenderError
        The image has another shape, or holds NaN or infinity.

    Notes
    -----
    DN = round(black + (Poisson(e) + noise_e N(0, 1)) / (electrons per DN)), clipped to 0 .. white,
    e = white_e * neutral * falloff * (image * Gaussian), white_e = full_well_e * 100 / ISO,
    noise_e^2 = read_noise_e^2 + (adc_noise_dn * electrons per DN)^2.
    """
    import cv2

    image = np.asarray(linear_rgb, np.float32)
    if image.ndim != 3 or image.shape[2] != 3:
        raise RenderError(f"expose: the image has shape {image.shape}, expected (H, W, 3).")
    unknown = int(np.count_nonzero(~np.isfinite(image).all(-1)))
    if unknown:
        raise RenderError(f"expose: {unknown} of {image[..., 0].size} pixels are NaN or infinite. Render again.")
    if sensor.blur_px > 0:
        image = cv2.GaussianBlur(image, (0, 0), sensor.blur_px, borderType=cv2.BORDER_REPLICATE)
    if any(sensor.vignetting):
        image = image * sensor.falloff(_radius(*image.shape[:2]))[..., None]
    if sensor.cfa == NO_FILTER:
        scene = image * np.array(sensor.neutral)
    else:
        channels = sensor.channels(*image.shape[:2])
        scene = np.take_along_axis(image, channels[..., None], -1)[..., 0] * np.array(sensor.neutral)[channels]
    # Far above a full well the count of photons no longer matters, and Poisson's generator has a limit.
    electrons = rng.poisson(np.clip(scene, 0, 4) * sensor.white_e).astype(np.float64)
    electrons += sensor.noise_e * rng.standard_normal(electrons.shape)
    counts = np.round(electrons / sensor.electrons_per_dn + sensor.black_level)
    return np.clip(counts, 0, sensor.white_level).astype(np.uint16)


def _radius(height: int, width: int) -> NDArray[np.float64]:
    """Return each pixel's distance from the picture's middle, 1 at its corners."""
    v, u = np.ogrid[:height, :width]
    return np.hypot(u + 0.5 - width / 2, v + 0.5 - height / 2) / np.hypot(width / 2, height / 2)


def write_dng(
    path: Path,
    mosaic: NDArray[np.uint16],
    sensor: Sensor,
    *,
    exposure_s: float,
    iso: int,
    aperture: float,
    focal_mm: float,
    time: datetime,
) -> None:
    """Write a Bayer mosaic (H, W) as an uncompressed DNG 1.4 that LibRaw reads back bit for bit.

    Black and white level, colour filter, colour matrix and as-shot neutral go into the image's directory; exposure,
    ISO, aperture, focal length, time (with its microseconds) and focal-plane resolution into an EXIF directory.

    Raises
    ------
    RenderError
        The mosaic is not (H, W) uint16 of even size.
    SceneError
        The disk is full, or the place cannot be written.
    """
    import tifffile
    from PIL.TiffImagePlugin import IFDRational, ImageFileDirectory_v2

    if mosaic.ndim != 2 or mosaic.dtype != np.uint16 or mosaic.shape[0] % 2 or mosaic.shape[1] % 2:
        raise RenderError(
            f"{path}: the mosaic is {mosaic.dtype} {mosaic.shape}; expected uint16 (H, W) with H and W even."
        )
    # Our linear sRGB times `neutral` is the camera's colour space: so the matrix is exact, not fitted.
    matrix = np.diag(sensor.neutral) @ _SRGB_FROM_XYZ
    extratags = [
        (33421, "H", 2, (2, 2), True),  # CFARepeatPatternDim
        (33422, "B", 4, bytes("RGB".index(letter) for letter in sensor.cfa), True),  # CFAPattern
        (50706, "B", 4, bytes([1, 4, 0, 0]), True),  # DNGVersion
        (50707, "B", 4, bytes([1, 1, 0, 0]), True),  # DNGBackwardVersion
        (50708, "s", 0, "rgbn virtual camera", True),  # UniqueCameraModel
        (50710, "B", 3, bytes([0, 1, 2]), True),  # CFAPlaneColor
        (50711, "H", 1, 1, True),  # CFALayout: square
        (50713, "H", 2, (1, 1), True),  # BlackLevelRepeatDim
        (50714, "H", 1, sensor.black_level, True),
        (50717, "H", 1, sensor.white_level, True),
        (50721, "2i", 9, _rationals(matrix.ravel()), True),  # ColorMatrix1
        (50728, "2I", 3, _rationals(sensor.neutral), True),  # AsShotNeutral
        (50778, "H", 1, 21, True),  # CalibrationIlluminant1: D65
        (271, "s", 0, "rgbn", True),
        (272, "s", 0, "rgbn virtual camera", True),
        (_PLACEHOLDER, "I", 1, 0, True),
    ]
    buffer = io.BytesIO()
    tifffile.imwrite(
        buffer,
        mosaic,
        photometric=32803,
        planarconfig=1,
        metadata=None,
        software="rgbn",
        datetime=time.strftime("%Y:%m:%d %H:%M:%S"),
        extratags=extratags,
        byteorder="<",
    )
    data = bytearray(buffer.getvalue())
    data += b"\0" * (len(data) % 2)
    buffer.seek(0)
    with tifffile.TiffFile(buffer) as file:
        entry = file.pages[0].tags[_PLACEHOLDER].offset  # type: ignore[union-attr]
    # tifffile refuses the tag that points to the EXIF directory, so it is put in place of its neighbour.
    struct.pack_into("<HHII", data, entry, 34665, 4, 1, len(data))
    exif = ImageFileDirectory_v2()
    shot = (exposure_s, aperture, focal_mm, 1e4 / sensor.pixel_um)
    ratios = (IFDRational(Fraction(number).limit_denominator(1_000_000)) for number in shot)
    # ExposureTime, FNumber, FocalLength, FocalPlaneXResolution
    exif[33434], exif[33437], exif[37386], exif[41486] = ratios
    exif[41487] = exif[41486]  # FocalPlaneYResolution
    exif[34855] = iso  # ISOSpeedRatings
    exif[36867] = time.strftime("%Y:%m:%d %H:%M:%S")  # DateTimeOriginal
    exif[37521] = f"{time.microsecond:06d}"  # SubSecTimeOriginal
    exif[41488] = 3  # FocalPlaneResolutionUnit: centimetres
    with write_whole(path) as file:
        file.write(data + exif.tobytes(len(data)))


def _rationals(numbers: NDArray | tuple | list) -> list[int]:
    """Return numerator, denominator, numerator, ... of numbers."""
    fractions = [Fraction(float(number)).limit_denominator(1_000_000) for number in numbers]
    return [part for fraction in fractions for part in (fraction.numerator, fraction.denominator)]

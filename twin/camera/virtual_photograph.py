"""A linear image as a picture file: a DNG of the virtual camera, or what anyone reads, 16-bit PNG or EXR."""

from datetime import datetime
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from formats.picture_files import write_exr
from scene.errors import RenderError
from scene.files import write_png
from twin.camera.virtual_camera import NO_FILTER, Sensor, expose, write_dng

Files = Literal["png", "dng", "exr"]

ROWS = 256
EXPOSURE_S, APERTURE = 1 / 125, 8.0
"""EXIF wants them; what reaches the sensor is decided by the lights alone."""


def write_photograph(
    path: Path, image: NDArray, sensor: Sensor | None, rng: np.random.Generator, *, focal_mm: float, time: datetime
) -> None:
    """Photograph a linear image, and write it in the format of the path's suffix.

    Parameters
    ----------
    path : Path
        .dng: the sensor's counts, as they are. .png (16 bits, 65535 = white, 0 = black and below) and .exr (32 bits;
        noise below black is kept): linear colours, white-balanced; a Bayer mosaic is interpolated bilinearly.
    image : (H, W, 3) float
        Linear.
    sensor : Sensor or None
        None: no noise and no blur; .png or .exr alone.
    rng : numpy Generator
        The noise.
    focal_mm, time
        EXIF of a .dng.

    Raises
    ------
    RenderError
        A .dng of no Bayer sensor.
    """
    if path.suffix == ".dng":
        if sensor is None or sensor.cfa == NO_FILTER:
            raise RenderError(f"{path.name}: a DNG is the file of a Bayer sensor; found {sensor and sensor.cfa}.")
        shot = {"exposure_s": EXPOSURE_S, "iso": round(sensor.iso), "aperture": APERTURE}
        write_dng(path, expose(image, sensor, rng), sensor, **shot, focal_mm=focal_mm, time=time)
        return
    colours = np.asarray(image, np.float32) if sensor is None else developed(expose(image, sensor, rng), sensor)
    if path.suffix == ".exr":
        write_exr(path, colours)
    else:
        write_png(path, _whole_numbers(colours))


def _whole_numbers(colours: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return 16-bit values of linear colours (H, W, 3), rows at a time: a copy in float32 is twice as large."""
    values = np.empty(colours.shape, np.uint16)
    for start in range(0, len(colours), ROWS):
        rows = slice(start, start + ROWS)
        values[rows] = np.round(np.clip(colours[rows], 0, 1) * 65535)
    return values


def developed(counts: NDArray[np.uint16], sensor: Sensor) -> NDArray[np.float32]:
    """Return linear, white-balanced colours (H, W, 3) of a sensor's counts.

    Notes
    -----
    (DN - black) / (white - black) / neutral. Colours that a Bayer pixel lacks are means of the nearest that have them.
    """
    linear = (counts.astype(np.float32) - sensor.black_level) / (sensor.white_level - sensor.black_level)
    if sensor.cfa == NO_FILTER:
        return (linear / np.array(sensor.neutral)).astype(np.float32)
    import cv2

    channels = sensor.channels(*counts.shape)
    planes = []
    for channel, neutral in enumerate(sensor.neutral):
        here = (channels == channel).astype(np.float32)
        # Where a colour was measured, no neighbour under the kernel has the same: the pixel keeps its own.
        corner = 0.0 if channel == 1 else 1.0
        side = 1.0 if channel == 1 else 2.0
        kernel = np.array([[corner, side, corner], [side, 4, side], [corner, side, corner]], np.float32)
        total, weight = (
            cv2.filter2D(part, -1, kernel, borderType=cv2.BORDER_CONSTANT) for part in (linear * here, here)
        )
        planes.append(total / weight / neutral)
    return np.stack(planes, -1).astype(np.float32)

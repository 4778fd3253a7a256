"""Is a stack that is said to be linear really linear? What speaks against it, in the files and in the noise."""

import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scene.frames import Frames

SLOPE = -0.1
"""Captures known to be linear lie above 0.15, the same ones sRGB-encoded below -0.12 (tests/capture)."""
STEEPEST = -3.5
"""No encoding makes the slope steeper: then it is something else than noise."""


def stated_encoding(path: Path) -> str | None:
    """Return what a file itself says of its encoding, in words; None if it says nothing, or says linear."""
    from PIL import Image

    if path.suffix.lower() in (".jpg", ".jpeg"):
        return "a JPEG file, which is sRGB-encoded by standard"
    try:
        with Image.open(path) as image:
            info, color_space = dict(image.info), image.getexif().get(40961)
    except Exception:
        # What it says beside its pixels may be damaged: then it says nothing.
        return None
    if "srgb" in info:
        return "the file's sRGB chunk"
    gamma = info.get("gamma")
    if isinstance(gamma, float) and 0.2 < gamma < 0.9:
        return f"the file's gAMA chunk ({gamma})"
    if color_space == 1:
        return "EXIF's color space sRGB"
    return None


def jpeg_quality(path: Path) -> float | None:
    """Return a JPEG file's quality, 1 to 100, by its table of the luminance; None of another file.

    Notes
    -----
    libjpeg scales the standard's table, whose mean is 57.6, by 2 - quality / 50 above 50, and by 50 / quality below.
    """
    from PIL import Image

    if path.suffix.lower() not in (".jpg", ".jpeg"):
        return None
    try:
        with Image.open(path) as image:
            table = getattr(image, "quantization", {}).get(0)
    except (OSError, ValueError, SyntaxError):
        return None
    if not table:
        return None
    scale = float(np.mean(table)) / 57.6
    return 100 - 50 * scale if scale < 1 else 50 / scale


def speaks_for_gamma(slope: float, sigma: float) -> bool:
    """Tell whether a noise slope is negative for sure, and not more than an encoding can make it."""
    return slope > STEEPEST and slope + 2 * sigma < SLOPE


def noise_slope(frames: Frames, *, step: float = 0.0) -> tuple[float, float] | None:
    """Return the slope of log noise variance against log brightness, and its sigma; None if it cannot be seen.

    Parameters
    ----------
    step : float
        Least difference of two values, 1/255 for 8 bits: noise below it is rounding.

    Notes
    -----
    A sensor's noise grows with light: variance = read^2 + k * mean, a slope from 0 to 1 on linear values; texture
    only adds to it. Encoding by v^(1/2.2) makes it -0.2 where photons rule, -2.4 where read noise does. Noise is
    the response to the second difference in both directions [Immerkaer1996]; in each class of brightness the quiet
    tenth counts.
    """
    import cv2

    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    height, width = min(frames.height, 1024), min(frames.width, 1024)
    top, left = (frames.height - height) // 2, (frames.width - width) // 2
    levels, variances = [], []
    for i in range(0, len(frames), max(1, len(frames) // 8)):
        picture = frames.read(slice(top, top + height), [i], columns=slice(left, left + width), subtract_ambient=False)[
            0
        ].mean(axis=-1)
        noise = cv2.blur(cv2.filter2D(picture, -1, kernel) ** 2, (7, 7))
        level = cv2.blur(picture, (7, 7))
        # Clipped noise is no noise.
        usable = (cv2.dilate(picture, np.ones((9, 9), np.uint8)) < 0.9) & (level > 1e-4)
        levels.append(level[usable][::3])
        variances.append(noise[usable][::3])
    return _slope(np.concatenate(levels), np.concatenate(variances), step**2 / 12)


def _slope(level: NDArray, variance: NDArray, rounding: float) -> tuple[float, float] | None:
    if len(level) < 2000:
        return None
    edges = np.quantile(level, np.linspace(0.05, 0.98, 17))
    points = []
    for low, high in itertools.pairwise(edges):
        inside = (level >= low) & (level < high)
        if inside.sum() >= 100 and high > low:
            quiet = np.quantile(variance[inside], 0.1)
            if quiet > rounding:
                points.append((np.log((low + high) / 2), np.log(quiet)))
    x, y = np.array(points).reshape(-1, 2).T
    # Over less than a factor of 1.8 in brightness, four before encoding, there is no lever for a slope.
    if len(points) < 8 or np.ptp(x) < np.log(1.8):
        return None
    (slope, _), covariance = np.polyfit(x, y, 1, cov=True)
    return float(slope), float(np.sqrt(covariance[0, 0]))

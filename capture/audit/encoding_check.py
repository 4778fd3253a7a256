"""Are values that are said to be linear really linear? What the files and their noise say against it."""

import itertools
from contextlib import suppress
from pathlib import Path

import numpy as np

from capture.camera.exif import tags_in
from capture.session.globs import kind_of
from capture.session.session_types import CaptureSession
from scene.frames import Frames, gray

SLOPE = -0.1
"""Captures known to be linear lie above 0.15, the same ones sRGB-encoded below -0.12 (tests/capture)."""
STEEPEST = -3.5
"""No encoding makes the slope steeper: then it is something else than noise."""
WINDOW_PX = 1024
"""Side of the middle part that is looked at."""


def encoding_warnings(session: CaptureSession, frames: Frames) -> list[str]:
    """Name what speaks against values being linear."""
    is_of_codes = kind_of(session.flash[0]) == "image" and frames.codes.dtype == np.uint16
    if session.encoding != "linear" or not is_of_codes:
        return []
    evidence = stated_encoding(session.flash[0])
    # At most 256 different codes: an 8-bit file.
    few = not session.half and np.unique(frames.codes[0, ::3, ::3]).size <= 256
    noise = noise_slope(frames, step=1 / 255 if few else 0.0)
    reasons = [evidence] if evidence else []
    if noise and speaks_for_gamma(*noise):
        reasons.append(f"noise that falls with brightness (slope {noise[0]:.2f}; 0 to 1 in linear values)")
    if reasons:
        verb = "speaks" if len(reasons) == 1 else "speak"
        return [
            f"frames.linear: taken as linear, but {' and '.join(reasons)} {verb} for gamma encoding, which "
            "costs some 14 degrees in the normals. Set linear = false (sRGB) or gamma = 2.2, or give the RAW files."
        ]
    if few and not session.encoding_stated:
        return [
            "frames.linear: not stated, and the files have 8 bits: taken as linear. Write linear = true if they are, "
            "linear = false if they are sRGB-encoded, as cameras' JPEG and most 8-bit pictures are."
        ]
    return []


def stated_encoding(path: Path) -> str | None:
    """Return what a file itself says of its encoding, in words; None if it says nothing, or says linear."""
    from PIL import Image

    if path.suffix.lower() in (".jpg", ".jpeg"):
        return "a JPEG file, which is sRGB-encoded by standard"
    # What it says beside its pixels may be damaged: then it says nothing.
    with suppress(Exception), Image.open(path) as image:
        gamma = image.info.get("gamma")
        if "srgb" in image.info:
            return "the file's sRGB chunk"
        if isinstance(gamma, float) and 0.2 < gamma < 0.9:
            return f"the file's gAMA chunk ({gamma})"
        return "EXIF's color space sRGB" if tags_in(path).get("ColorSpace") == 1 else None
    return None


def speaks_for_gamma(slope: float, sigma: float) -> bool:
    """Tell whether a noise slope is negative for sure, and not more than an encoding can make it."""
    return slope > STEEPEST and slope + 2 * sigma < SLOPE


def noise_slope(frames: Frames, *, step: float = 0.0) -> tuple[float, float] | None:
    """Return the slope of log noise variance against log brightness, and its sigma; None if it cannot be seen.

    `step` is the least difference of two values, 1/255 for 8 bits: noise below it is rounding.

    A sensor's noise grows with light: variance = read^2 + k * mean, a slope from 0 to 1 on linear values; texture
    only adds to it. Encoding by v^(1/2.2) makes it -0.2 where photons rule, -2.4 where read noise does. Noise is
    the response to the second difference in both directions [Immerkaer1996]; in each class of brightness the quiet
    tenth counts.
    """
    import cv2

    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6
    sizes = ((size, min(size, WINDOW_PX)) for size in (frames.height, frames.width))
    rows, columns = (slice((size - part) // 2, (size - part) // 2 + part) for size, part in sizes)
    levels, variances = [], []
    for i in range(0, len(frames), max(1, len(frames) // 8)):
        picture = gray(frames.read(rows, [i], columns=columns, subtract_ambient=False)[0])
        noise = cv2.blur(cv2.filter2D(picture, -1, kernel) ** 2, (7, 7))
        level = cv2.blur(picture, (7, 7))
        # Clipped noise is no noise.
        usable = (cv2.dilate(picture, np.ones((9, 9), np.uint8)) < 0.9) & (level > 1e-4)
        levels.append(level[usable][::3])
        variances.append(noise[usable][::3])
    level, variance, points = np.concatenate(levels), np.concatenate(variances), []
    if len(level) < 2000:
        return None
    for low, high in itertools.pairwise(np.quantile(level, np.linspace(0.05, 0.98, 17))):
        inside = (level >= low) & (level < high)
        if inside.sum() >= 100 and high > low:
            quiet = np.quantile(variance[inside], 0.1)
            if quiet > step**2 / 12:
                points.append((np.log((low + high) / 2), np.log(quiet)))
    x, y = np.array(points).reshape(-1, 2).T
    # Over less than a factor of 1.8 in brightness, four before encoding, there is no lever for a slope.
    if len(points) < 8 or np.ptp(x) < np.log(1.8):
        return None
    (slope, _), covariance = np.polyfit(x, y, 1, cov=True)
    return float(slope), float(np.sqrt(covariance[0, 0]))

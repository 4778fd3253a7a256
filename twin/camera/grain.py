"""A sensor as noisy as the session's, measured on its frames."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scene.frames import Frames
from twin.camera.virtual_camera import Sensor

BLUR_PX = 0.6
FRAMES_READ = 3
MOST_PIXELS = 2_000_000
BINS = 12
SMOOTH = 0.2
"""Share of a bin's pixels that are taken to lie where the scene is smooth."""


def sensor_like(frames: Frames) -> Sensor:
    """Return a sensor with the frames' photon and read noise.

    Notes
    -----
    The second difference of a smooth scene is noise [Immerkaer1996]; its size over brightness is
    variance = read^2 + value / full well. On a Bayer mosaic neighbours are interpolated from each other, so every
    second pixel is compared, and of the four places in the pattern the noisiest is the one that was measured.
    """
    rows = min(frames.height, max(8, MOST_PIXELS // frames.width))
    first = (frames.height - rows) // 2
    values, noises = [], []
    for index in np.unique(np.linspace(0, len(frames) - 1, FRAMES_READ).astype(int)):
        band = frames.read(slice(first, first + rows), [int(index)], subtract_ambient=False)[0][..., 1]
        for value, noise in _noise_by_brightness(band):
            values.append(value)
            noises.append(noise)
    if not values:
        return Sensor(blur_px=BLUR_PX, neutral=(1.0, 1.0, 1.0))
    value, variance = np.array(values), np.array(noises) ** 2
    weight = 1 / np.maximum(variance, 1e-10)
    from scipy.optimize import nnls

    design = np.stack([np.ones_like(value), np.maximum(value, 0)], 1)
    (floor, slope), _ = nnls(design * weight[:, None], variance * weight)
    full_well = float(np.clip(1 / max(slope, 1e-9), 300, 300_000))
    read = float(np.clip(np.sqrt(floor) * full_well, 0, 0.05 * full_well))
    return Sensor(full_well_e=full_well, read_noise_e=read, blur_px=BLUR_PX, neutral=(1.0, 1.0, 1.0))


def _noise_by_brightness(band: NDArray[np.float32]) -> list[tuple[float, float]]:
    """Return (value, noise) of bins of brightness of one channel (h, w)."""
    found: dict[int, list[tuple[float, float]]] = {}
    usable = band[(band > 0.002) & (band < 0.9)]
    if usable.size < 1000:
        return []
    edges = np.quantile(usable, np.linspace(0, 1, BINS + 1))
    for place in range(4):
        part = band[place // 2 :: 2, place % 2 :: 2]
        difference = (part[:, :-2] - 2 * part[:, 1:-1] + part[:, 2:]) / np.sqrt(6)
        mean = (part[:, :-2] + part[:, 1:-1] + part[:, 2:]) / 3
        for number, (low, high) in enumerate(pairwise(edges)):
            inside = (mean >= low) & (mean < high)
            if inside.sum() < 200:
                continue
            # 0.2533: the normal distribution's quantile that a fifth of the absolute values lie under.
            noise = float(np.quantile(np.abs(difference[inside]), SMOOTH)) / 0.2533
            found.setdefault(number, []).append((float(mean[inside].mean()), noise))
    return [max(places, key=lambda item: item[1]) for places in found.values()]

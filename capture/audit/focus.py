"""Is a frame out of focus? How much softer its static edges are than the other frames', as the sigma of a blur."""

import numpy as np
from numpy.typing import NDArray

from capture.audit.frame_facts import FrameFacts
from capture.audit.static_edges import edge_tiles, orientation, sharpness
from scene.frames import Frames, gray

FEWEST_FRAMES = 4
FEWEST_TILES, MOST_TILES = 4, 24
TILE_PX, SMALL_TILE_PX = 128, 48
SOFT_PX = 1.2
"""Blur, full-size pixels, from which a frame is named, and at least this share of the picture's width:"""
SOFT_SHARE = 3e-4
ABOVE_NOISE = 4.0
"""Power above the noise's that a frequency must have to be asked."""


def blur_px(frames: Frames, facts: list[FrameFacts]) -> NDArray[np.float64]:
    """Return by how much each frame is softer than the others: sigma (F,), pixels; negative where it is sharper.

    NaN of fewer than four frames, or where too few static edges are seen.

    Notes
    -----
    A blur of sigma takes exp(-4 pi^2 sigma^2 f^2) of the power at frequency f (cycles a pixel), whatever it blurs: so
    the logarithm of a tile's power, less that of the median of the other frames, falls with f^2 by 4 pi^2 times the
    difference of the two sigma^2. Of the logarithm of the picture, which light multiplies, on tiles that have edges in
    all frames; the median over tiles. Frequencies at which noise rules are left out.
    """
    count = len(frames)
    unknown = np.full(count, np.nan)
    if count < FEWEST_FRAMES:
        return unknown
    small = [np.asarray(fact.small) for fact in facts]
    scale = frames.height / small[0].shape[0]
    floor = [0.02 * float(np.quantile(picture, 0.99)) + 1e-6 for picture in small]
    units = np.stack([orientation(picture, offset) for picture, offset in zip(small, floor, strict=True)])
    tile = min(TILE_PX, frames.height, frames.width)
    corners = edge_tiles(sharpness(units), count, min(SMALL_TILE_PX, max(round(tile / scale), 8)), MOST_TILES)
    if len(corners) < FEWEST_TILES:
        return unknown
    votes = []
    for y, x in corners:
        top = int(np.clip(round(y * scale), 0, frames.height - tile))
        left = int(np.clip(round(x * scale), 0, frames.width - tile))
        pixels = frames.read(slice(top, top + tile), columns=slice(left, left + tile), subtract_ambient=False)
        pixels = gray(pixels) / frames.gain.astype(np.float32)[:, None, None]
        votes.append(_squares(np.log(np.maximum(pixels, 0) + np.array(floor, np.float32)[:, None, None])))
    square = np.nanmedian(np.array(votes), axis=0) if np.isfinite(votes).any() else unknown
    return np.sign(square) * np.sqrt(np.abs(square))


def _squares(pictures: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return sigma^2 (F,) of each picture (F, n, n) beside the others, NaN where noise hides it."""
    from scipy import ndimage

    size = pictures.shape[1]
    taper = np.outer(np.hanning(size), np.hanning(size)).astype(np.float32)
    centred = (pictures - pictures.mean((1, 2), keepdims=True)) * taper
    power = np.abs(np.fft.rfft2(centred)) ** 2
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None])
    rings, ring = np.rint(f * size), np.arange(2, size // 2)
    spectrum, at = np.stack([np.asarray(ndimage.mean(one, rings, ring)) for one in power]), ring / size
    noise = spectrum[:, at > 0.4].mean(1, keepdims=True)
    clear = spectrum > ABOVE_NOISE * noise
    logarithm = np.log(np.maximum(spectrum - noise, 1e-12))
    found = np.full(len(pictures), np.nan)
    for i in range(len(pictures)):
        others = np.arange(len(pictures)) != i
        known = clear[i] & (clear[others].mean(0) > 0.5)
        if known.sum() < 4:
            continue
        fall = logarithm[i] - np.median(logarithm[others], axis=0)
        slope = np.polyfit(at[known] ** 2, fall[known], 1)[0]
        found[i] = -slope / (4 * np.pi**2)
    return found


def focus_warnings(frames: Frames, facts: list[FrameFacts]) -> list[str]:
    """Name frames that are softer than the others."""
    soft = blur_px(frames, facts)
    limit = max(SOFT_PX, SOFT_SHARE * frames.width)
    return [
        f"{frames.names[i]}: is softer than the other frames, as by a blur of {soft[i]:.1f} px: the focus or the "
        "camera has moved. Look at it; focus by hand, switch the autofocus off, and shoot it again."
        for i in np.flatnonzero(np.nan_to_num(soft) > limit)
    ]

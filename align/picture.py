"""One picture out of the stack, in which outlines are sharp and shadows gone."""

import numpy as np
from numpy.typing import NDArray

from scene.frames import Frames
from scene.lights import Lights


def block_means(frames: Frames, factor: int) -> NDArray[np.float32]:
    """Return (F, H // factor, W // factor) float32, the channels' and blocks' means of every frame."""
    height, width = frames.height // factor, frames.width // factor
    out = np.empty((len(frames), height, width), np.float32)
    step = max(1, (32 << 20) // (frames.width * 12 * factor))
    for first in range(0, height, step):
        last = min(first + step, height)
        rows, columns = slice(first * factor, last * factor), slice(0, width * factor)
        for index in range(len(frames)):
            gray = frames.read(rows, [index], columns=columns)[0].mean(-1)
            out[index, first:last] = gray.reshape(last - first, factor, width, factor).mean((1, 3))
    return out


def bright_mean(stack: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (h, w), the mean of each pixel's brightest quarter of frames (F, h, w).

    Cast shadows vanish from the backdrop, and a limb counts where it is lit: its edge is steeper than in the mean.
    """
    keep = max(1, len(stack) // 4)
    return np.partition(stack, len(stack) - keep, axis=0)[-keep:].mean(0)


def bright_picture(frames: Frames, near: NDArray[np.bool_], *, lights: Lights | None = None) -> NDArray[np.float32]:
    """Return (H, W) float32, `bright_mean` of the gray frames around the pixels of `near`; 0 elsewhere.

    Given the lights, each frame is divided by its light's intensity first.
    """
    v, u = np.nonzero(near)
    margin = 32
    columns = slice(max(int(u.min()) - margin, 0), int(u.max()) + margin + 1)
    out = np.zeros(near.shape, np.float32)
    weight = np.full((len(frames), 3), 1 / 3) if lights is None else 1 / lights.intensities / 3
    for band in frames.bands(64 << 20):
        rows = slice(max(band.start, int(v.min()) - margin), min(band.stop, int(v.max()) + margin + 1))
        if rows.start < rows.stop:
            gray = np.einsum("fhwc,fc->fhw", frames.read(rows, columns=columns), weight.astype(np.float32))
            out[rows, columns] = bright_mean(gray)
    return out

"""Pictures out of the stack in which the object's outline is sharp and shadows are gone."""

import os
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from align.pose.photographed import box_of
from scene.fan_out import fan_out
from scene.frames import Frames, gray


def block_means(frames: Frames, factor: int) -> NDArray[np.float32]:
    """Return (F, H // factor, W // factor) float32, the channels' and blocks' means of every frame."""
    import cv2

    size = frames.width // factor, frames.height // factor

    def shrink(codes: NDArray) -> NDArray:
        # What is linear may be averaged before it is decoded. OpenCV knows no float16.
        codes = codes[: size[1] * factor, : size[0] * factor]
        codes = codes if codes.dtype == np.uint16 else codes.astype(np.float32)
        return np.asarray(cv2.resize(codes, size, interpolation=cv2.INTER_AREA))

    small = replace(
        frames,
        codes=np.stack([shrink(codes) for codes in frames.codes]),
        ambient=None if frames.ambient is None else shrink(frames.ambient),
    )
    return gray(small.read())


def bright_mean(stack: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (h, w), the mean of each pixel's brightest quarter of frames (F, h, w).

    Cast shadows vanish from the backdrop, and the object's edge counts where it is lit: it is steeper than in the mean.
    """
    keep = max(1, len(stack) // 4)
    return np.partition(stack, len(stack) - keep, axis=0)[-keep:].mean(0)


def bright_picture(frames: Frames, near: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return (H, W) float32, `bright_mean` of the gray frames around the pixels of `near`; 0 elsewhere."""
    (down, across), margin = box_of(near), 32
    columns = slice(max(across.start - margin, 0), across.stop + margin)
    out = np.zeros(near.shape, np.float32)

    def fill(band: slice) -> None:
        rows = slice(max(band.start, down.start - margin), min(band.stop, down.stop + margin))
        if rows.start < rows.stop:
            out[rows, columns] = bright_mean(gray(frames.read(rows, columns=columns)))

    fan_out(fill, list(frames.bands((128 << 20) // (os.cpu_count() or 1))))
    return out

"""One picture out of the stack, in which outlines are sharp and shadows gone."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scene.frames import Frames

ACROSS = 500
"""Pixels across the object, at least, at which normals are solved for the search."""


def box_of(mask: NDArray[np.bool_]) -> tuple[slice, slice]:
    """Return the rows and columns that hold a mask's pixels; the mask is not empty."""
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def longer_side(mask: NDArray[np.bool_]) -> int:
    """Return the longer side of the box about a mask, pixels."""
    return max(side.stop - side.start for side in box_of(mask))


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
    return np.asarray(small.read().mean(-1))


def sparse_normals(mask: NDArray[np.bool_], solve: Callable[[NDArray[np.bool_]], NDArray]) -> NDArray:
    """Return normals (H, W, 3) under a mask, of a large object solved on every k-th pixel of every k-th row only.

    A scan is placed with the object `ACROSS` pixels large; what more there is of normals would be averaged.

    Parameters
    ----------
    mask : (H, W) bool
    solve : callable
        A mask (H, W) -> normals (H, W, 3), NaN where unknown.

    Returns
    -------
    normals : (H, W, 3)
        The k x k pixels about a solved one are given its normal.
    """
    step = max(1, (longer_side(mask) - 1) // ACROSS) if mask.any() else 1
    if step == 1:
        return solve(mask)
    grid = [np.arange(step // 2, count, step) for count in mask.shape]
    few = np.zeros_like(mask)
    few[np.ix_(*grid)] = mask[np.ix_(*grid)]
    nearest = [
        at[np.minimum(np.arange(count) // step, len(at) - 1)] for at, count in zip(grid, mask.shape, strict=True)
    ]
    return solve(few)[np.ix_(*nearest)]


def bright_mean(stack: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (h, w), the mean of each pixel's brightest quarter of frames (F, h, w).

    Cast shadows vanish from the backdrop, and a limb counts where it is lit: its edge is steeper than in the mean.
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
            out[rows, columns] = bright_mean(frames.read(rows, columns=columns).mean(-1))

    cores = os.cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        list(pool.map(fill, frames.bands((128 << 20) // cores)))
    return out

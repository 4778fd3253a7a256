"""How alike each photograph and its twin look: PSNR and SSIM."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import PixelBox, thumbnail
from formats.picture_files import srgb_from_linear
from scene.frames import Frames

WIDTH_PX = 800
"""Pictures of the object are compared at most so wide: both figures are of a picture as people look at it."""
WINDOW_PX = 11
"""Side of the window of SSIM: its weights end at 3.5 sigmas of 1.5 px [Wang2004]."""
WHITE = 0.999
"""Quantile of the brightest photograph's values on the object that is shown as white."""


def frames_alike(photographs: Frames, twin: Frames, mask: NDArray[np.bool_]) -> dict[str, Any] | None:
    """Return how alike photographs and twin are: psnr_db and ssim, medians, and the same of each of `frames`, by name.

    None of an object of hardly any pixels. The twin has the photographs' names and size.

    Parameters
    ----------
    photographs, twin : Frames
    mask : (H, W) bool
        The object; nothing else counts.

    Notes
    -----
    In sRGB from 0 to 1, one white for all frames; each channel of the twin is scaled once, by least squares over all
    frames: a lamp's strength has no unit. PSNR is 10 log10(1 / mean square of the difference). SSIM [Wang2004] is the
    mean over the object of that of the three channels.
    """
    import cv2
    from skimage.metrics import structural_similarity

    box = PixelBox.of_mask(mask, margin=0.02)

    def pair(index: int) -> tuple[NDArray, NDArray]:
        return thumbnail(photographs, index, WIDTH_PX, box), thumbnail(twin, index, WIDTH_PX, box)

    size = pair(0)[0].shape[1::-1]
    inside = np.asarray(cv2.resize(box.of(mask).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT)) > 0
    if min(inside.shape) < WINDOW_PX or not inside.any():
        return None
    products, squares, white = np.zeros(3), np.full(3, 1e-12), 1e-6
    # One frame after the other, twice: a stack of them is not held in memory.
    for index in range(len(photographs)):
        real, made = (image[inside] for image in pair(index))
        products, squares = products + np.sum(real * made, 0), squares + np.sum(made**2, 0)
        white = max(white, float(np.quantile(real, WHITE)))
    found = []
    for index, name in enumerate(photographs.names):
        photograph, rendering = pair(index)
        both = photograph, rendering * (products / squares)
        a, b = (srgb_from_linear(np.clip(image / white, 0, 1)) for image in both)
        square = float(np.mean((a - b)[inside] ** 2))
        a[~inside] = b[~inside] = 0
        likeness: Any = structural_similarity(
            a, b, data_range=1.0, channel_axis=-1, gaussian_weights=True, use_sample_covariance=False, full=True
        )
        ssim = float(likeness[1][inside].mean())
        found.append({"name": name, "psnr_db": float(-10 * np.log10(max(square, 1e-12))), "ssim": ssim})
    medians = {key: float(np.median([row[key] for row in found])) for key in ("psnr_db", "ssim")}
    return {**medians, "frames": found}

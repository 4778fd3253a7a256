"""A photograph as it is shown large, with what is laid over it; and the normals or the twin beside it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from compare.report.picture_strip import CELL_PX, INK, Label, PictureStrip
from compare.report.pictures import thumbnail
from compare.report.registration_pictures import WIDTH
from draw.readable import share
from scene.frames import Frames
from scene.map_pictures import Image, normal_picture
from studio.session.folder import Review
from studio.widgets import HELD

MASK_COLOUR = (0, 190, 255)
CLIPPED = (255, 0, 60)
BAND = 64
"""Rows."""
MUCH_CLIPPED = 0.002
"""Share of a frame's pixels; a chrome ball's highlight is far less."""


@dataclass(frozen=True)
class PictureLook:
    """How a photograph is shown."""

    marks_object: bool = False
    brightness: float = 1.0
    marks_clipped: bool = True


def frame_strip(review: Review) -> PictureStrip | None:
    """Return all frames small, one tone curve for all, each with number, name and what is clipped; None without any."""
    frames, exposure, shares = review.material.frames, review.material.exposure, review.clipped_share
    if frames is None or exposure is None or not len(frames):
        return None
    warned = {frame for one in review.warnings for frame in one.frames}
    warned |= {index for index, flags in enumerate(review.lights.flags if review.lights else ()) if flags}

    def label(index: int, name: str) -> Label:
        if shares is not None and shares[index] >= MUCH_CLIPPED:
            return f"{index + 1}  clipped {share(shares[index], 1)} %", CLIPPED
        return (f"{index + 1} {name}  (!)", HELD) if index in warned else (f"{index + 1} {name}", INK)

    pictures = [exposure.develop(thumbnail(frames, index, CELL_PX)) for index in range(len(frames))]
    return PictureStrip.of(pictures, [label(index, name) for index, name in enumerate(frames.names)])


def photograph(review: Review, index: int, look: PictureLook) -> Image:
    """Return a whole frame with what is laid over it, at most `WIDTH` pixels wide.

    While none is decoded it is the review's preview. Raises SceneError: there is none, or what is to lie over it is
    not in the folder.
    """
    if review.material.frames is None and review.preview is not None:
        return review.preview
    (frames,), exposure = review.need("frames"), review.material.exposure
    assert exposure is not None
    exposure = replace(exposure, white=exposure.white / look.brightness)
    picture = exposure.develop(thumbnail(frames, index, WIDTH))
    if look.marks_clipped:
        picture = np.where(_clipped(frames, index, picture.shape)[..., None], CLIPPED, picture).astype(np.uint8)
    return _with_mask(review, picture) if look.marks_object else picture


def normals_beside(review: Review, method: str) -> Image | None:
    """Return the normals of a method as colours; None: there are none."""
    normals = review.material.map_of("normals", method) if method else None
    if normals is None:
        return None
    # A map of 24 megapixels is shown by a part of its pixels.
    step = max(1, normals.shape[1] // (2 * WIDTH))
    return normal_picture(normals[::step, ::step], min(WIDTH, normals.shape[1]))


def _clipped(frames: Frames, index: int, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return (h, w), where a shown pixel has a clipped one in it."""
    import cv2

    clipped = np.zeros((frames.height, frames.width), np.uint8)
    # A few rows at a time stay in the processor's own memory.
    for first in range(0, frames.height, BAND):
        rows = slice(first, first + BAND)
        clipped[rows] = frames.saturated(rows, [index])[0] * np.uint8(255)
    return np.asarray(cv2.resize(clipped, (shape[1], shape[0]), interpolation=cv2.INTER_AREA)) > 0


def _with_mask(review: Review, picture: Image) -> Image:
    """Tint the object, and draw the outermost pixels of it."""
    import cv2

    (mask,) = review.need("mask")
    size = picture.shape[1::-1]
    inside = np.asarray(cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST), np.uint8)
    tinted = np.where(inside[..., None] > 0, 0.7 * picture + 0.3 * np.array(MASK_COLOUR), picture)
    edge = inside > cv2.erode(inside, np.ones((3, 3)), iterations=max(1, picture.shape[1] // 600), borderValue=0)
    return np.where(edge[..., None], MASK_COLOUR, tinted).astype(np.uint8)

"""A dataset at a glance: some of its photographs, and what is true of them."""

import numpy as np
from numpy.typing import NDArray

from compare.report.pictures import PAPER, Box, Exposure, normal_picture, shrink, thumbnail
from experiments.photographs import Photographs
from twin.ground_truth import lights_of

TILE, COLUMNS, SHOWN, GAP = 160, 6, 12, 4
CAPTION = 18


def preview(stack: Photographs) -> NDArray[np.uint8]:
    """Return (h, w, 3) uint8: twelve frames, evenly chosen, then normals, albedo, height and shadows, each named."""
    frames, truth, count = stack.frames, stack.truth, len(stack.lights)
    box, exposure = Box.of_mask(truth.mask, margin=0.06), Exposure.for_frames(frames)
    tiles = []
    for index in np.unique(np.linspace(0, count - 1, min(SHOWN, count)).round().astype(int)):
        x, y, z = stack.lights.directions[index]
        name = f"{frames.names[index]}: {x:.2f} {y:.2f} {z:.2f}"
        tiles.append(_tile(exposure.develop(thumbnail(frames, int(index), TILE, box)), name))
    tiles += [_blank()] * (-len(tiles) % COLUMNS)
    window = (box.rows, box.columns)
    tiles.append(_tile(normal_picture(truth.normals[window], TILE), "normals"))
    albedo = truth.albedo[window]
    # Not white, or it could not be told from the paper.
    white = 1.3 * max(float(np.nanquantile(albedo, 0.99)), 1e-6)
    tiles.append(_tile(_gray(albedo / white), "albedo"))
    tall = truth.height_mm[window]
    top = max(float(np.nanmax(tall)), 1e-6)
    tiles.append(_tile(_gray(np.repeat((tall / top)[..., None], 3, -1), 1.0), f"height, 0 to {top:.0f} mm"))
    for name in ("attached", "cast"):
        lost = lights_of(getattr(truth, name), count).mean(0, dtype=np.float32)
        lost = np.where(truth.mask, lost, np.nan)[window]
        tiles.append(_tile(_gray(np.repeat(lost[..., None], 3, -1), 1.0), f"{name} shadow"))
    tiles += [_blank()] * (-len(tiles) % COLUMNS)
    rows = [np.concatenate(tiles[i : i + COLUMNS], 1) for i in range(0, len(tiles), COLUMNS)]
    return np.concatenate(rows, 0)


def _gray(values: NDArray, gamma: float = 1 / 2.2) -> NDArray[np.uint8]:
    """Return values 0 to 1 (h, w, 3) as a picture; paper where there is none."""
    small = shrink(values, TILE)
    shown = np.clip(np.nan_to_num(small), 0, 1) ** gamma
    return np.where(np.isfinite(small), np.round(255 * shown), PAPER).astype(np.uint8)


def _blank() -> NDArray[np.uint8]:
    return np.full((TILE + CAPTION + GAP, TILE + GAP, 3), 255, np.uint8)


def _tile(image: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
    """Return a picture, fitted into a square, with its name below."""
    import cv2

    height, width = image.shape[:2]
    factor = TILE / max(height, width)
    size = (max(1, round(width * factor)), max(1, round(height * factor)))
    how = cv2.INTER_NEAREST if factor > 1 else cv2.INTER_AREA
    image = np.asarray(cv2.resize(image, size, interpolation=how), np.uint8)
    tile = _blank()
    top, left = (TILE - image.shape[0]) // 2, (TILE - image.shape[1]) // 2
    tile[top : top + image.shape[0], left : left + image.shape[1]] = image
    font = {"fontFace": cv2.FONT_HERSHEY_SIMPLEX, "fontScale": 0.38, "color": (40, 40, 40), "lineType": cv2.LINE_AA}
    return np.asarray(cv2.putText(tile, caption, (3, TILE + 13), **font), np.uint8)

"""A picture of what was found: the scene with the balls in circles, and the photographs small."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lab.init.draft import Draft
from scene.files import write_png

WIDTH = 1200
SMALL_WIDTH = 195
MOST = 12
"""Photographs that are shown small."""
COLOURS = {"chrome": (90, 220, 255), "white": (255, 190, 60)}
GAMMA = 1 / 2.2


def write_sheet(path: Path, draft: Draft) -> None:
    """Write the contact sheet, a PNG."""
    write_png(path, contact_sheet(draft))


def contact_sheet(draft: Draft) -> NDArray[np.uint8]:
    """Return the sheet (H, W, 3), RGB."""
    import cv2

    frames = draft.small
    some = frames.some(MOST)
    linear = some.read()
    scale = WIDTH / frames.width
    size = WIDTH, round(scale * frames.height)
    scene = np.array(cv2.resize(_shown(linear.mean(axis=0)), size, interpolation=cv2.INTER_AREA), np.uint8)
    scale /= draft.step
    for number, ball in enumerate(draft.balls, 1):
        if not ball.radius_px:
            continue
        center = tuple(round(16 * scale * value) for value in ball.center_px)
        colour = COLOURS[ball.kind]
        cv2.circle(scene, center, round(16 * scale * ball.radius_px), colour, 2, cv2.LINE_AA, shift=4)
        size = f", {ball.diameter_mm:g} mm" if ball.diameter_mm else ""
        _write(
            scene,
            f"{number} {ball.kind}{size}",
            center[0] // 16,
            round(center[1] / 16 - scale * ball.radius_px - 8),
            colour,
        )
    _write(scene, f"{draft.name}: mean of the flash frames", 12, 26, (255, 255, 255), left=True)
    rows = [scene, *_strip(some.names, linear)]
    return np.concatenate(rows)


def _strip(names: tuple[str, ...], linear: NDArray[np.float32]) -> list[NDArray[np.uint8]]:
    """Return rows of small photographs with their names."""
    import cv2

    tiles = []
    for name, picture in zip(names, linear, strict=True):
        height = round(picture.shape[0] * SMALL_WIDTH / picture.shape[1])
        tile = np.full((height + 5, WIDTH // 6, 3), 24, np.uint8)
        tile[5:, 2 : 2 + SMALL_WIDTH] = cv2.resize(_shown(picture), (SMALL_WIDTH, height), interpolation=cv2.INTER_AREA)
        _write(tile, name[-24:], 8, 22, (255, 255, 255), left=True, size=0.42)
        tiles.append(tile)
    rows = []
    for start in range(0, len(tiles), 6):
        row = tiles[start : start + 6]
        row += [np.full_like(row[0], 24)] * (6 - len(row))
        rows.append(np.concatenate(row, axis=1))
    return rows


def _shown(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    # RAW colours are the sensor's: greenish. Each channel by its own white.
    white = np.maximum(np.quantile(linear, 0.995, axis=(0, 1)), 1e-6)
    return (255 * np.clip(linear / white, 0, 1) ** GAMMA).astype(np.uint8)


def _write(
    picture: NDArray[np.uint8], text: str, x: int, y: int, colour: tuple[int, int, int],
    *, left: bool = False, size: float = 0.6,
) -> None:  # fmt: skip
    """Write a text on a dark ground, wholly inside the picture."""
    import cv2

    (width, height), below = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    x = int(np.clip(x if left else x - width // 2, 2, max(picture.shape[1] - width - 2, 2)))
    y = int(np.clip(y, height + 2, picture.shape[0] - below - 2))
    ground = picture[max(y - height - 2, 0) : y + below, max(x - 2, 0) : x + width + 2]
    ground //= 3
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)

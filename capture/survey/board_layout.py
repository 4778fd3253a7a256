"""Which board photographs show: its dictionary, squares and markers, or the squares of a plain chessboard."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.camera.board import detector_gray
from capture.session.manifest import BoardTable
from capture.survey.small_pictures import Small

DICTIONARIES = ("DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL")
"""Each holds the smaller ones of its kind, under the same numbers."""
FEWEST, FEWEST_SHOTS = 6, 3
"""Markers that make a board, and pictures of one that make a camera: a chequered table is none."""
FEWEST_CORNERS = 4, 4
"""Inner corners along and across of a chessboard whose size nobody says: three by three are found on balls, too."""
LONGEST_SIDE = 3
"""Times its shorter one: no board is narrower."""


def find_board(pictures: Sequence[Small]) -> tuple[BoardTable | None, list[Small]]:
    """Return the board, and the pictures that show a board; None and none for too few of them."""
    grays = [detector_gray(one.light) for one in pictures]
    for name in DICTIONARIES:
        seen = [_markers(gray, name) for gray in grays]
        shown = [n for n, markers in enumerate(seen) if len(markers) >= FEWEST]
        if len(shown) >= FEWEST_SHOTS:
            layout = _charuco(name, [seen[n] for n in shown])
            return layout, [pictures[n] for n in shown] if layout else []
    found = {n: shape for n, gray in enumerate(grays) if (shape := _chessboard(gray))}
    shapes = list(found.values())
    shape = max(set(shapes), key=shapes.count, default=(0, 0))
    if shapes.count(shape) < FEWEST_SHOTS:
        return None, []
    return BoardTable(squares=[shape[0] + 1, shape[1] + 1]), [pictures[n] for n, one in found.items() if one == shape]


def _markers(gray: NDArray[np.uint8], name: str) -> dict[int, NDArray]:
    """Return the corners (4, 2) of each marker by its number."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(gray)
    return {} if ids is None else {int(n): c[0] for n, c in zip(np.ravel(ids), corners, strict=True)}


def _charuco(name: str, seen: list[dict[int, NDArray]]) -> BoardTable | None:
    """Return the board whose markers lie on a plane as they are seen to; the one of the least residual."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    count = 1 + max(max(markers) for markers in seen)
    # A tenth of a square: the wrong layout misses by whole ones.
    best, layout = 0.1, None
    for long in range(3, 2 * count + 2):
        for short in {(2 * count) // long, (2 * count + 1) // long}:
            if short < 2 or max(long, short) > LONGEST_SIDE * min(long, short) or long * short // 2 != count:
                continue
            board: Any = cv2.aruco.CharucoBoard((long, short), 1.0, 0.5, dictionary)
            centers = {int(n): np.mean(p, 0)[:2] for n, p in zip(board.getIds(), board.getObjPoints(), strict=True)}
            residual, share = _fit(centers, seen)
            if residual < best:
                plain = BoardTable(squares=[long, short], dictionary=name)
                best, layout = residual, plain.model_copy(update={"marker_mm": round(plain.square_mm * share, 2)})
    return layout


def _fit(centers: dict[int, NDArray], seen: list[dict[int, NDArray]]) -> tuple[float, float]:
    """Return the residual of the markers' centres on the board, in squares, and their side, in squares."""
    import cv2

    residuals, sides = [], []
    for markers in seen:
        ids = [n for n in markers if n in centers]
        if len(ids) < 4:
            continue
        places = np.array([centers[n] for n in ids], np.float32)
        middles = np.array([markers[n].mean(0) for n in ids], np.float32)
        homography, _ = cv2.findHomography(middles, places)
        if homography is None:
            return np.inf, np.nan
        found = cv2.perspectiveTransform(middles[:, None], homography)[:, 0]
        residuals.append(float(np.median(np.linalg.norm(found - places, axis=1))))
        for n in ids:
            corners = cv2.perspectiveTransform(markers[n][:, None].astype(np.float32), homography)[:, 0]
            sides.append(float(np.linalg.norm(corners - np.roll(corners, 1, 0), axis=1).mean()))
    return (float(np.median(residuals)), float(np.median(sides))) if residuals else (np.inf, np.nan)


def _chessboard(gray: NDArray[np.uint8]) -> tuple[int, int] | None:
    """Return the inner corners along and across of a chessboard of any size."""
    import cv2

    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, _, meta = cv2.findChessboardCornersSBWithMeta(gray, FEWEST_CORNERS, flags)
    return (max(meta.shape), min(meta.shape)) if found and meta is not None else None

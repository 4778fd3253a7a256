"""The camera by photographs of a ChArUco board or a plain chessboard."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.photographs.develop import DevelopRecipe, read_photograph
from capture.session.manifest import BoardTable
from capture.session.session_types import CaptureSession
from scene.camera import Camera
from scene.errors import SessionError
from scene.frames import decode, gray
from scene.reading import reading

Corners = tuple[NDArray, NDArray]
"""(N, 1, 3) on the board and (N, 1, 2) in the picture."""
FEWEST = 8
SQUARE_PIXELS = 0.05
"""How far fx and fy may differ, relative, beyond three sigmas: cameras' pixels are square."""


def calibrate_board(board: BoardTable, session: CaptureSession) -> tuple[Camera, str]:
    """Return the camera, full size, with distortion, by a session's photographs of a board; and a note on its errors.

    Zhang's method [Zhang2000] on the corners of a ChArUco board [GarridoJurado2014] or of a chessboard [Duda2018]. The
    sigmas are those of the least squares: what the corners' scatter about the fit leaves open. A board that is not
    flat is not in them. SessionError for an unknown dictionary, or fewer than 3 shots in which the board was found.
    """
    source = "chessboard" if board.dictionary is None else "ChArUco"
    key = f"camera.{source.lower()}"
    corners_of = _chessboard(board) if board.dictionary is None else _charuco(board, board.dictionary)
    matched, size, missed = [], None, []
    for file in session.board_shots:
        photograph = read_photograph(file, DevelopRecipe(session.encoding, False, file))
        picture = detector_gray(gray(decode(photograph.codes)))
        size = size or picture.shape
        if picture.shape != size:
            raise SessionError(
                f"{key}: {file.name} is {picture.shape[1]} x {picture.shape[0]} px, the first shot {size[1]} "
                f"x {size[0]}. All must be of the frames' size."
            )
        corners = corners_of(picture)
        if corners is None or len(corners[0]) < FEWEST:
            missed.append(f"{file.name} ({0 if corners is None else len(corners[0])} corners)")
        else:
            matched.append(corners)
    if len(matched) < 3 or size is None:
        raise SessionError(
            f"{key}: the board was found in {len(matched)} of {len(session.board_shots)} shots, at least 3 are "
            f"needed (too few corners in {', '.join(missed[:6])}). Check [camera] board, light it evenly, fill the "
            "picture with it, tilt it differently in each shot."
        )
    do = "Tilt the board differently in each shot, and fill the picture with it."
    with reading(key, "gives no camera", SessionError, do=do):
        objects, images = map(list, zip(*matched, strict=True))
        return _camera_of_corners(objects, images, size, missed, key, source)


def _charuco(board: BoardTable, name: str) -> Callable[[NDArray[np.uint8]], Corners | None]:
    """Return what finds a ChArUco board's corners in a picture."""
    import cv2

    known = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    if name not in known:
        raise SessionError(f'camera.board.dictionary: found "{name}"; known are {", ".join(known)}.')
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    pattern = cv2.aruco.CharucoBoard(tuple(board.squares), board.square_mm, board.marker_mm or 0.0, dictionary)
    detector = cv2.aruco.CharucoDetector(pattern)
    match: Any = pattern.matchImagePoints

    def find(picture: NDArray[np.uint8]) -> Corners | None:
        corners, ids, _, _ = detector.detectBoard(picture)
        return None if ids is None or len(ids) < FEWEST else match(corners, ids)

    return find


def _chessboard(board: BoardTable) -> Callable[[NDArray[np.uint8]], Corners | None]:
    """Return what finds a chessboard's inner corners in a picture; it must be seen whole."""
    import cv2

    inner = board.squares[0] - 1, board.squares[1] - 1
    columns, rows = np.meshgrid(np.arange(inner[0]), np.arange(inner[1]))
    places = board.square_mm * np.stack([columns, rows, np.zeros_like(rows)], -1).reshape(-1, 1, 3).astype(np.float32)

    def find(picture: NDArray[np.uint8]) -> Corners | None:
        found, corners = cv2.findChessboardCornersSB(picture, inner)
        return (places, corners) if found else None

    return find


def _camera_of_corners(
    objects: list[NDArray], images: list[NDArray], size: tuple[int, ...], missed: list[str], key: str, source: str
) -> tuple[Camera, str]:
    import cv2

    # OpenCV's stubs demand matrices where None lets it choose.
    calibrate: Any = cv2.calibrateCameraExtended
    rms, matrix, distortion, _, _, sigma, _, _ = calibrate(objects, images, (size[1], size[0]), None, None)
    fx, fy, cx, cy = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    sigma_fx, sigma_fy, sigma_cx, sigma_cy = map(float, np.ravel(sigma)[:4])
    if abs(np.log(fx / fy)) > SQUARE_PIXELS + 3 * np.hypot(sigma_fx / fx, sigma_fy / fy):
        raise SessionError(
            f"{key}: the board gives fx {fx:.0f} and fy {fy:.0f} px, but a camera's pixels are square. Count the "
            "board's squares along and across again; is it flat, and tilted differently in each shot?"
        )
    camera = Camera(
        *(size[1], size[0], fx, fy, cx, cy),
        distortion=tuple(map(float, np.ravel(distortion)[:5])),
        source=source,
        focal_sigma=max(sigma_fx / fx, sigma_fy / fy),
        center_sigma_px=max(sigma_cx, sigma_cy),
    )
    note = (
        f"camera: from {len(objects)} shots of the board, reprojection error {rms:.2f} px, fx {fx:.1f} +- "
        f"{sigma_fx:.1f} px, cx {cx:.1f} +- {sigma_cx:.1f}, cy {cy:.1f} +- {sigma_cy:.1f} px."
    )
    if missed:
        note += f" The board was not found in {', '.join(missed)}."
    if rms > 1:
        note += " An error above 1 px is too much: is the board flat, are the shots sharp, and at the same focus?"
    return camera, note


def detector_gray(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a linear gray picture in 8 bits, gamma-encoded, bright."""
    white = max(float(np.quantile(linear, 0.99)), 1e-6)
    return (255 * np.clip(linear / white, 0, 1) ** (1 / 2.2)).astype(np.uint8)

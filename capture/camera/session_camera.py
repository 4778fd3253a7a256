"""The camera of a session: what `session.toml` says, else a board's photographs, else EXIF, else orthographic."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from capture.camera.exif import Exif
from capture.camera.focal_length import camera_from_exif
from capture.photographs.develop import Recipe, read_photograph
from capture.session.session_types import Charuco, Session
from scene.camera import Camera
from scene.errors import SessionError
from scene.frames import decode
from scene.reading import reading

OFF_MIDDLE = 0.1
"""Share of the picture's side by which a principal point may lie off its middle without a word."""


def camera_of(session: Session, exif: Sequence[Exif], width: int, height: int) -> tuple[Camera, tuple[str, ...]]:
    """Return the camera of frames of the given size.

    Parameters
    ----------
    exif : sequence of Exif
        Of the flash frames.
    width, height : int
        Of the decoded frames (halved, if `frames.half`).

    Returns
    -------
    camera : Camera
    warnings : tuple of str
        Where the camera came from, unless the session states it, and what that costs.

    Raises
    ------
    SessionError
        [camera] is of another size than the frames, or the board was not found.
    """
    if isinstance(session.camera, Camera):
        camera = fitted(session.camera, session, width, height)
        return camera, _off_middle(camera)
    if isinstance(session.camera, Charuco):
        camera, note = calibrate_board(session.camera, session)
        return fitted(camera, session, width, height), (note,)
    if session.layout == "diligent":
        return Camera.orthographic(width, height, source="DiLiGenT layout"), ()
    return camera_from_exif(exif, width, height, half=session.half)


def _off_middle(camera: Camera) -> tuple[str, ...]:
    """Say where the principal point lies farther from the picture's middle than lenses have it."""
    off = (camera.cx - (camera.width - 1) / 2) / camera.width, (camera.cy - (camera.height - 1) / 2) / camera.height
    if camera.is_orthographic or max(map(abs, off)) < OFF_MIDDLE:
        return ()
    return (
        f"camera.cx, camera.cy: ({camera.cx:g}, {camera.cy:g}) lies {abs(off[0]):.0%} of the width and "
        f"{abs(off[1]):.0%} of the height off the middle of {camera.width} x {camera.height} px; lenses stay within "
        f"{OFF_MIDDLE:.0%}. Right only for photographs that were cropped on one side: each percent turns all lights "
        "and normals by half a degree or so.",
    )


def fitted(camera: Camera, session: Session, width: int, height: int) -> Camera:
    """Return the camera at the frames' size, as it is or halved with the superpixels; SessionError for another size."""
    if (camera.width, camera.height) == (width, height):
        return camera
    if session.half and (camera.width // 2, camera.height // 2) == (width, height):
        return camera.halved()
    remedy = (
        "Give the size that fx, fy, cx and cy refer to; it must be the photographs'."
        if not session.half
        else "With frames.half it must be the photographs' full size, or half of it."
    )
    raise SessionError(
        f"camera.width, camera.height: found {camera.width} x {camera.height}, but the frames are {width} x {height} "
        f"px. {remedy}"
    )


def calibrate_board(charuco: Charuco, session: Session) -> tuple[Camera, str]:
    """Return the camera, full size, with distortion, by photographs of a ChArUco board; and a note on its errors.

    Zhang's method [Zhang2000] on the corners of a ChArUco board [GarridoJurado2014]. The sigmas are those of the
    least squares: what the corners' scatter about the fit leaves open. A board that is not flat is not in them.
    SessionError for an unknown dictionary, or fewer than 3 shots in which the board was found.
    """
    import cv2

    known = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
    if charuco.dictionary not in known:
        raise SessionError(f'camera.board.dictionary: found "{charuco.dictionary}"; known are {", ".join(known)}.')
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, charuco.dictionary))
    board = cv2.aruco.CharucoBoard(charuco.squares, charuco.square_mm, charuco.marker_mm, dictionary)
    detector = cv2.aruco.CharucoDetector(board)
    matched, size, missed = [], None, []
    for file in charuco.files:
        picture = _board_picture(file, session)
        size = size or picture.shape
        if picture.shape != size:
            raise SessionError(
                f"camera.charuco: {file.name} is {picture.shape[1]} x {picture.shape[0]} px, the first shot {size[1]} "
                f"x {size[0]}. All must be of the frames' size."
            )
        corners, ids, _, _ = detector.detectBoard(picture)
        count = 0 if ids is None else len(ids)
        if count < 8:
            missed.append(f"{file.name} ({count} corners)")
            continue
        match: Any = board.matchImagePoints
        matched.append(match(corners, ids))
    if len(matched) < 3 or size is None:
        raise SessionError(
            f"camera.charuco: the board was found in {len(matched)} of {len(charuco.files)} shots, at least 3 are "
            f"needed (too few corners in {', '.join(missed[:6])}). Check squares and dictionary, light it evenly, "
            "fill the picture with it, tilt it differently in each shot."
        )
    do = "Tilt the board differently in each shot, and fill the picture with it."
    with reading("camera.charuco", "gives no camera", SessionError, do=do):
        objects, images = map(list, zip(*matched, strict=True))
        return _camera_of_corners(objects, images, size, missed)


def _camera_of_corners(
    objects: list[NDArray], images: list[NDArray], size: tuple[int, ...], missed: list[str]
) -> tuple[Camera, str]:
    import cv2

    # OpenCV's stubs demand matrices where None lets it choose.
    calibrate: Any = cv2.calibrateCameraExtended
    rms, matrix, distortion, _, _, sigma, _, _ = calibrate(objects, images, (size[1], size[0]), None, None)
    fx, fy, cx, cy = (float(matrix[i]) for i in ((0, 0), (1, 1), (0, 2), (1, 2)))
    sigma_fx, sigma_fy, sigma_cx, sigma_cy = map(float, np.ravel(sigma)[:4])
    camera = Camera(
        *(size[1], size[0], fx, fy, cx, cy),
        distortion=tuple(map(float, np.ravel(distortion)[:5])),
        source="ChArUco",
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


def _board_picture(file: Any, session: Session) -> NDArray[np.uint8]:
    """Return an 8-bit gray picture for the marker detector, full size, gamma-encoded, bright."""
    linear = decode(read_photograph(file, Recipe(session.encoding, False, file)).codes).mean(axis=-1)
    white = max(float(np.quantile(linear, 0.99)), 1e-6)
    return (255 * np.clip(linear / white, 0, 1) ** (1 / 2.2)).astype(np.uint8)

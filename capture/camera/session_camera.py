"""The camera of a session: what `session.toml` says, a board's photographs, EXIF, or orthographic."""

from collections.abc import Sequence

from capture.camera.board import calibrate_board
from capture.camera.exif import Exif
from capture.camera.focal_length import CENTER_SIGMA, camera_from_lens
from capture.session.manifest import SessionCameraTable
from capture.session.session_types import CaptureSession
from scene.camera import Camera
from scene.errors import SessionError

USUAL_FOCAL, USUAL_SIGMA = 1.8, 0.4
"""Focal length of lenses that objects on a table are photographed with, of the picture's longer side: 65 mm on full
frame; and its relative standard deviation."""
OFF_MIDDLE = 0.1
"""Share of the picture's side by which a principal point may lie off its middle without a word."""


def camera_of(session: CaptureSession, exif: Sequence[Exif], width: int, height: int) -> tuple[Camera, tuple[str, ...]]:
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
    stated = session.camera
    if isinstance(stated, Camera):
        camera = fitted(stated, session, width, height)
        return camera, _off_middle(camera)
    if stated and stated.board:
        camera, note = calibrate_board(stated.board, session)
        return fitted(camera, session, width, height), (note,)
    if session.layout == "diligent":
        return Camera.orthographic(width, height, source="DiLiGenT layout"), ()
    camera, warnings = camera_from_lens(stated or SessionCameraTable(), exif, width, height, half=session.half)
    known = [ball.kind for ball in session.spheres if ball.diameter_mm is not None]
    if camera.is_orthographic and len(known) > 1 and "chrome" in known and session.lights_file is None:
        # So many balls, a mirror among them, tell a focal length: `calibrate` finds it, and says so.
        return usual_camera(width, height), ()
    camera = fitted(camera, session, width, height)
    return camera, (*warnings, *_off_middle(camera))


def usual_camera(width: int, height: int) -> Camera:
    """Return a camera as most are."""
    longer, middle = max(width, height), ((width - 1) / 2, (height - 1) / 2)
    known = {"source": "assumed", "focal_sigma": USUAL_SIGMA, "center_sigma_px": CENTER_SIGMA * longer}
    return Camera(width, height, USUAL_FOCAL * longer, USUAL_FOCAL * longer, *middle, **known)


def _off_middle(camera: Camera) -> tuple[str, ...]:
    """Say where the principal point lies farther from the picture's middle than lenses have it."""
    off = (camera.cx - (camera.width - 1) / 2) / camera.width, (camera.cy - (camera.height - 1) / 2) / camera.height
    if camera.is_orthographic or max(map(abs, off)) < OFF_MIDDLE:
        return ()
    return (
        f"camera.cx, camera.cy: ({camera.cx:g}, {camera.cy:g}) lies {abs(off[0]):.0%} of the width and "
        f"{abs(off[1]):.0%} of the height off the middle of {camera.width} x {camera.height} px; lenses stay within "
        f"{OFF_MIDDLE:.0%}. Right only for photographs that were cropped on one side. Give pixels of the photographs' "
        "size, not mm; or leave cx and cy out.",
    )


def fitted(camera: Camera, session: CaptureSession, width: int, height: int) -> Camera:
    """Return the camera at the frames' size, as it is or halved with the superpixels; SessionError for another size."""
    if (camera.width, camera.height) == (width, height):
        return camera
    if session.half and (camera.width // 2, camera.height // 2) == (width, height):
        return camera.halved()
    remedy = "Give the size that fx, fy, cx and cy refer to; it must be the photographs'."
    if session.half:
        remedy = "With frames.half it must be the photographs' full size, or half of it."
    if (camera.height, camera.width) == (width, height):
        remedy = "They are exchanged: photographs count as they lie in the file, not turned by EXIF's orientation."
    raise SessionError(
        f"camera.width, camera.height: found {camera.width} x {camera.height}, but the frames are {width} x {height} "
        f"px. {remedy}"
    )

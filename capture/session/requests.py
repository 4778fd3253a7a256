"""What calibration and alignment are given of a session: the balls asked for, the object's mask."""

from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from capture.photographs.decode import decode
from capture.photographs.images import read_image
from capture.session.session_types import CaptureSession
from scene.camera import Camera
from scene.errors import SceneError, SessionError
from scene.frames import PEDESTAL, Frames
from scene.spheres import SphereRequest
from scene.store import Store


def sphere_requests(
    session: CaptureSession, store: Store, *, executor: Executor | None = None
) -> tuple[list[SphereRequest], tuple[str, ...]]:
    """Return the session's `[[spheres]]`, with masks read and balls' own photographs decoded, and warnings.

    The store holds the session's frames already. A ball that was shot apart gets frames of its own in
    spheres/<n>/frames, decoded by `executor`. What the audit says of them comes after the ball's key.

    Raises
    ------
    SessionError
        A mask or a ball's photographs are of another size than the frames.
    CaptureError
        A ball's photograph cannot be decoded.
    """
    header = store.load_frames()
    decoded: dict[tuple[Path, ...], Frames] = {}
    requests, warnings = [], []
    for i, spec in enumerate(session.spheres):
        key = f"spheres[{i}]"
        if spec.frames and spec.frames not in decoded:
            # The session's ambient frame shows the object's scene, not the ball's.
            own, place = replace(session, flash=spec.frames, ambient=(), spheres=()), store.path("spheres", str(i))
            decoded[spec.frames], report = decode(own, Store(place), executor=executor)
            warnings += [f"{key}: {text}" for text in report.warnings]
        frames = decoded.get(spec.frames)
        if frames is not None and (frames.height, frames.width) != (header.height, header.width):
            raise SessionError(
                f"{key}.frames: the ball's photographs are {frames.width} x {frames.height} px, the flash frames "
                f"{header.width} x {header.height}. Both must come from the same camera at the same size."
            )
        scale = hint_scale(session, header.width)
        center, radius = spec.center_px, spec.radius_px
        if center and radius:
            # Pixel centres are integers: 2 x 2 pixels around 0.5 become pixel 0.
            center = ((center[0] + 0.5) / scale - 0.5, (center[1] + 0.5) / scale - 0.5)
            radius /= scale
            if not (-radius < center[0] < header.width + radius and -radius < center[1] < header.height + radius):
                raise SessionError(
                    f"{key}.center_px: found {list(spec.center_px or ())}, outside of the picture of "
                    f"{header.width} x {header.height} px."
                )
            if radius > max(header.width, header.height):
                raise SessionError(
                    f"{key}.radius_px: found {spec.radius_px:g}, larger than the picture of {header.width} x "
                    f"{header.height} px; expected the radius of a ball that is seen whole."
                )
        mask = read_mask(spec.mask, header.height, header.width) if spec.mask else None
        requests.append(SphereRequest(spec.kind, spec.diameter_mm, center, radius, mask, frames))
    return requests, tuple(warnings)


def hint_scale(session: CaptureSession, width: int) -> int:
    """Return 2 where hints count full-size pixels of halved frames: they go with [camera], else the photographs."""
    if not session.half:
        return 1
    return 1 if isinstance(session.camera, Camera) and session.camera.width == width else 2


def object_box(session: CaptureSession, width: int) -> tuple[float, ...] | None:
    """Return the session's box about the object in pixels of frames that are `width` wide."""
    scale = hint_scale(session, width)
    return None if session.box is None else tuple((place + 0.5) / scale - 0.5 for place in session.box)


def read_mask(path: Path, height: int, width: int) -> NDArray[np.bool_]:
    """Return a mask image as (height, width) bool: True where it is brighter than half of its white.

    A mask of twice the size fits frames that were halved: a superpixel belongs if all four pixels do. SessionError if
    it is unreadable, of another size, or empty.
    """
    try:
        codes = read_image(path, "linear").codes
    except SceneError as error:
        raise SessionError(f"{path}: the mask cannot be read. Give a PNG, white where the object is.") from error
    values = codes.max(axis=-1).astype(np.float32)
    low, high = float(values.min()), float(values.max())
    mask = values > (low + high) / 2 if high > low else values > PEDESTAL
    if (mask.shape[0] // 2, mask.shape[1] // 2) == (height, width):
        mask = mask[: 2 * height, : 2 * width].reshape(height, 2, width, 2).all(axis=(1, 3))
    if mask.shape != (height, width):
        turned = " It is turned: the frames count as they lie in the file, not turned by EXIF's orientation."
        raise SessionError(
            f"{path}: the mask is {mask.shape[1]} x {mask.shape[0]} px, the frames {width} x {height}. "
            f"It must have the frames' size.{turned if mask.shape == (width, height) else ''}"
        )
    if not mask.any():
        raise SessionError(f"{path}: the mask is empty (one value everywhere). Paint the object white on black.")
    return mask

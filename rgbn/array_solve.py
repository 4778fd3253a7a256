"""Photometric stereo on arrays alone: images and lights in, normals out; no session, no files."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scene.camera import Camera
from scene.errors import SceneError
from scene.estimate import Estimate
from scene.frames import Frames, encode
from scene.lights import Lights
from solve.methods import method_of
from solve.solve import solve

WHOLE_NUMBERS = (np.uint8, np.uint16)
SPREAD_OF_LENGTHS = 100.0
"""Lights so much stronger than others are positions or a mistake, no intensities."""


def solve_arrays(
    images: ArrayLike,
    lights: ArrayLike | Lights | None,
    mask: ArrayLike | None = None,
    method: str = "iterative",
    camera: Camera | None = None,
    *,
    profile: str = "default",
    saturation: float | None = None,
) -> Estimate:
    """Recover normals and albedo of images under known lights, without a session.

    Parameters
    ----------
    images : (F, H, W) or (F, H, W, 3) array
        One image a light, [row, column], RGB or grey. The values must be linear in light, black at 0, with the ambient
        light subtracted. Whole numbers (uint8, uint16) are divided by their greatest value; floating point is taken as
        it is, in any unit. Whether values are sRGB-coded cannot be told from them: pictures for people (JPEG, most
        8-bit PNG) are, and must be decoded first, or the normals are bent by several degrees.
    lights : (F, 3) array or Lights or None
        A row a light: the vector from the surface toward the light, camera frame (x right, y up, z toward the viewer).
        Its direction is the light's, its length the light's intensity, in any unit common to all: a pixel is
        albedo * max(0, light . normal). Rows of length 1 are lights of equal intensity. `rgbn.Lights` where
        intensities differ between channels, or lights are near. None: for `ldr`, `entropy` and `tv`, which find
        the lights themselves.
    mask : (H, W) array, optional
        The object's pixels: not 0. Default: all.
    method : str
        One of `ls`, `iterative`, `position`, `l1`, `sbl`, `hsh`, `rpca`, `semicalibrated`, `near`, `reflectance`,
        `metal`, `ldr`, `entropy`, `tv`.
    camera : Camera, optional
        Needed for near lights. Default: orthographic.
    profile : str
        Settings of the method: `default` or `seed`.
    saturation : float, optional
        The value of the images from which a sample is clipped and left out. Default: 0.98 of the greatest value of
        whole numbers; none of floating point.

    Returns
    -------
    Estimate
        normals (H, W, 3), unit, camera frame, NaN outside the mask and where too few images are lit; albedo (H, W, 3),
        in the images' unit (whole numbers: white is 1) under a light of length 1; sigma_deg, samples, warnings.

    Raises
    ------
    SceneError
        Shapes that do not fit, images that are not finite inside the mask, lights of no length, unknown
        method. CalibrationError (a SceneError): fewer than three lights, or lights in one plane.

    Examples
    --------
    >>> estimate = rgbn.solve(images, lights, mask)
    >>> estimate.normals
    """
    what = method_of(method.strip().casefold())
    if lights is None and what.is_calibrated:
        raise SceneError(
            f"lights: None, but {what.name} needs to know them. Give a vector (3,) for each image; or choose ldr, "
            "entropy or tv, which find the lights themselves."
        )
    stack = _stack(images, lights)
    count, height, width = stack.shape[:3]
    inside = _mask(mask, height, width)
    _check_values(stack, inside)
    known = _lights(lights, count)
    if known.positions_mm is not None and camera is None:
        raise SceneError("camera: None, but the lights are near. Give the camera: a pixel's place decides its light.")
    camera = camera or Camera.orthographic(width, height)
    if (camera.width, camera.height) != (width, height):
        raise SceneError(f"camera: {camera.width} x {camera.height} px, but the images are {width} x {height} px.")
    return solve(what, _frames(known.names, stack, saturation), known, camera, inside, profile=profile)


def _stack(images: ArrayLike, lights: Any) -> NDArray:
    """Return the images (F, H, W, 3), a view where it can be."""
    try:
        stack = np.asarray(images)
    except ValueError as error:
        raise SceneError(f"images: no array: {error}. Give images of one size, (F, H, W) or (F, H, W, 3).") from error
    if stack.dtype not in WHOLE_NUMBERS and stack.dtype.kind != "f":
        raise SceneError(
            f"images: found {stack.dtype}, expected floating point, uint8 or uint16. The greatest value of another "
            "type is unknown: divide by it, and give floating point."
        )
    shape = (len(lights), 3) if isinstance(lights, Lights) else np.shape(lights)
    count = shape[0] if len(shape) == 2 and shape[1] == 3 else None
    if stack.ndim not in (3, 4) or (stack.ndim == 4 and stack.shape[3] != 3) or not stack.size:
        raise SceneError(
            f"images: found an array {stack.shape}, expected (F, H, W) or (F, H, W, 3).{_turned(stack, count)}"
        )
    if count and len(stack) != count and (turned := _turned(stack, count)):
        raise SceneError(f"images: found an array {stack.shape} for {count} lights, expected the images first.{turned}")
    return stack if stack.ndim == 4 else np.broadcast_to(stack[..., None], (*stack.shape, 3))


def _turned(stack: NDArray, count: int | None) -> str:
    """Return what to do where the last axis is that of the images."""
    return " Give np.moveaxis(images, -1, 0)." if count and stack.ndim > 2 and stack.shape[-1] == count else ""


def _mask(mask: ArrayLike | None, height: int, width: int) -> NDArray[np.bool_]:
    if mask is None:
        return np.ones((height, width), bool)
    inside = np.asarray(mask)
    if inside.shape != (height, width):
        raise SceneError(f"mask: found an array {inside.shape}, expected ({height}, {width}) as the images.")
    inside = inside != 0
    if not inside.any():
        raise SceneError("mask: it is empty. Give the object's pixels as True.")
    return inside


def _check_values(stack: NDArray, inside: NDArray[np.bool_]) -> None:
    if stack.dtype in WHOLE_NUMBERS:
        return
    for index, image in enumerate(stack):
        bad = ~np.isfinite(image[inside])
        if bad.any():
            raise SceneError(
                f"images[{index}]: {int(bad.sum())} values inside the mask are not finite. Leave these pixels out of "
                "the mask, or mend the image."
            )


def _lights(lights: ArrayLike | Lights | None, count: int) -> Lights:
    names = tuple(f"image_{index}" for index in range(count))
    if lights is None:
        return Lights.unknown(names)
    if isinstance(lights, Lights):
        if len(lights) != count:
            raise SceneError(f"lights: found {len(lights)}, but there are {count} images. Give one light an image.")
        return lights
    vectors = np.asarray(lights, np.float64)
    if vectors.shape != (count, 3):
        cure = " Give lights.T." if vectors.shape == (3, count) else " Give one row an image: x, y, z."
        raise SceneError(f"lights: found an array {vectors.shape}, expected ({count}, 3) for {count} images.{cure}")
    lengths = np.linalg.norm(vectors, axis=1)
    bad = np.flatnonzero(~np.isfinite(lengths) | (lengths == 0))
    if bad.size:
        rows = ", ".join(map(str, bad[:5]))
        raise SceneError(f"lights: row {rows} has no direction (zeros or NaN). Leave that light and its image out.")
    if lengths.max() > SPREAD_OF_LENGTHS * lengths.min():
        raise SceneError(
            f"lights: their lengths are their intensities, and these run from {lengths.min():.3g} to "
            f"{lengths.max():.3g}. For directions alone give lights / np.linalg.norm(lights, axis=1, keepdims=True)."
        )
    return Lights(names, vectors / lengths[:, None], np.repeat(lengths[:, None], 3, 1))


def _frames(names: tuple[str, ...], stack: NDArray, saturation: float | None) -> Frames:
    """Return the stack as frames; floating point is kept as it is."""
    gain = np.ones(len(stack))
    if stack.dtype not in WHOLE_NUMBERS:
        values = stack if stack.dtype == np.float32 else stack.astype(np.float32)
        return Frames(names, values, gain, saturation=np.inf if saturation is None else float(saturation))
    white = np.iinfo(stack.dtype).max
    # By a table: the whole stack as float32 may not fit into memory.
    codes = encode(np.arange(white + 1, dtype=np.float32) / white)[stack]
    return Frames(names, codes, gain, saturation=Frames.saturation if saturation is None else saturation / white)

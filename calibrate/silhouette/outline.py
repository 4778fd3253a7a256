"""A ball's outline as a curve in the picture, and the photographs along the lines that cross it."""

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.frames import PEDESTAL, WHITE, Frames, decode
from scene.spheres import Sphere

Array = NDArray[np.float64]
CLIPPED = 0.95  # share of the sensor's saturation from which an interpolated sample may hold a clipped one
BINS = 72
"""Profiles along the outline, each a mean of neighbours: amplitudes may be averaged, a shift read in noise may not."""
SECTOR = np.arange(BINS) // 3
"""Errors along an outline come in arcs (a shadow, a reflection): an arc of three profiles counts as one observation."""
OUTLINE_STEP_PX = 0.05  # of the differences that give the Jacobian


def moved(sphere: Sphere, shift: Array) -> Sphere:
    """Return the ball shifted by (u, v, radius), pixels."""
    return replace(sphere, center_px=sphere.center_px + shift[:2], radius_px=float(sphere.radius_px + shift[2]))


def difference(a: Sphere, b: Sphere) -> Array:
    """Return (3,), how far two outlines differ in u, v and radius, px."""
    return np.array([*(a.center_px - b.center_px), a.radius_px - b.radius_px])


def circles_apart(a: Sphere, b: Sphere) -> float:
    """Return the greatest distance between two circles' points, px."""
    return float(np.hypot(*(a.center_px - b.center_px))) + abs(a.radius_px - b.radius_px)


def outline_with_normals(camera: Camera, sphere: Sphere, count: int) -> tuple[Array, Array]:
    """Return points (N, 2) on the outline and outward normals (N, 2)."""
    points = sphere.outline(camera, count)
    tangent = np.roll(points, -1, 0) - np.roll(points, 1, 0)
    normals = np.stack([tangent[:, 1], -tangent[:, 0]], -1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals *= np.sign(np.nanmean(np.sum(normals * (points - points.mean(0)), 1)))
    return points, normals


def offset_jacobian(camera: Camera, sphere: Sphere, points: Array, normals: Array) -> Array:
    """Return (N, 3), what the outline's offset along each normal changes by with u, v and radius."""
    shifted = [moved(sphere, shift).outline(camera, len(points)) for shift in np.eye(3) * OUTLINE_STEP_PX]
    return np.stack([np.sum((to - points) * normals, 1) / OUTLINE_STEP_PX for to in shifted], -1)


def binned_outline(camera: Camera, sphere: Sphere) -> tuple[Array, Array, Array]:
    """Return points and normals (`BINS` k, 2), about a pixel apart, and the bins' mean Jacobian (`BINS`, 3)."""
    count = BINS * int(np.clip(np.ceil(2 * np.pi * sphere.radius_px / BINS), 2, 12))
    points, normals = outline_with_normals(camera, sphere, count)
    return points, normals, offset_jacobian(camera, sphere, points, normals).reshape(BINS, -1, 3).mean(1)


def outline_shift(camera: Camera, sphere: Sphere) -> Array:
    """Return (3, 3): what (u, v, radius) must change by with log f, cx and cy so that the outline stays where it is.

    The outline was measured, the cone is inferred. What is left over, that the ellipse is a little longer or shorter,
    is not used: it gives the focal length to 2 % a ball at best, and a lens whose k1 is 0.05 fakes 10 %.
    """
    points, normals = outline_with_normals(camera, sphere, 90)
    jacobian = offset_jacobian(camera, sphere, points, normals)
    other = [
        replace(camera, fx=camera.fx * 1.001, fy=camera.fy * 1.001),
        replace(camera, cx=camera.cx + 1),
        replace(camera, cy=camera.cy + 1),
    ]
    offsets = [np.sum((sphere.outline(c, 90) - points) * normals, 1) for c in other]
    return np.asarray(-np.linalg.lstsq(jacobian, np.stack(offsets, -1) / [0.001, 1.0, 1.0], rcond=None)[0], np.float64)


def across(points: Array, normals: Array, offsets: Array) -> Array:
    """Return the places (N, M, 2) at offsets (M,) along the normals (N, 2)."""
    return points[:, None] + offsets[:, None] * normals[:, None]


def sampled(image: NDArray, places: NDArray) -> NDArray[np.float32]:
    """Return an image (h, w[, C]) interpolated at places (N, M, 2)."""
    where = places.astype(np.float32)
    return np.asarray(cv2.remap(image, where[..., 0], where[..., 1], cv2.INTER_LINEAR), np.float32)


def inside_picture(camera: Camera, places: NDArray) -> NDArray[np.bool_]:
    """Return which of the places (..., 2) lie in the picture."""
    return np.all((places >= 0) & (places <= [camera.width - 1, camera.height - 1]), axis=-1)


def share_in_picture(camera: Camera, sphere: Sphere) -> float:
    """Return the share of a ball's outline that the picture's border does not cut off."""
    return float(np.mean(inside_picture(camera, sphere.outline(camera, 180))))


def image_strips(image: NDArray, points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
    """Return (1, N, M), an image (H, W) across an outline; NaN outside of it."""
    where = across(points, normals, offsets).astype(np.float32)
    inside = np.all((where >= 0) & (where <= np.array(image.shape[::-1]) - 1), axis=-1)
    return np.where(inside, sampled(image, where), np.float32(np.nan))[None]


def read_strips(frames: Frames, points: Array, normals: Array, offsets: Array) -> NDArray[np.float32]:
    """Return (F, N, M), the frames across an outline: linear, mean of the channels, ambient subtracted.

    NaN outside the picture and where a channel is clipped.
    """
    where = across(points, normals, offsets)
    out = np.full((len(frames), *where.shape[:2]), np.nan, np.float32)
    low = np.clip(np.floor(np.nanmin(where, axis=(0, 1))).astype(int), 0, None)
    high = np.minimum(np.ceil(np.nanmax(where, axis=(0, 1))).astype(int) + 2, [frames.width, frames.height])
    if np.any(high - low < 2):
        return out
    box = (slice(low[1], high[1]), slice(low[0], high[0]))
    outside = np.any((where < 0) | (where > [frames.width - 1, frames.height - 1]), -1)
    places = np.moveaxis(where - low, -1, 0).astype(np.float32, order="C")
    limit = CLIPPED * frames.saturation
    if frames.codes.dtype == np.uint16:
        limit = limit * (WHITE - PEDESTAL) + PEDESTAL
    ambient = np.float32(0) if frames.ambient is None else _decoded(frames.ambient[box], places)[0]
    for index, gain in enumerate(frames.gain.astype(np.float32)):
        values, brightest = _decoded(frames.codes[index][box], places)
        out[index] = values * gain - ambient
        out[index, outside | (brightest >= limit)] = np.nan
    return out


def _decoded(codes: NDArray, places: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray]:
    """Interpolate codes (h, w, 3) at (2, n, M) places: the channels' linear mean and the highest code."""
    # A view of the file: only the pixels about the places are ever touched.
    view = np.asarray(codes) if codes.dtype == np.uint16 else codes.astype(np.float32)
    u, v = places
    found = cv2.remap(view, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    highest = np.maximum(np.maximum(found[..., 0], found[..., 1]), found[..., 2])
    return np.asarray(cv2.transform(decode(found), np.full((1, 3), 1 / 3, np.float32)), np.float32), highest

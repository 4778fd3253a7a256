"""What a chrome ball mirrors of the table beside it, looked up in the photographs that show both."""

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrate.lights.directions import mirrored_rays
from calibrate.silhouette.cone_fit import STEP_PX, curvature_shift_px
from calibrate.silhouette.outline import BINS, binned_outline, outline_with_normals, read_strips
from scene.camera import Camera
from scene.frames import Frames, decode, gray
from scene.spheres import Sphere

Array = NDArray[np.float64]
Values = NDArray[np.floating]
DEPTH = 0.15  # radii inside the outline to which the mirror is followed: there it shows the table 1.5 radii away
DEEP_STEP = 0.015  # radii between the samples where the mirror's picture is no longer squeezed
SURROUNDINGS = 3.2  # radii around the ball's centre in which the table is looked up,
LOOKED_UP_AT_PX = 100.0  # in a picture in which the ball is at most so large: what is mirrored is squeezed,
SMOOTH_PX = 1.0  # with this blur: the picture's noise would pass for a slope of what is looked up
PER_BIN = 3  # directions in which the table is looked up for each profile


def sized(sphere: Sphere) -> Sphere:
    """Return the ball with a radius of `radius_px` units of length: an orthographic camera's pixel is one such."""
    return replace(sphere, diameter_mm=2 * sphere.radius_px)


def mirrored_pixels(camera: Camera, ball: Sphere, plane: Array, points: Array, mirrored: Array) -> Array:
    """Return the pixels (..., 2) that show what a `sized` ball mirrors; NaN where its rays miss the plane.

    The rays leave `points` (..., 3) along `mirrored` (..., 3); `plane` is as in `TablePlane.values`.
    """
    up = np.array([plane[0], plane[1], 1.0]) / np.hypot(1, np.hypot(plane[0], plane[1]))
    foot = ball.center_mm(camera) - plane[2] * ball.radius_mm * up
    with np.errstate(divide="ignore", invalid="ignore"):
        far = np.sum((foot - points) * up, -1) / np.sum(mirrored * up, -1)
    return camera.project(points + np.where(far > 0, far, np.nan)[..., None] * mirrored)


class Shown(NamedTuple):
    """What a mirror meets (F, BINS, K) between depths (K + 1,) inside its outline, px; NaN where that is unknown.

    `facing` (K,): cosines between the normal and the view there.
    """

    depths: Array
    facing: Array
    values: Values
    radius_px: float

    def blurred(self, offsets: Array, blur_px: float, reflectance: Array) -> Values:
        """Return (F, BINS, M) at offsets (M,) outward of the outline, NaN where what is unknown reaches.

        reflectance: (K,), at the cosines `facing`.
        """
        s = offsets + curvature_shift_px(blur_px, self.radius_px)
        kernel = np.diff(ndtr((s[:, None] + self.depths) / blur_px), axis=1) * reflectance
        known = np.isfinite(self.values)
        out = np.where(known, self.values, 0) @ kernel.T.astype(np.float32)
        until = np.where(known.all(0), self.depths[-1], self.depths[:-1]).min(-1)
        out[:, 3 * blur_px - offsets > until[:, None]] = np.nan
        return out


class _Looking(NamedTuple):
    """Where a ball is looked at inside its outline, and where to from there; whatever the plane."""

    facing: Array  # (K + 1,)
    outline: Array  # (N, 2)
    normals: Array  # (N, 2)
    points: Array  # (N, K, 3)
    mirrored: Array  # (N, K, 3)


class Surroundings:
    """The table around a ball, in F frames, at a size at which looking up is cheap."""

    def __init__(self, frames: Frames, camera: Camera, sphere: Sphere) -> None:
        self.frames, self.camera = frames, camera
        self.last: tuple[tuple[float, ...], _Looking] | None = None
        reach = SURROUNDINGS * sphere.radius_px
        low = np.maximum(sphere.center_px - reach, 0).astype(int)
        high = np.minimum(sphere.center_px + reach + 1, [camera.width, camera.height]).astype(int)
        window = slice(low[1], high[1]), slice(low[0], high[0])
        shrink = max(1.0, sphere.radius_px / LOOKED_UP_AT_PX)
        size = tuple(int(n) for n in np.maximum((high - low) / shrink, 1))
        self.corner, self.shrink = low, (high - low) / size
        self.images = []
        dark = 0.0 if frames.ambient is None else gray(decode(np.ascontiguousarray(frames.ambient[window])))
        for codes, gain in zip(frames.codes, frames.gain, strict=True):
            image = gray(decode(np.ascontiguousarray(codes[window]))) * np.float32(gain) - dark
            small = cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            self.images.append(cv2.GaussianBlur(small, (0, 0), SMOOTH_PX))

    def _look_up(self, pixels: Array) -> Values:
        """Return (F, N, K) values at pixels (N, K, 2), NaN outside."""
        place = (pixels - self.corner + 0.5) / self.shrink - 0.5
        height, width = self.images[0].shape
        outside = ~np.all((place >= 0) & (place <= [width - 1, height - 1]), -1)
        place = np.nan_to_num(place, nan=-1.0).astype(np.float32)
        out = np.stack([cv2.remap(i, place[..., 0], place[..., 1], cv2.INTER_LINEAR) for i in self.images])
        out[:, outside] = np.nan
        return out.astype(np.float32, copy=False)

    def mirrored_by(self, sphere: Sphere, plane: Array, blur_px: float, per_bin: int = PER_BIN) -> Shown:
        """Return what a chrome ball shows of the table: `plane` as in `TablePlane.values`."""
        at = self._looking(sphere, blur_px, per_bin)
        pixels = mirrored_pixels(self.camera, sized(sphere), plane, at.points, at.mirrored)
        # Beside the outline itself the picture is blurred with the ball.
        away = np.sum((pixels - at.outline[:, None]) * at.normals[:, None], -1)
        pixels += np.maximum(2.5 * blur_px - away, 0)[..., None] * at.normals[:, None]
        values = self._look_up(pixels)
        values = values.reshape(len(values), BINS, per_bin, -1).mean(2)
        depths = sphere.radius_px * (1 - np.sqrt(1 - at.facing**2))
        return Shown(depths, 0.5 * (at.facing[1:] + at.facing[:-1]), values, sphere.radius_px)

    def _looking(self, sphere: Sphere, blur_px: float, per_bin: int) -> _Looking:
        """Return the rays, kept for the next plane that is tried under the same ball."""
        radius = sphere.radius_px
        key = (*sphere.center_px.tolist(), radius, blur_px, per_bin)
        if self.last is None or self.last[0] != key:
            deepest = np.sqrt(1 - (1 - max(DEPTH, 8 * blur_px / radius)) ** 2)
            # Even steps of the normal: near the outline the mirror's picture is squeezed without bound.
            facing = np.linspace(0, deepest, int(np.clip(0.6 * radius, 24, 60)) + 1)
            middle = radius * (1 - np.sqrt(1 - (0.5 * (facing[1:] + facing[:-1])) ** 2))
            outline, normals = outline_with_normals(self.camera, sphere, per_bin * BINS)
            inside = outline[:, None] - middle[:, None] * normals[:, None]
            rays = mirrored_rays(self.camera, sized(sphere), inside)
            self.last = key, _Looking(facing, outline, normals, *rays)
        return self.last[1]

    def profiles(self, sphere: Sphere, blur_px: float) -> tuple[Values, Array, Array]:
        """Return profiles (F, BINS, M) across an outline, their offsets (M,) and the Jacobian (BINS, 3)."""
        points, normals, jacobian = binned_outline(self.camera, sphere)
        near = np.arange(-6 * blur_px, 2.6 * blur_px + 2, STEP_PX)
        step = max(STEP_PX, DEEP_STEP * sphere.radius_px)
        deep = np.arange(-max(DEPTH * sphere.radius_px - 3 * blur_px, 0), near[0] - 0.01, step)
        offsets = np.concatenate([deep, near])
        strips = read_strips(self.frames, points, normals, offsets)
        return strips.reshape(len(strips), BINS, -1, len(offsets)).mean(2), offsets, jacobian

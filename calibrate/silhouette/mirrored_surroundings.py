"""What a chrome ball mirrors of the table beside it, looked up in the photographs that show both."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrate.lights.directions import mirrored_rays
from calibrate.silhouette.cone_fit import STEP_PX, blurred_ramp, curvature_shift_px
from calibrate.silhouette.outline import BINS, binned_outline, moved, outline_with_normals, read_strips
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
COVERED = 1.1  # radii of another ball, within which it hides the table
PER_BIN = 3  # directions in which the table is looked up for each profile
EVERY, MIDDLE = slice(None), slice(PER_BIN // 2, None, PER_BIN)  # all directions, and the middle one of each profile
MOVE = 1e-4  # px, of the differences by which what is looked up moves
SLOPE_SIGMA = 0.1  # how far the slopes of the planes under two balls differ: tables are not flat
CONTRADICTS = 3.0  # sigmas by which two slopes of one table cannot differ
STANDS_SIGMA, FOOT_SIGMA = 0.001, 0.3
"""Sigma of the distance from a ball's centre to its table, in radii: of a ball that stands on it, whose distance is 1,
and of one on a foot (a ring, putty) of unknown height."""


class TablePlane(NamedTuple):
    """Slopes n_x / n_z and n_y / n_z of a table's normal, its distance from a ball's centre in radii; their sigmas."""

    values: Array  # (3,)
    sigma: Array  # (3,)

    @property
    def height(self) -> float:
        """How high above it the ball stands, on a foot, radii."""
        return float(self.values[2] - 1)

    @property
    def of_unknown_height(self) -> "TablePlane":
        """The same table where nothing says that the ball stands on it."""
        return self._replace(sigma=np.append(self.sigma[:2], FOOT_SIGMA))

    def contradicts(self, other: "TablePlane") -> bool:
        """Whether another's slopes differ by more than both are in doubt."""
        off = np.abs(self.values[:2] - other.values[:2])
        return bool((off > CONTRADICTS * np.hypot(self.sigma[:2], other.sigma[:2])).any())

    @property
    def steepness(self) -> float:
        """Tangent of the angle between the table's normal and the view."""
        return float(np.hypot(*self.values[:2]))


ANY_PLANE = TablePlane(np.array([0.0, 0.0, 1.0]), np.array([1.0, 1.0, STANDS_SIGMA]))
"""What is known before the table is seen: a small ball shows little of it."""


def shared_plane(planes: Sequence[TablePlane]) -> TablePlane | None:
    """Return what other balls' planes say of that on which one stands, each as sure as it is; None of none."""
    if not planes:
        return None
    slopes = np.stack([plane.values[:2] for plane in planes])
    weight = 1 / (np.stack([plane.sigma[:2] for plane in planes]) ** 2 + SLOPE_SIGMA**2)
    mean, total = (weight * slopes).sum(0) / weight.sum(0), weight.sum(0)
    return TablePlane(np.append(mean, 1.0), np.append(1 / np.sqrt(total), STANDS_SIGMA))


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


class MirroredView(NamedTuple):
    """What a mirror meets (F, BINS, K) between depths (K + 1,) inside its outline, px; NaN where that is unknown."""

    depths: Array
    values: Values
    radius_px: float
    until: Array  # (BINS,) px, the depth down to which all of it is known

    def blurred(self, offsets: Array, blur_px: float, reflectance: Array) -> Values:
        """Return (F, BINS, M) at offsets (M,) outward of the outline, of what is known; NaN beyond it.

        reflectance: (K,), at `MirroredSamples.middle`.
        """
        s = offsets + curvature_shift_px(blur_px, self.radius_px)
        kernel = np.diff(ndtr((s[:, None] + self.depths) / blur_px), axis=1) * reflectance
        known = self.depths[1:] <= self.until[:, None]
        out = np.where(known, self.values, 0) @ kernel.T.astype(np.float32)
        out[:, -offsets > self.until[:, None]] = np.nan
        return out

    def basis(self, offsets: Array, blur_px: float) -> Values:
        """Return (BINS, M, 3), the blurred profiles of what is not looked up.

        Outside, its value at the outline, and its slope; and inside, beyond what is known, its value.
        """
        s = offsets + curvature_shift_px(blur_px, self.radius_px)
        beyond = np.where(self.until < self.depths[-1], self.until, np.inf)
        inside = ndtr(-(s + beyond[:, None]) / blur_px)
        both = np.stack([ndtr(s / blur_px), blurred_ramp(s, blur_px)], -1)
        return np.concatenate([np.broadcast_to(both, (*inside.shape, 2)), inside[..., None]], -1).astype(np.float32)


class MirroredSamples(NamedTuple):
    """Where a ball is looked at; the same samples throughout a fit, or its sum of squares would jump."""

    offsets: Array  # (M,) across its outline, px outward
    facing: Array  # (K + 1,) cosines between normal and view, inside of it
    blur_px: float  # for which they are chosen

    @property
    def middle(self) -> Array:
        """(K,) the cosines at which the mirror is looked at."""
        return 0.5 * (self.facing[1:] + self.facing[:-1])


def samples(radius_px: float, blur_px: float) -> MirroredSamples:
    """Return samples of an outline: finely near it, where all is squeezed, and by even steps of the normal inside."""
    near = np.arange(-6 * blur_px, 2.6 * blur_px + 2, STEP_PX)
    step = max(STEP_PX, DEEP_STEP * radius_px)
    deep = np.arange(-max(DEPTH * radius_px - 3 * blur_px, 0), near[0] - 0.01, step)
    deepest = np.sqrt(1 - (1 - min(max(DEPTH, 8 * blur_px / radius_px), 1.0)) ** 2)
    facing = np.linspace(0, deepest, int(np.clip(0.6 * radius_px, 24, 60)) + 1)
    return MirroredSamples(np.concatenate([deep, near]), facing, blur_px)


class _Looking(NamedTuple):
    """Where a ball is looked at inside its outline, and where to from there; whatever the plane."""

    ball: Sphere
    outline: Array  # (N, 2)
    normals: Array  # (N, 2)
    points: Array  # (N, K, 3)
    mirrored: Array  # (N, K, 3)


class Surroundings:
    """The table around a ball, in F frames, at a size at which looking up is cheap; unknown where `others` stand."""

    def __init__(self, frames: Frames, camera: Camera, sphere: Sphere, others: Sequence[Sphere] = ()) -> None:
        self.frames, self.camera = frames, camera
        self.last: tuple[tuple[float, ...], _Looking] | None = None
        reach = SURROUNDINGS * sphere.radius_px
        low = np.maximum(sphere.center_px - reach, 0).astype(int)
        high = np.minimum(sphere.center_px + reach + 1, [camera.width, camera.height]).astype(int)
        window = slice(low[1], high[1]), slice(low[0], high[0])
        shrink = max(1.0, sphere.radius_px / LOOKED_UP_AT_PX)
        size = tuple(int(n) for n in np.maximum((high - low) / shrink, 2))
        self.corner, self.shrink, self.size = low, (high - low) / size, size
        images = []
        dark = 0.0 if frames.ambient is None else gray(decode(np.ascontiguousarray(frames.ambient[window])))
        for codes, gain in zip(frames.codes, frames.gain, strict=True):
            image = gray(decode(np.ascontiguousarray(codes[window]))) * np.float32(gain) - dark
            small = cv2.resize(image.astype(np.float32), size, interpolation=cv2.INTER_AREA)
            images.append(cv2.GaussianBlur(small, (0, 0), SMOOTH_PX))
        covered = np.zeros(high[::-1] - low[::-1], np.uint8)
        for other in others:
            place = np.round(other.center_px - low).astype(int).tolist()
            cv2.circle(covered, place, round(COVERED * other.radius_px), 1, cv2.FILLED)
        # The frames last: what is looked up at one place in all of them lies together.
        self.images = np.stack(images, -1).reshape(size[0] * size[1], len(images))
        self.images[cv2.resize(covered, size, interpolation=cv2.INTER_NEAREST).ravel() > 0] = np.nan

    def _look_up(self, pixels: Array) -> tuple[Values, Values]:
        """Return values (N, K, F) at pixels (N, K, 2), NaN outside, and their slopes (2, N, K, F) by the pixel."""
        place = (pixels - self.corner + 0.5) / self.shrink - 0.5
        width, height = self.size
        outside = ~np.all((place >= 0) & (place <= [width - 1, height - 1]), -1)
        place = np.where(outside[..., None], 0.0, place)
        first = np.minimum(place.astype(np.intp), [width - 2, height - 2])
        right, down = np.moveaxis((place - first).astype(np.float32), -1, 0)[..., None]
        at = first[..., 1] * width + first[..., 0]
        here, beside, below, across = (self.images[at + step] for step in (0, 1, width, width + 1))
        upper, lower = here + right * (beside - here), below + right * (across - below)
        values = upper + down * (lower - upper)
        values[outside] = np.nan
        along = (beside - here) + down * ((across - below) - (beside - here))
        slopes = np.stack([along / np.float32(self.shrink[0]), (lower - upper) / np.float32(self.shrink[1])])
        return values, slopes

    def mirrored_by(self, sphere: Sphere, plane: Array, at: MirroredSamples) -> tuple[MirroredView, Values]:
        """Return what a chrome ball shows of the table, and its slopes (2, N, K, F) by the pixel that is looked up.

        `plane` is as in `TablePlane.values`.
        """
        values, slopes = self._look_up(self._pixels(self._looking(sphere, at), plane, at))
        depths, shown = _depths(sphere, at), _binned(values)
        until = np.where(np.isfinite(shown).all(0), depths[-1], depths[:-1]).min(-1)
        return MirroredView(depths, shown, sphere.radius_px, until), slopes

    def moves(self, sphere: Sphere, plane: Array, at: MirroredSamples, slopes: Values) -> Values:
        """Return (6, F, BINS, K), what `mirrored_by` shows more by (u, v, radius) and the plane's three numbers."""
        shown = [_binned(slope) for slope in slopes]
        # In a profile's few directions the pixels move alike: the middle one tells.
        looking = self._looked(sphere, at, MIDDLE)
        here = self._pixels(looking, plane, at)
        elsewhere = [self._pixels(self._looked(moved(sphere, e), at, MIDDLE), plane, at) for e in MOVE * np.eye(3)]
        elsewhere += [self._pixels(looking, plane + e, at) for e in MOVE * np.eye(3)]
        by = (np.nan_to_num((pixels - here) / MOVE).astype(np.float32) for pixels in elsewhere)
        return np.stack([move[..., 0] * shown[0] + move[..., 1] * shown[1] for move in by])

    def _pixels(self, looking: _Looking, plane: Array, at: MirroredSamples) -> Array:
        """Return the pixels (N, K, 2) that show what a ball mirrors; NaN where its rays miss the plane."""
        pixels = mirrored_pixels(self.camera, looking.ball, plane, looking.points, looking.mirrored)
        # Beside the outline itself the picture is blurred with the ball.
        away = np.sum((pixels - looking.outline[:, None]) * looking.normals[:, None], -1)
        return pixels + np.maximum(2.5 * at.blur_px - away, 0)[..., None] * looking.normals[:, None]

    def _looking(self, sphere: Sphere, at: MirroredSamples) -> _Looking:
        """Return the rays, kept for the next plane that is tried under the same ball."""
        key = (*sphere.center_px.tolist(), sphere.radius_px, at.blur_px, float(at.facing[-1]))
        if self.last is None or self.last[0] != key:
            self.last = key, self._looked(sphere, at)
        return self.last[1]

    def _looked(self, sphere: Sphere, at: MirroredSamples, which: slice = EVERY) -> _Looking:
        outline, normals = (each[which] for each in outline_with_normals(self.camera, sphere, PER_BIN * BINS))
        depths = sphere.radius_px * (1 - np.sqrt(1 - at.middle**2))
        ball = sized(sphere)
        rays = mirrored_rays(self.camera, ball, outline[:, None] - depths[:, None] * normals[:, None])
        return _Looking(ball, outline, normals, *rays)

    def profiles(self, sphere: Sphere, at: MirroredSamples) -> Values:
        """Return profiles (F, BINS, M) across an outline."""
        strips = read_strips(self.frames, *binned_outline(self.camera, sphere), at.offsets)
        return strips.reshape(len(strips), BINS, -1, len(at.offsets)).mean(2)


def _depths(sphere: Sphere, at: MirroredSamples) -> Array:
    """Return (K + 1,), how far inside the outline a ball is looked at, px."""
    return sphere.radius_px * (1 - np.sqrt(1 - at.facing**2))


def _binned(values: Values) -> Values:
    """Return the mean (F, BINS, K) of neighbours among (N, K, F)."""
    return np.ascontiguousarray(np.moveaxis(values.reshape(BINS, PER_BIN, *values.shape[1:]).mean(1), -1, 0))

"""Where the flash is mirrored on a chrome ball, to sub-pixels, on linear data."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from calibrate.detection.coarse import Coarse
from calibrate.lights.reflected_disc import Patch, fit_disc
from scene.camera import Camera
from scene.frames import Frames, gray
from scene.spheres import Sphere

Array = NDArray[np.float64]
GLOWING_PX = 40  # a clipped plateau of more pixels glows: its surroundings are the lens's, not the flash's
LEVEL, GLOWING_LEVEL = 0.3, 0.7  # share of a spot's height above which its centroid is taken, also of one that glows
INNER = 0.8  # share of its height above which its inner size is taken
FAINT = 0.1
"""A spot under this share of the ball's usual one, or of the frame's brightest, is no flash: the ball was in shadow, or
the flash misfired."""
FRONT = 0.9  # radii: beyond, a mirror shows what is behind it, never a flash that lights the object
PEAKS = 3  # bright places of a frame that may be the flash
PEAK_LIT, PEAK_EDGE = 0.2, 0.5
"""Share of the frame's brightest from which another place may be the flash; share of its own height down to which a
place reaches."""
SMOOTH_PX = 0.7
WINDOW_PX, WINDOW_SHARE, LARGEST_WINDOW = 6, 0.12, 0.6  # half a window: px at least, radii, and radii at most
CENTROID_PX, CENTROID_SHARE = 0.15, 0.06  # error of a centroid: px, and of the spot's size
GLARE_PX, GLARE_SHARE = 1.0, 0.1
"""How far from its core's middle, px and sizes, a spot may be fitted: farther, a streak of glare has drawn it there."""
CORE_SHARE, CORE_DEPTH = 0.1, 0.9  # error of a core's middle, sizes, and share of the depth that is its middle
NEIGHBOURS = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4  # of which interpolated green is the mean
MOSAIC = 0.05  # share of the other samples' miss that interpolated ones show


class Spot(NamedTuple):
    """Where a ball mirrors a flash."""

    pixel: Array  # (2,)
    sigma_px: float  # along one axis
    extent_px: float  # half the flash's size
    glare: bool = False  # a streak lies beside its core, and its core's middle was taken


class Peaks(NamedTuple):
    """The brightest places of one ball in F frames, the brightest first; NaN where there are fewer."""

    pixels: Array  # (F, PEAKS, 2) known to a coarse pixel
    strength: Array  # (F, PEAKS)


class Spots(NamedTuple):
    """Where one ball mirrors the flash in F frames; NaN where it does not."""

    pixels: Array  # (F, 2)
    sigma_px: Array  # (F,)
    extent_px: Array  # (F,)
    glare: NDArray[np.bool_]  # (F,)
    strength: Array  # (F,) height, in the ball's usual one
    outshone: NDArray[np.bool_]  # (F,) another place is brighter


def find_peaks(frames: Frames, coarse: Coarse, sphere: Sphere) -> Peaks:
    """Find the brightest places that come and go on a mirror ball, in each frame, on the shrunken ball.

    Notes
    -----
    What a frame adds to the median over frames is the flash and its company: the table, a window and the
    object that the ball mirrors do not move and drop out. What the flash lights brightly may be as bright as itself.
    """
    small = coarse.from_full(sphere)
    (u, v), r = small.center_px, small.radius_px
    box = coarse.box(small)
    rows, columns = box.grid
    values = coarse.window(frames, box)
    change = values - np.median(values, axis=0)
    pixels, strength = np.full((len(values), PEAKS, 2), np.nan), np.full((len(values), PEAKS), np.nan)
    for f, image in enumerate(change):
        smooth = cv2.GaussianBlur(image, (0, 0), SMOOTH_PX)
        top = (np.hypot(columns - u, rows - v) < FRONT * r) & (smooth >= cv2.dilate(smooth, np.ones((3, 3), np.uint8)))
        left = np.where(top, smooth, 0)
        for k in range(PEAKS):
            y, x = np.unravel_index(left.argmax(), left.shape)
            if left[y, x] <= (PEAK_LIT * strength[f, 0] if k else 0):
                break
            pixels[f, k], strength[f, k] = (x + box.columns.start, y + box.rows.start), left[y, x]
            places = np.asarray(cv2.connectedComponents((smooth > PEAK_EDGE * left[y, x]).astype(np.uint8))[1])
            left[places == places[y, x]] = 0
    return Peaks(coarse.to_full(pixels), strength)


def find_spots(
    frames: Frames, camera: Camera, coarse: Coarse, sphere: Sphere, peaks: Peaks, which: NDArray[np.intp]
) -> Spots:
    """Locate the flash on a mirror ball in each frame, at full size. `which` (F,) of its peaks is the flash."""
    each = np.arange(len(frames))
    rough, strength = peaks.pixels[each, which], peaks.strength[each, which]
    pixels, glare = np.full((len(frames), 2), np.nan), np.zeros(len(frames), bool)
    sigma, extent = np.full((2, len(frames)), np.nan)
    usual = np.nanmedian(strength) if np.isfinite(strength).any() else np.inf
    for f in np.flatnonzero(np.nan_to_num(strength) > FAINT * usual).tolist():
        spot = measure_spot(frames, f, camera, sphere, rough[f], factor=coarse.factor)
        if spot is not None:
            pixels[f], sigma[f], extent[f], glare[f] = spot
    return Spots(pixels, sigma, extent, glare, strength / usual, strength < peaks.strength[:, 0])


def measure_spot(
    frames: Frames, f: int, camera: Camera, sphere: Sphere, near: Array, *, factor: int = 1
) -> Spot | None:
    """Return the spot of frame `f` near a pixel that is known to `factor` pixels.

    Notes
    -----
    First the centroid of I - t over the connected region above t, 0.3 of the way from the surroundings to the peak.
    A clipped plateau has the same centre as the disc that it cuts off; a large one is taken at 0.7, above the lens's
    glow. From there `fit_disc`; where it fails the centroid is taken, with its larger sigma. Scratches throw streaks of
    glare beside a clipped flash, and both are drawn along: where the largest disc that the region holds lies elsewhere,
    its centre is taken, for a streak is thin.
    """
    half = int(max(WINDOW_PX, np.ceil(WINDOW_SHARE * sphere.radius_px), 3 * factor))
    u, v = np.round(near).astype(int)
    while True:
        top, left = max(v - half, 0), max(u - half, 0)
        rows, columns = slice(top, min(v + half + 1, frames.height)), slice(left, min(u + half + 1, frames.width))
        colours = frames.read(rows, [f], columns=columns)[0]
        if min(colours.shape[:2]) < 5:
            return None
        # Of a mosaic green is the densest.
        image = colours[..., 1] if frames.is_mosaic else gray(colours)
        white = frames.read(rows, [f], columns=columns, subtract_ambient=False)[0]
        white = white >= frames.saturation * frames.gain[f]
        clipped = white[..., 1] if frames.is_mosaic else white.any(-1)
        smooth = cv2.GaussianBlur(image, (0, 0), SMOOTH_PX)
        reach = max(2, 2 * factor)
        y0, x0 = v - top, u - left
        box = smooth[max(y0 - reach, 0) : y0 + reach + 1, max(x0 - reach, 0) : x0 + reach + 1]
        at = np.unravel_index(box.argmax(), box.shape)
        y, x = at[0] + max(y0 - reach, 0), at[1] + max(x0 - reach, 0)
        floor = float(np.median(np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])))
        peak = float(smooth[y, x])
        glows = clipped.sum() > GLOWING_PX
        level = floor + (GLOWING_LEVEL if glows else LEVEL) * (peak - floor)
        regions = np.asarray(cv2.connectedComponents((image > level).astype(np.uint8), connectivity=4)[1])
        region = regions == regions[y, x]
        size = float(np.sqrt(region.sum() / np.pi))
        if half > 2 * size + 3 or half > LARGEST_WINDOW * sphere.radius_px:
            break
        half *= 2
    if not regions[y, x]:
        return None
    weight = np.where(region, np.minimum(image, max(peak, level)) - level, 0) + 1e-12 * region
    ys, xs = np.mgrid[top : top + image.shape[0], left : left + image.shape[1]]
    center = np.array([np.sum(weight * xs), np.sum(weight * ys)]) / weight.sum()
    near_by = np.hypot(xs - center[0], ys - center[1]) < 2 * size + 3
    inner = float(np.sqrt(np.sum(region & (image > floor + INNER * (peak - floor))) / np.pi))
    # Between a disc's radius and a blurred point's deviation.
    extent = float(np.sqrt(size * inner))
    if frames.is_mosaic:
        # The sensor's own samples alone: what is interpolated errs with them.
        off, parity = np.abs(image - cv2.filter2D(image, -1, NEIGHBOURS)), (xs + ys) % 2
        miss = [float(off[1:-1, 1:-1][parity[1:-1, 1:-1] == p].mean()) for p in (0, 1)]
        near_by &= (parity == np.argmax(miss)) | (min(miss) > MOSAIC * max(miss))
    patch = Patch(
        np.stack([xs[near_by], ys[near_by]], -1).astype(float),
        (image[near_by].astype(float) - floor) / (peak - floor),
        clipped[near_by],
    )
    fit = fit_disc(camera, sphere, patch, center, radius_px=size, skirt_px=size - inner)
    spot = Spot(center, CENTROID_PX + CENTROID_SHARE * size, extent) if fit is None else Spot(*fit, extent)
    if not glows:
        return spot
    core = _core(region) + [left, top]
    if np.hypot(*(core - spot.pixel)) < max(GLARE_PX, GLARE_SHARE * size):
        return spot
    return Spot(core, max(spot.sigma_px, CORE_SHARE * size), extent, glare=True)


def _core(region: NDArray[np.bool_]) -> Array:
    """Return the centre (2,) of the largest disc that a region (h, w) holds."""
    depth = cv2.distanceTransform(np.pad(region, 1).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
    y, x = np.nonzero(depth > CORE_DEPTH * depth.max())
    weight = depth[y, x]
    return np.array([np.average(x, weights=weight), np.average(y, weights=weight)])

"""A ball's outline to sub-pixels: the cone that a sphere cuts, three unknowns, no free ellipse.

Offsets are measured along the outline's normals, and the three numbers of `Sphere` (center_px,
radius_px) move until the offsets vanish. Shadows and mirrored things that cross the outline are
outvoted: they lie elsewhere in other frames, or on a short arc.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from calibrate.coarse import shrunken
from calibrate.outline import moved, offset_jacobian, outline_with_normals, scaled
from scene.camera import Camera
from scene.frames import Frames
from scene.spheres import Kind, Sphere

Array = NDArray[np.float64]
SECTORS = 24
"""Errors along an outline come in arcs (a shadow, a reflection): an arc counts as one observation."""
EDGE_NOISES = 5.0
"""An edge must exceed the derivative's noise by this factor."""

SOFTEST = 8
"""Averaging of pixels up to which an unsharp outline is looked for."""
EDGE_FLOOR_PX, EDGE_FLOOR_SHARE = 0.05, 0.35
"""What lens blur, demosaicing and what is mirrored at the limb shift an outline by, beyond its edges' scatter: a
constant, and a share of the residual, because a faint outline among strong rims is shifted more."""


@dataclass(frozen=True)
class OutlineFit:
    """A fitted ball.

    Parameters
    ----------
    sphere : Sphere
        With `sigma_px` and `score`, the share of the outline on which an edge was found where the fit is.
    covariance : (3, 3) float64
        Of (center u, center v, radius), px^2.
    residual_px : float
        Robust spread of the edges about the outline.
    """

    sphere: Sphere
    covariance: Array
    residual_px: float


def fit_outline(frames: Frames, camera: Camera, sphere: Sphere, *, search_px: float) -> OutlineFit | None:
    """Fit the ball's outline in all frames at full size.

    Parameters
    ----------
    frames : Frames
    camera : Camera
    sphere : Sphere
        The start.
    search_px : float
        How far from the start the outline may lie.

    Returns
    -------
    OutlineFit or None
        None if less than a quarter of the outline shows an edge.
    """
    reach = search_px + 6
    low = np.floor(np.nanmin(outline_with_normals(camera, sphere, 90)[0], 0) - reach - 3).astype(int)
    high = np.ceil(np.nanmax(outline_with_normals(camera, sphere, 90)[0], 0) + reach + 4).astype(int)
    (left, top), (right, bottom) = np.maximum(low, 0), np.minimum(high, [camera.width, camera.height])
    if right - left < 4 or bottom - top < 4:
        return None
    left, top = left // SOFTEST * SOFTEST, top // SOFTEST * SOFTEST
    rows, columns = slice(int(top), int(bottom)), slice(int(left), int(right))
    crops = [frames.read(rows, [i], columns=columns)[0].mean(-1) for i in range(len(frames))]
    best = fit_crops(crops, (left, top), camera, sphere, search_px=search_px)
    factor = 2
    while factor <= SOFTEST and sphere.radius_px > 20 * factor and (best is None or best.sphere.score < 0.6):
        fit = _fit_shrunken(crops, (left, top), camera, sphere, search_px, factor)
        if fit is not None and (best is None or fit.sphere.score > best.sphere.score + 0.15):
            best = fit
        factor *= 2
    return best


def _fit_shrunken(
    crops: list[NDArray], corner: tuple[int, int], camera: Camera, sphere: Sphere, search_px: float, factor: int
) -> OutlineFit | None:
    """Fit in crops averaged over `factor` x `factor` pixels: an outline out of focus is no edge at full size."""
    height, width = (side // factor * factor for side in crops[0].shape)
    size = (width // factor, height // factor)
    small = [cv2.resize(crop[:height, :width], size, interpolation=cv2.INTER_AREA) for crop in crops]
    fit = fit_crops(
        small,
        (corner[0] // factor, corner[1] // factor),
        shrunken(camera, camera.width // factor, camera.height // factor, factor),
        scaled(sphere, 1 / factor),
        search_px=max(search_px / factor, 1.5),
    )
    if fit is None:
        return None
    sphere = replace(scaled(fit.sphere, factor), sigma_px=fit.sphere.sigma_px * factor)
    return OutlineFit(sphere, fit.covariance * factor**2, fit.residual_px * factor)


def _fit_from(
    crops: list[NDArray], corner: tuple[int, int], camera: Camera, sphere: Sphere, *, search_px: float
) -> OutlineFit | None:
    """Fit the outline from one start."""
    count = int(np.clip(2 * np.pi * sphere.radius_px, 120, 720))
    window, fit, reach = search_px, None, search_px
    for turn in range(10):
        points, normals = outline_with_normals(camera, sphere, count)
        jacobian = offset_jacobian(camera, sphere, points, normals)
        offsets = np.arange(-window - 3, window + 3.01, 0.25)
        edge = _edges_of_frames(crops, points - corner, normals, offsets, window, reach)
        if edge is None:
            return None
        angle, offset, weight = edge
        # What is not this outline (a cast shadow, a terminator, the rim of a reflection) gets no weight: the reach
        # shrinks onto the place where the frames agree.
        fit = _robust_step(jacobian[angle], offset, weight, reach)
        if fit is None:
            return None
        shift, residual, kept = fit
        reach = max(0.35, min(0.7 * reach, 3.5 * _spread(residual, weight, reach)))
        sphere = moved(sphere, shift)
        window = max(1.5, 0.6 * window)
        if turn >= 5 and reach == 0.35 and np.abs(shift).max() < 1e-3:
            break
    if fit is None:
        return None
    _, residual, kept = fit
    spread = _spread(residual, weight, 1.5)
    covariance = _clustered_covariance(jacobian[angle], residual, kept, np.asarray(angle * SECTORS // count), spread)
    seen = np.zeros(count, bool)
    seen[angle[np.abs(residual) < reach]] = True
    if seen.mean() < 0.25 or covariance is None:
        return None
    sphere = replace(
        sphere, sigma_px=float(np.sqrt((covariance[0, 0] + covariance[1, 1]) / 2)), score=float(seen.mean())
    )
    return OutlineFit(sphere, covariance, spread)


def fit_crops(
    crops: list[NDArray], corner: tuple[int, int], camera: Camera, sphere: Sphere, *, search_px: float
) -> OutlineFit | None:
    """Fit the outline in images (h, w) whose first pixel is `corner` (u, v) of the camera's image.

    The fit starts from three radii, and `best_outline` wins.
    """
    starts = [replace(sphere, radius_px=sphere.radius_px + d) for d in (-0.5 * search_px, 0.0, 0.5 * search_px)]
    fits = [fit for fit in (_fit_from(crops, corner, camera, s, search_px=search_px) for s in starts) if fit]
    return best_outline(fits, sphere.kind)


def best_outline(fits: list[OutlineFit], kind: Kind) -> OutlineFit | None:
    """Return the best of some fits of one ball, or None of none.

    On a matte ball the one on which most of the outline agrees wins; a mirror's outline runs beside the rims that
    it mirrors, all of them inside, and so of equals the outermost wins.
    """
    if not fits:
        return None
    if kind == "white":
        return max(fits, key=lambda fit: fit.sphere.score / max(fit.residual_px, 0.15))
    best = max(fit.sphere.score for fit in fits)
    return max((fit for fit in fits if fit.sphere.score >= 0.9 * best), key=lambda fit: fit.sphere.radius_px)


def fit_mask(mask: NDArray[np.bool_], camera: Camera, sphere: Sphere) -> OutlineFit | None:
    """Fit the outline to a given silhouette (H, W) bool."""
    image = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
    return fit_crops([image], (0, 0), camera, sphere, search_px=max(3.0, 0.06 * sphere.radius_px))


def _edges_of_frames(
    crops: list[NDArray], points: Array, normals: Array, offsets: Array, window: float, reach: float
) -> tuple[NDArray[np.intp], Array, Array] | None:
    """Find the edges along each normal in each frame: outline index, offset px, weight."""
    where = (points[:, None] + offsets[:, None] * normals[:, None]).astype(np.float32)
    step = offsets[1] - offsets[0]
    spacing = np.linalg.norm(np.roll(points, -1, 0) - points, axis=1).mean()
    usable = np.all((where > 1) & (where < np.array(crops[0].shape[::-1]) - 2), axis=(1, 2))
    noise = [0.28 * _noise(crop) for crop in crops]  # of the slope below: the norm of its kernel
    signal = np.zeros((len(crops), len(points), len(offsets)), np.float32)
    for i, crop in enumerate(crops):
        values = cv2.remap(crop.astype(np.float32), where[..., 0], where[..., 1], cv2.INTER_LINEAR)
        # Less what a wider kernel sees: a step stays, the ball's own shading and a soft shadow go.
        slope = gaussian_filter1d(values, 0.8 / step, axis=1, order=1) / step
        slope -= gaussian_filter1d(values, 2.4 / step, axis=1, order=1) / step
        slope = gaussian_filter1d(slope, 1.0 / spacing, axis=0, mode="wrap")
        signal[i] = slope / max(EDGE_NOISES * noise[i], 1e-4, 0.004 * np.abs(values).mean())
    square = signal**2
    standing = (square / (1 + square)).mean(0)
    inner = slice(1, -1)
    strength = np.abs(signal)
    peak = (strength[..., inner] >= strength[..., :-2]) & (strength[..., inner] > strength[..., 2:])
    # What is an edge in one frame only is a shadow's; of three frames two must agree.
    needed = min(0.3, max(0.12, 1.2 / len(crops)))
    wide = np.maximum(np.maximum(standing[:, :-2], standing[:, 2:]), standing[:, 1:-1])
    peak &= (strength[..., inner] > 1) & (wide > needed) & usable[:, None]
    peak &= np.abs(offsets[inner]) <= window
    frame, angle, at = np.nonzero(peak)
    if len(frame) < 20:
        return None
    before, here, after = (strength[frame, angle, at + d] for d in (0, 1, 2))
    bend = before - 2 * here + after
    sub = np.where(bend < 0, 0.5 * (before - after) / np.minimum(bend, -1e-12), 0)
    places = offsets[at + 1] + step * np.clip(sub, -0.5, 0.5)
    # On a matte ball's dark side the shading ends inside the outline: until the frames agree to half a pixel,
    # each frame's strongest edges count most. After that they would only pull toward the brighter side.
    strong = np.array([np.quantile(here[frame == f], 0.9) if np.any(frame == f) else 1.0 for f in range(len(crops))])
    weights = standing[angle, at + 1] / (0.25**2 + (1.5 / (EDGE_NOISES * here)) ** 2)
    if reach > 0.6:
        weights *= here**2 / (here**2 + 0.5 * strong[frame] ** 2)
    return angle, places, weights / weights.max()


def _noise(image: NDArray) -> float:
    """Return the pixel noise's standard deviation, blind to anything smooth or straight."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    return 1.4826 * float(np.median(np.abs(cv2.filter2D(image.astype(np.float32), -1, kernel)))) / 6


def _spread(offset: Array, weight: Array, window: float) -> float:
    """Return the robust standard deviation of the offsets near zero."""
    near = (np.abs(offset) < window) & (weight > 0)
    if not near.any():
        return window
    order = np.argsort(np.abs(offset[near]))
    share = np.cumsum(weight[near][order])
    return 1.4826 * float(np.abs(offset[near])[order][np.searchsorted(share, 0.5 * share[-1])])


def _robust_step(jacobian: Array, offset: Array, weight: Array, reach: float) -> tuple[Array, Array, Array] | None:
    """Return shift (3,), residuals (K,) and weights (K,) of a Tukey-weighted linear fit."""
    shift = np.zeros(3)
    w = weight
    for _ in range(10):
        residual = offset - jacobian @ shift
        w = weight * np.maximum(1 - (residual / reach) ** 2, 0) ** 2
        normal = jacobian.T @ (w[:, None] * jacobian)
        if np.count_nonzero(w) < 12 or np.linalg.cond(normal) > 1e8:
            return None
        previous, shift = shift, np.linalg.solve(normal, jacobian.T @ (w * offset))
        if np.abs(shift - previous).max() < 1e-4:
            break
    return np.asarray(shift, np.float64), np.asarray(offset - jacobian @ shift, np.float64), w


def _clustered_covariance(
    jacobian: Array, residual: Array, weight: Array, sector: NDArray[np.intp], spread: float
) -> Array | None:
    """Return the (3, 3) covariance of a weighted fit whose errors agree within a sector.

    Notes
    -----
    The sandwich H^-1 (sum_s g_s g_s^T) H^-1, g_s = sum over the sector's edges of w r J, times S / (S - 3).
    Thousands of edges on one outline are not thousands of observations: the same arc errs alike in all frames.
    """
    normal = jacobian.T @ (weight[:, None] * jacobian)
    scores = weight[:, None] * residual[:, None] * jacobian
    sums = np.stack([scores[sector == s].sum(0) for s in np.unique(sector)])
    if len(sums) < 5 or np.linalg.cond(normal) > 1e8:
        return None
    inverse = np.linalg.inv(normal)
    covariance = inverse @ (sums.T @ sums) @ inverse * len(sums) / (len(sums) - 3)
    return covariance + np.eye(3) * (EDGE_FLOOR_PX**2 + (EDGE_FLOOR_SHARE * spread) ** 2)

"""A ball's outline as a curve in the picture, the photographs along the lines that cross it, and the edges there.

Offsets are measured along the outline's normals, and the three numbers of `Sphere` (center_px, radius_px) move until
the offsets vanish. Shadows and reflections that cross the outline are outvoted: they lie elsewhere in other frames, or
on a short arc.
"""

from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from scene.camera import Camera
from scene.frames import PEDESTAL, WHITE, Frames, decode
from scene.robust import MAD, tukey
from scene.spheres import Sphere

Array = NDArray[np.float64]
CLIPPED = 0.95  # share of the sensor's saturation from which an interpolated sample may hold a clipped one
BINS = 72
"""Profiles along the outline, each a mean of neighbours: amplitudes may be averaged, a shift read in noise may not."""
SECTOR = np.arange(BINS) // 3
"""Errors along an outline come in arcs (a shadow, a reflection): an arc of three profiles counts as one observation."""
OUTLINE_STEP_PX = 0.05  # of the differences that give the Jacobian
EDGE_NOISES = 5.0  # an edge must exceed the derivative's noise by this factor,
EDGE_SHARE, EDGE_LEAST = 0.004, 1e-4 / EDGE_NOISES  # this share of the frame's mean level, and a least slope per px
NARROW, WIDE = 0.8, 2.4  # widths, in softnesses, of the derivative, and of the wider one that is subtracted from it
KERNEL_REACH = 4.0  # softnesses by which strips must go beyond the offsets that are searched
FEWEST_EDGES, FEWEST_WEIGHTS = 20, 12  # to try a fit at all, and to solve for an outline
SEEN_IN = 1.2  # frames of few, but 0.12 to 0.3 of all, must show an edge: what one frame alone shows is a shadow's
TURNS = 14
SHRINK = 0.7  # of the reach from turn to turn, at most; it follows `REACH` spreads of what is left
REACH = 3.5
BRIGHT_REACH_PX = 0.6  # reach from which on all edges count alike
SINGULAR = 1e8  # condition from which on an outline is not determined


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


def binned_outline(camera: Camera, sphere: Sphere) -> tuple[Array, Array]:
    """Return points and normals (`BINS` k, 2), about a pixel apart."""
    count = BINS * int(np.clip(np.ceil(2 * np.pi * sphere.radius_px / BINS), 2, 12))
    return outline_with_normals(camera, sphere, count)


def binned_jacobian(camera: Camera, sphere: Sphere) -> Array:
    """Return (`BINS`, 3), what the outline's offset in the middle of each bin changes by with u, v and radius."""
    return offset_jacobian(camera, sphere, *outline_with_normals(camera, sphere, BINS))


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


class RimEdges(NamedTuple):
    """K edges across an outline, in whichever frame."""

    point: NDArray[np.intp]  # (K,) number of the outline's point
    offset: Array  # (K,) outward of the outline, px
    weight: Array  # (K,) 1 for the best
    prominence: Array  # (K,) 0 to 1, less for what is faint in its own frame


class Agreement(NamedTuple):
    """An outline on which edges agree."""

    shift: Array  # (3,) from the start, px
    score: float  # share of the outline's points that show an edge
    spread: float  # of the edges, px


def find_edges(
    strips: NDArray[np.float32], offsets: Array, spacing_px: float, *, softness: float, search_px: float
) -> RimEdges | None:
    """Find the edges in strips (F, N, M) across an outline, NaN where unknown; None where there are too few.

    `offsets` (M,) are even, px; `spacing_px` lies between neighbouring points of the outline; `softness` is the edges'
    scale, 1 for a sharp picture; edges beyond `search_px` are not looked at.
    """
    step = offsets[1] - offsets[0]
    unit = np.eye(len(offsets))
    # Less what a wider kernel sees: a step stays, the ball's own shading and a soft shadow go.
    narrow = gaussian_filter1d(unit, NARROW * softness / step, axis=0, order=1) / step
    kernel = narrow - gaussian_filter1d(unit, WIDE * softness / step, axis=0, order=1) / step
    known = np.isfinite(strips)
    values = np.where(known, strips, 0)
    margin = max(1, round(2 * NARROW * softness / step))
    holes = gaussian_filter1d((~known).astype(np.float32), margin, axis=2) > 0.02
    slope = values @ kernel.T.astype(np.float32)
    slope = gaussian_filter1d(slope, 1.0 * softness / spacing_px, axis=1, mode="wrap")
    slope[holes] = 0
    # The second difference along the outline is blind to whatever runs along it: noise, through the same kernels;
    # its deviation is sqrt(1.5) = 1.22 times the noise's.
    second = slope - 0.5 * (np.roll(slope, 3, 1) + np.roll(slope, -3, 1))
    noise = MAD / 1.22 * np.median(np.abs(second), axis=(1, 2))
    level = np.abs(values).mean((1, 2))
    limit = np.maximum(EDGE_NOISES * np.maximum(noise, EDGE_LEAST), EDGE_SHARE * level)
    signal = slope / limit[:, None, None]
    square = signal**2
    static = (square / (1 + square)).mean(0)
    strength = np.abs(signal)
    here = strength[..., 1:-1]
    peak = (here >= strength[..., :-2]) & (here > strength[..., 2:]) & (here > 1)
    wide = np.maximum(np.maximum(static[:, :-2], static[:, 2:]), static[:, 1:-1])
    peak &= (wide > np.clip(SEEN_IN / len(strips), 0.12, 0.3)) & (np.abs(offsets[1:-1]) <= search_px)
    # Three widths beside a strong edge the wider kernel alone makes an echo of it, with nothing there to see.
    steep = (values @ narrow.T.astype(np.float32))[..., 1:-1]
    peak &= steep * slope[..., 1:-1] > 0.5 * slope[..., 1:-1] ** 2
    frame, point, at = np.nonzero(peak)
    if len(frame) < FEWEST_EDGES:
        return None
    before, middle, after = (strength[frame, point, at + k] for k in (0, 1, 2))
    bend = before - 2 * middle + after
    sub = np.where(bend < 0, 0.5 * (before - after) / np.minimum(bend, -1e-12), 0)
    places = offsets[at + 1] + step * np.clip(sub, -0.5, 0.5)
    strong = np.array([np.quantile(middle[frame == f], 0.9) if np.any(frame == f) else 1 for f in range(len(strips))])
    # 1 / variance of an edge's place: 0.25 px, and what the noise adds.
    weight = static[point, at + 1] / (0.25**2 + (1.5 / (EDGE_NOISES * middle)) ** 2)
    prominence = middle**2 / (middle**2 + 0.5 * strong[frame] ** 2)
    return RimEdges(point, places, weight / weight.max(), prominence)


def agree(edges: RimEdges, jacobian: Array, *, start: Array, reach_px: float, closest_px: float) -> Agreement | None:
    """Return the outline near the shift `start` (3,) of (u, v, radius) on which the edges agree, or None.

    `jacobian` (N, 3): see `offset_jacobian`. Edges as far as `reach_px` from the outline are believed at first,
    `closest_px` at last: what is not this outline (a cast shadow, a terminator, the rim of a reflection) loses its
    weight as the reach shrinks to the place where the frames agree.
    """
    shift, reach = start, reach_px
    residual = edges.offset - (jacobian @ shift)[edges.point]
    for turn in range(TURNS):
        # On a matte ball's dark side the shading ends inside the outline: until the frames agree to half a pixel,
        # each frame's strongest edges count most. After that they would only pull toward the brighter side.
        weight = edges.weight * edges.prominence if reach > BRIGHT_REACH_PX else edges.weight
        step = robust_step(jacobian, residual, weight, reach, point=edges.point)
        if step is None:
            return None
        shift = shift + step
        residual = edges.offset - (jacobian @ shift)[edges.point]
        if turn > 4 and np.abs(step).max() < 1e-2 and reach == closest_px:
            break
        reach = max(closest_px, min(SHRINK * reach, REACH * _spread(residual, weight, reach)))
    seen = np.zeros(len(jacobian), bool)
    seen[edges.point[np.abs(residual) < reach]] = True
    return Agreement(shift, float(seen.mean()), _spread(residual, edges.weight, max(1.5, 2 * closest_px)))


def robust_step(
    jacobian: Array, offset: Array, weight: Array, reach: float | Array, *, point: NDArray[np.intp] | None = None
) -> Array | None:
    """Return the shift (3,) of a Tukey-weighted linear fit, or None where it is not determined.

    `jacobian` (N, 3) has a row for each offset (K,), or for each `point` (K,) of the outline that offsets lie at.
    """
    # Edges at one point of the outline share its row: they are summed before the rows are multiplied.
    point = np.arange(len(jacobian)) if point is None else point
    shift = np.zeros(3)
    for _ in range(10):
        w = weight * tukey(offset - (jacobian @ shift)[point], reach)
        normal = jacobian.T @ (np.bincount(point, w, len(jacobian))[:, None] * jacobian)
        if np.count_nonzero(w) < FEWEST_WEIGHTS or np.linalg.cond(normal) > SINGULAR:
            return None
        right = jacobian.T @ np.bincount(point, w * offset, len(jacobian))
        previous, shift = shift, np.linalg.solve(normal, right)
        if np.abs(shift - previous).max() < 1e-4:
            break
    return np.asarray(shift, np.float64)


def _spread(offset: Array, weight: Array, window: float) -> float:
    """Return the robust standard deviation of the offsets near zero, by their weighted median."""
    near = (np.abs(offset) < window) & (weight > 0)
    if not near.any():
        return window
    order = np.argsort(np.abs(offset[near]))
    share = np.cumsum(weight[near][order])
    return MAD * float(np.abs(offset[near])[order][np.searchsorted(share, 0.5 * share[-1])])

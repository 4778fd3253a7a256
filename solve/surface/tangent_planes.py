"""What the normals say of each pixel's neighbours: the steps of depth from one to the next by their tangent planes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from scene.camera import Camera

Array = NDArray[np.float64]

_STEEPEST = 0.03
"""Least cosine between normal and ray: a surface seen more edge-on than 88 degrees is taken as 88."""
_FARTHEST = 0.1
"""No pixel of a finer grid is placed nearer or farther than its parent by more than this share."""


@dataclass(frozen=True)
class GridAxis:
    """A pixel and the next along an axis of the picture, all (h, w) at the first of the two, lengths in pixels.

    `pair`: both count. `top`, `bottom` (2, h, w): numerator and denominator of the step to the next, for the
    normal of the first, of the next. `weight`: squared cosine of the more edge-on one.
    """

    axis: int
    pair: NDArray[np.bool_]
    top: Array
    bottom: Array
    weight: Array
    focal: float
    is_orthographic: bool

    def depth_step(self, first: Array | float, second: Array | float) -> Array:
        """Return how much deeper the next one is by the weighted sum of the two normals, in pixels."""
        top = first * self.top[0] + second * self.top[1]
        bottom = first * self.bottom[0] + second * self.bottom[1]
        return self.focal * (top / bottom if self.is_orthographic else np.log(top / bottom))

    def next(self, values: NDArray) -> NDArray:
        """Return each pixel's next one's value."""
        return np.roll(values, -1, self.axis)

    def last(self, values: NDArray) -> NDArray:
        """Return the value of each pixel's last one."""
        return np.roll(values, 1, self.axis)


@dataclass(frozen=True)
class GridEdges:
    """All neighbours of a box of pixels: `inside` (h, w) which count, `cosine` (h, w) between normal and view."""

    inside: NDArray[np.bool_]
    cosine: Array
    axes: tuple[GridAxis, GridAxis]

    def gaps(self, axis: GridAxis, depth: Array) -> tuple[Array, Array]:
        """Return how far the next lies off the first's tangent plane, and the first off the next's, in pixels."""
        gap = np.where(axis.pair, axis.next(depth) - depth, 0.0)
        forth, back = gap - axis.depth_step(1.0, 0.0), gap - axis.depth_step(0.0, 1.0)
        return np.abs(self.cosine * forth), np.abs(axis.next(self.cosine) * back)


def edges_of(normals: Array, inside: NDArray[np.bool_], camera: Camera, box: tuple[slice, slice]) -> GridEdges:
    """Return the edges of the pixels `inside` (h, w) a box (rows, columns) with unit normals (h, w, 3)."""
    focal = np.sqrt(camera.fx * camera.fy)
    base, rays = camera.rays(camera.grid(box[0])[:, box[1]])
    cosine = -np.sum(normals * rays, -1)
    least = max(_STEEPEST, 3 / focal) if not camera.is_orthographic else _STEEPEST
    steep = inside & (cosine < least)
    flat = normals + cosine[..., None] * rays
    length = np.linalg.norm(flat, axis=-1, keepdims=True)
    flat = np.sqrt(1 - least**2) * flat / np.where(length > 0, length, 1) - least * rays
    normals = np.where(steep[..., None], flat, normals)
    cosine = np.where(inside, np.maximum(cosine, least), 1.0)
    rays = rays / -rays[..., 2:]
    axes = []
    for axis in (1, 0):
        pair = inside & np.roll(inside, -1, axis)
        np.moveaxis(pair, axis, 0)[-1] = False
        both = np.stack([normals, np.roll(normals, -1, axis)])
        if camera.is_orthographic:
            # Depth is -z, as in perspective.
            top, bottom = np.sum(both * (np.roll(base, -1, axis) - base), -1), both[..., 2]
        else:
            top, bottom = -np.sum(both * rays, -1), -np.sum(both * np.roll(rays, -1, axis), -1)
        # Where there is no pair: a step of nothing.
        top, bottom = np.where(pair, top, 0.0 if camera.is_orthographic else 1.0), np.where(pair, bottom, 1.0)
        weight = np.where(pair, np.minimum(cosine, np.roll(cosine, -1, axis)) ** 2, 0.0)
        axes.append(GridAxis(axis, pair, top, bottom, weight, float(focal), camera.is_orthographic))
    return GridEdges(inside, cosine, (axes[0], axes[1]))


def finer(z_mm: Array, normals: NDArray, camera: Camera) -> Array:
    """Return a depth (H, W) from that of every second pixel, each pixel in the tangent plane of its parent.

    `z_mm` (ceil(H / 2), ceil(W / 2)) is NaN where unknown, `normals` (H, W, 3) are finite where it is known, and
    `camera` is that of the finer grid. The parent is the pixel of the coarser grid with a depth that is nearest to the
    one above and left.
    """
    height, width = normals.shape[:2]
    nearest = np.asarray(distance_transform_edt(~np.isfinite(z_mm), return_distances=False, return_indices=True))
    rows, columns = (np.arange(size) // 2 for size in (height, width))
    row, column = nearest[:, rows[:, None], columns[None]]
    depth, normal = z_mm[row, column], normals[2 * row, 2 * column]
    base, rays = camera.rays(camera.grid())
    if camera.is_orthographic:
        way = base - base[2 * row, 2 * column]
        slope = -np.sum(normal[..., :2] * way[..., :2], -1) / np.maximum(normal[..., 2], 0.03)
        return depth + slope
    rays = rays / -rays[..., 2:]
    ratio = np.sum(normal * rays[2 * row, 2 * column], -1) / np.sum(normal * rays, -1)
    # A parent seen edge-on says little of how deep its children are.
    return depth * np.clip(np.nan_to_num(ratio, nan=1.0), 1 / (1 + _FARTHEST), 1 + _FARTHEST)

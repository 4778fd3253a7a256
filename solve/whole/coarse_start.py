"""From a depth on every second pixel to a depth on every pixel: a start for the finer grid."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from scene.camera import Camera

Array = NDArray[np.float64]

_FARTHEST = 0.1
"""No pixel is placed nearer or farther than its parent by more than this share."""


def every_second(camera: Camera) -> Camera:
    """Return the camera whose pixels are every second one of a camera's, from the first on."""
    return replace(
        camera,
        width=(camera.width + 1) // 2,
        height=(camera.height + 1) // 2,
        fx=camera.fx / 2,
        fy=camera.fy / 2,
        cx=camera.cx / 2,
        cy=camera.cy / 2,
    )


def finer(z_mm: Array, normals: NDArray, camera: Camera) -> Array:
    """Return a depth (H, W) from that of every second pixel, each pixel in the tangent plane of its parent.

    Parameters
    ----------
    z_mm : (ceil(H / 2), ceil(W / 2)) float64
        NaN where unknown.
    normals : (H, W, 3) float
        Finite where `z_mm` is.
    camera : Camera
        Of the finer grid.

    Notes
    -----
    The parent is the pixel of the coarser grid with a depth that is nearest to the one above and left.
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

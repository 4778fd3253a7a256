"""Light that the object's visible surface throws upon itself, in every frame."""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from scene.camera import Camera
from scene.fan_out import fan_out
from scene.normals import filled
from solve.surface.integration import integrate

CHUNK = 256
CHECKS = 12
"""Places at which it is checked that nothing stands between two patches."""


class Thrown(NamedTuple):
    """The light thrown upon patches (N, F), in units of their samples; and of each pixel, the four patches about it
    (P, 4) and their shares (P, 4).
    """

    patches: NDArray[np.float32]
    corner: NDArray[np.intp]
    share: NDArray[np.float32]

    @classmethod
    def none(cls, pixels: int, frames: int) -> "Thrown":
        """Return no light at all."""
        corner = np.zeros((pixels, 4), np.intp)
        return cls(np.zeros((1, frames), np.float32), corner, corner.astype(np.float32))


class Relief:
    """The picture in which pixels lie, and every n-th of them, which serve as the patches of its surface.

    Parameters
    ----------
    mask : (H, W) bool
        The P pixels.
    camera : Camera
    depth : float
        z of the object, mm, where the camera has a perspective.
    patches : int
        How many there should be.
    """

    def __init__(self, mask: NDArray[np.bool_], camera: Camera, depth: float, patches: int) -> None:
        self._mask, self._depth = mask, depth
        self._step = max(1, round(np.sqrt(np.count_nonzero(mask) / patches)))
        self._camera = camera.every(self._step)
        number = np.full(mask.shape, -1)
        number[mask] = np.arange(np.count_nonzero(mask))
        self._number = number[:: self._step, :: self._step]

    def patches(self, known: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return the numbers of the pixels that are patches, of those that are known (P,)."""
        number = self._number[self._number >= 0]
        return number[known[number]]

    def throw(self, chosen: NDArray[np.intp], gray: NDArray[np.float32], normals: NDArray) -> Thrown:
        """Return the light that patches throw upon each other, of their samples (N, F) and normals (N, 3).

        Notes
        -----
        A matte patch is as bright from everywhere as the camera sees it, shadows and all [Nayar1991]. So one product of
        form factors and samples gives the light thrown, to any number of bounces, but for the reflectance at which a
        sample is 1. The surface is the normals' integral; what the camera does not see throws nothing.
        """
        inside = np.isin(self._number, chosen)
        field = np.full((*inside.shape, 3), np.nan)
        field[inside] = normals
        surface = integrate(field, self._camera, z_mm=self._depth)
        points = surface.points_mm(self._camera)[inside]
        rays = self._camera.rays(self._camera.grid())[1][inside]
        side = 1 / self._camera.fx if self._camera.is_orthographic else -points[:, 2] / self._camera.fx
        area = side**2 / np.maximum(-np.sum(normals * rays, 1), 0.1)
        area[~np.isfinite(points).all(1)] = 0
        heights = np.nan_to_num(surface.z_mm, nan=-np.inf)
        seen = np.nan_to_num(points), normals, area, np.argwhere(inside), heights, gray
        thrown = np.zeros(gray.shape, np.float32)
        fan_out(lambda first: _gather(*seen, thrown, first), range(0, len(gray), CHUNK))
        return Thrown(thrown, *self._corners(inside))

    def _corners(self, inside: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
        """Return the patches about each pixel and their shares, bilinear; beside the outline, the nearest serve."""
        patch = filled(np.cumsum(inside).reshape(inside.shape) - 1, inside)
        patch = np.pad(patch, ((0, 1), (0, 1)), mode="edge")
        row, column = np.nonzero(self._mask)
        (row, y), (column, x) = np.divmod(row, self._step), np.divmod(column, self._step)
        y, x = y / self._step, x / self._step
        corner = np.stack([patch[row + down, column + right] for down in (0, 1) for right in (0, 1)], -1)
        share = np.stack([(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x], -1)
        return corner, share.astype(np.float32)


@numba.njit(nogil=True, cache=True)
def _gather(points, normals, area, place, heights, gray, out, first):  # pragma: no cover
    """Fill `out` (N, F) with what comes from all patches in sight: of some CHUNK of the patches."""
    for i in range(first, min(first + CHUNK, len(points))):
        for j in range(len(points)):
            x, y, z = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
            here = normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z
            there = -(normals[j, 0] * x + normals[j, 1] * y + normals[j, 2] * z)
            if here <= 0 or there <= 0 or area[i] == 0 or area[j] == 0:
                continue
            # A disk on the axis of another: finite also where they touch.
            square = x * x + y * y + z * z
            factor = here * there * area[j] / (square * (np.pi * square + area[j]))
            if factor < 1e-6:
                continue
            rows, columns = place[j, 0] - place[i, 0], place[j, 1] - place[i, 1]
            checks, clear = min(max(abs(rows), abs(columns)), CHECKS), True
            for k in range(1, checks):
                t = k / checks
                between = heights[int(place[i, 0] + t * rows + 0.5), int(place[i, 1] + t * columns + 0.5)]
                # The surface is known to a patch's width at best.
                if between > points[i, 2] + t * z + np.sqrt(area[j]):
                    clear = False
                    break
            if clear:
                for k in range(gray.shape[1]):
                    out[i, k] += factor * gray[j, k]
